#!/usr/bin/env python3
"""Lists the records of measurements in benches/runs, and measures those again that are older
than the code they measured.

    python3 benches/records.py                      every measurement and whether it is old
    python3 benches/records.py measure [PLACE ...]  runs the commands of the old ones

A PLACE is the name of a measurement as the list prints it, `far.md#levels-against-the-finest`
for instance; with it, a measurement is made again even if it is not old. Those that have a row
`not measured again` are left out unless they are named. What the commands print is kept in
target/records/PLACE.txt, under a head that gives commit, machine and load as rows for the
record, with user time and largest memory of every command; a measurement whose output is of
the same code is not repeated, so an interrupted run goes on where it stopped. Other files that
the commands left in target/records are kept for that, and removed when the code is another one.
The figures are then copied into the record by hand.

Commands are the spans of code in the row `command`. They run in the root of the repository
with `organza` of target/release, which is built first. tests/claims.rs describes the rows.
"""

import hashlib
import os
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RUNS = ROOT / "benches" / "runs"
OUTPUT = ROOT / "target" / "records"
COMMIT = re.compile(r"`([0-9a-f]{7,40})`")


def anchor(heading):
    kept = "".join(c for c in heading.strip().lower() if c.isalnum() or c in " -_")
    return kept.replace(" ", "-")


def measurements():
    """Place and rows of every measurement."""
    found = []
    for path in sorted(RUNS.glob("*.md")):
        place, rows = path.name, None
        for line in path.read_text().splitlines():
            if line.startswith("## "):
                place = f"{path.name}#{anchor(line[3:])}"
            cells = line.strip("| ").split(" | ", 1)
            if line.startswith("| commit | "):
                rows = {}
                found.append((place, rows))
            if rows is not None and line.startswith("| ") and len(cells) == 2:
                rows[cells[0].strip()] = cells[1].strip()
            else:
                rows = None
    return found


def git(*arguments):
    run = subprocess.run(["git", "-C", ROOT, *arguments], capture_output=True, text=True, errors="replace")
    return run.stdout.strip() if run.returncode == 0 else None


def changed_lines(commit, code):
    """Lines of code, without comments and tests, that differ from the working tree."""
    tests = ["**/tests/**", "**/*_tests/**", "**tests.rs"]
    paths = [*code, *(f":(exclude){t}" for t in tests)]
    difference = git("diff", "-M", "-U0", commit, "--", *paths)
    if difference is None:
        sys.exit(f"git knows no commit {commit}: is this clone shallow?")
    count, is_test = 0, False
    for line in difference.splitlines():
        if line.startswith("@@ "):
            # The last line before it that is not indented: that of a module of tests.
            is_test = line.endswith(" mod tests {")
        elif line[1:].strip() in ("mod tests {", "#[cfg(test)]"):
            is_test = True  # a module of tests that is new ends its file
        elif not is_test and re.match(r"[+-](?!\+\+|--)\s*\S", line):
            count += not line[1:].lstrip().startswith("//")
    return count


def age(rows):
    """Lines changed since the commit that the figures hold for."""
    held = rows.get("still holds", "")
    if re.match(r"`[^`]*tests/", held):
        return 0
    redated = COMMIT.match(held)
    named = redated or COMMIT.search(rows["commit"])
    if named is None or "code" not in rows:
        sys.exit(f"a record of commit {rows['commit']} names no commit or no code")
    commit = named[1]
    return changed_lines(commit, re.findall(r"`([^`]+)`", rows["code"]))


def spans(command):
    """Spans of code that are commands: names of files and of flags are none."""
    return [s for s in re.findall(r"`([^`]+)`", command) if " " in s and not s.startswith("-")]


def measure(place, rows):
    """Runs the commands of a measurement, unless their output is of this code."""
    kept = OUTPUT / f"{place.replace('#', '.')}.txt"
    if kept.exists():
        commit = COMMIT.search(kept.read_text())
        code = re.findall(r"`([^`]+)`", rows["code"])
        if commit and changed_lines(commit[1], code) == 0:
            print(f"{place}: measured already, {kept.relative_to(ROOT)}")
            return
    commands = spans(rows["command"])
    if not commands:
        print(f"{place}: names no command that runs by itself: {rows['command']}")
        return
    is_changed = " with uncommitted changes" if git("status", "--porcelain", "-uno") else ""
    rustc = subprocess.run(["rustc", "--version"], capture_output=True, text=True).stdout
    load = "/".join(f"{x:.1f}" for x in os.getloadavg())
    model = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text()) if Path(
        "/proc/cpuinfo").exists() else None
    machine = model[1] if model else platform.processor() or platform.machine()
    head = (
        f"| commit | `{git('rev-parse', '--short', 'HEAD')}`{is_changed} |\n"
        f"| machine | {machine}, {os.cpu_count()} cores, {' '.join(rustc.split()[:2])} |\n"
        f"| load | averages of {load} over 1, 5 and 15 minutes before |\n\n"
    )
    environment = {**os.environ, "PATH": f"{ROOT / 'target/release'}:{os.environ['PATH']}"}
    text = head
    for command in commands:
        print(f"{place}: {command}", flush=True)
        with subprocess.Popen(
            ["bash", "-c", command], cwd=ROOT, env=environment, text=True, errors="replace",
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        ) as run:  # fmt: skip
            printed = run.stdout.read()
            _, status, used = os.wait4(run.pid, 0)
            run.returncode = os.waitstatus_to_exitcode(status)
        if run.returncode:
            print(f"{place}: failed\n{printed[-2000:]}")
            return
        cost = f"{used.ru_utime:.1f} s of user time, {used.ru_maxrss / 1024:.0f} MiB at most"
        text += f"$ {command}\n{printed}({cost})\n\n"
    kept.write_text(text)
    print(f"{place}: {kept.relative_to(ROOT)}")


def forget_other_code():
    """Removes what commands left that measured other code than today's."""
    state = f"{git('rev-parse', 'HEAD')}\n{git('diff', 'HEAD', '--', 'crates', 'benches')}"
    state = hashlib.sha256(state.encode()).hexdigest()
    marker = OUTPUT / "code"
    if marker.exists() and marker.read_text() == state:
        return
    for path in OUTPUT.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        elif path.suffix != ".txt":
            path.unlink()
    marker.write_text(state)


def main():
    all_of_them = measurements()
    if len(sys.argv) == 1:
        for place, rows in all_of_them:
            lines = age(rows)
            state = f"{lines} lines of its code changed" if lines else "not older than its code"
            if lines and "not measured again" in rows:
                state += f"; not measured again: {rows['not measured again']}"
            print(f"{place}: {state}")
        return
    if sys.argv[1] != "measure":
        sys.exit(__doc__)
    named = sys.argv[2:]
    unknown = set(named) - {place for place, _ in all_of_them}
    if unknown:
        sys.exit(f"no such measurement: {', '.join(sorted(unknown))}")
    OUTPUT.mkdir(parents=True, exist_ok=True)
    forget_other_code()
    subprocess.run(["cargo", "build", "--release"], cwd=ROOT, check=True)
    for place, rows in all_of_them:
        is_due = "not measured again" not in rows and age(rows) > 0
        if place in named or (not named and is_due):
            measure(place, rows)


if __name__ == "__main__":
    main()
