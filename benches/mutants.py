#!/usr/bin/env python3
"""Changes the code in one place at a time and counts which changes the tests of its crate find.

    python3 benches/mutants.py scatter [COUNT]      tests COUNT mutants (25), then prints a table
    python3 benches/mutants.py scatter COUNT COMMIT tests those of them again that survived at COMMIT

Needs `cargo install cargo-mutants --locked`, which lists the mutants of a crate. COUNT of them
are drawn with a fixed seed, so a greater COUNT extends the same sample. To build once and not once
a mutant, all are written into one copy of the commit that is checked out: a function with a
mutant has its body twice, and the variable ORGANZA_MUTANT chooses the mutant that runs. Those
that do not compile in this way (constants, for example) are built alone; those that do not
compile alone are no evidence, and are not counted among those that died.

The copy, target/mutants/CRATE/tree, is tested with TESTS until the first test fails. Without a
mutant all tests must pass. A mutant for which they take much longer than without it counts as
found, and is listed apart. What is known already is in target/mutants/CRATE/COMMIT.jsonl: an
interrupted run resumes there. A mutant is known by its place in the list, which new tests do not
change; what died at an earlier COMMIT dies as long as only tests are added.
"""

import io
import json
import os
import random
import signal
import subprocess
import sys
import tarfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SEED = 24
# Packages and their tests that are quick enough to be run once a mutant.
TESTS = {
    "scatter": [["scatter", "--lib", "--test=packed_precision", "--test=ply_precision", "--test=slabs"]],
    "volume": [["volume", "--lib", "--test=volume"]],
    "kernel": [["kernel", "--lib"], ["transport", "--test=kernel"]],
    "measure": [["measure", "--lib"]],
}
# Code that these tests do not compile: the engine for graphics cards.
EXCLUDED = {"kernel": ["crates/kernel/src/gpu/**"]}
# Chooses the mutant that runs.
SWITCH = """
/// The mutant that runs.
pub mod mutant {
    /// True if it is this one.
    pub fn is(number: usize) -> bool {
        static CHOSEN: std::sync::LazyLock<Option<usize>> =
            std::sync::LazyLock::new(|| std::env::var("ORGANZA_MUTANT").ok()?.parse().ok());
        *CHOSEN == Some(number)
    }
}
"""


def tree(crate):
    """A copy of the commit that is checked out, and its name."""
    commit = subprocess.check_output(["git", "rev-parse", "HEAD"], cwd=ROOT, text=True).strip()
    copy = ROOT / "target" / "mutants" / crate / "tree"
    archive = subprocess.check_output(["git", "archive", commit], cwd=ROOT)
    with tarfile.open(fileobj=io.BytesIO(archive)) as files:
        for file in filter(tarfile.TarInfo.isfile, files):
            path, content = copy / file.name, files.extractfile(file).read()
            # Only what differs, or cargo builds all again.
            if not path.exists() or path.read_bytes() != content:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
    return copy, commit[:7]


def journal(copy, commit):
    """The file of what is known at a commit, and what it holds: outcomes by place."""
    path = copy.parent / f"{commit}.jsonl"
    if not path.exists():
        return path, {}
    lines = (json.loads(line) for line in path.read_text().splitlines())
    return path, {place: outcome for place, outcome, _ in lines}


def listed(crate, copy):
    """All mutants of a crate."""
    command = ["cargo", "mutants", "--list", "--json", "--package", f"organza-{crate}"]
    command += [f"--exclude={pattern}" for pattern in EXCLUDED.get(crate, [])]
    return json.loads(subprocess.check_output(command, cwd=copy, text=True))


class Source:
    """A source file of the copy and its mutants."""

    def __init__(self, path):
        self.path = path
        self.text = path.read_text()
        self.starts = [0]
        for line in self.text.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))

    def span(self, span):
        at = lambda end: self.starts[span[end]["line"] - 1] + span[end]["column"] - 1
        return at("start"), at("end")

    def body(self, function):
        """Where the inside of a function's body lies; none if the switch cannot stand there."""
        start, end = self.span(function["span"])
        depth = 0
        for i in range(start, end):
            if self.text[i] == "{" and depth == 0:
                signature = self.text[start:i]
                fits = "const fn" not in signature and "-> impl" not in signature
                return (i + 1, end - 1) if fits else None
            depth += {"(": 1, "[": 1, ")": -1, "]": -1}.get(self.text[i], 0)
        return None

    def mutated(self, mutant, start, end):
        """The text between two places with a mutant in it."""
        a, b = self.span(mutant["span"])
        return f"{self.text[start:a]} {mutant['replacement']} {self.text[b:end]}"

    def write_alone(self, mutant):
        self.path.write_text(self.mutated(mutant, 0, len(self.text)))

    def write_together(self, mutants):
        """Writes those mutants, by number, that can be chosen when the program runs; returns
        the lines on which each function with mutants lies, and the numbers of its mutants."""
        bodies = {}
        for number, mutant in mutants.items():
            body = mutant["function"] and self.body(mutant["function"])
            # Of a function in another only one has mutants here.
            if body and all(body == b or body[1] < b[0] or b[1] < body[0] for b in bodies):
                bodies.setdefault(body, []).append(number)
        out, done, lines = "", 0, []
        for (start, end), numbers in sorted(bodies.items()):
            out += self.text[done:start]
            first = out.count("\n") + 1
            for number in numbers:
                changed = self.mutated(mutants[number], start, end)
                out += f"if crate::mutant::is({number}) {{{changed}}} else "
            out += f"{{{self.text[start:end]}}}"
            lines.append((first, out.count("\n") + 1, numbers))
            done = end
        self.path.write_text(out + self.text[done:])
        return lines


class Copy:
    """The copy of the commit, with mutants or without."""

    def __init__(self, crate, copy):
        self.crate, self.copy, self.sources = crate, copy, {}
        root = copy / "crates" / crate / "src" / "lib.rs"
        root.write_text(root.read_text() + SWITCH)

    def source(self, name):
        return self.sources.setdefault(name, Source(self.copy / name))

    def tests(self):
        """Programs with the tests of the crate and the folders that they run in, none if they do
        not compile; and the errors."""
        build = {"CARGO_TARGET_DIR": str(self.copy.parent / "build"), "CARGO_INCREMENTAL": "0"}
        build |= {"CARGO_PROFILE_DEV_DEBUG": "0"}
        found = []
        for package, *chosen in TESTS[self.crate]:
            command = ["cargo", "test", "--no-run", "--message-format=json"]
            run = subprocess.run(
                [*command, f"--package=organza-{package}", *chosen],
                cwd=self.copy, env={**os.environ, **build}, capture_output=True, text=True)
            messages = [json.loads(line) for line in run.stdout.splitlines() if line[:1] == "{"]
            if run.returncode != 0:
                errors = [m["message"] for m in messages if m["reason"] == "compiler-message"]
                return None, [e for e in errors if e["level"] == "error"] or sys.exit(run.stderr)
            for m in messages:
                if m["reason"] == "compiler-artifact" and m["executable"] and m["profile"]["test"]:
                    found.append((m["executable"], Path(m["manifest_path"]).parent))
        return found, []

    def build_together(self, mutants):
        """Builds all mutants that can be chosen when the program runs; returns their numbers, and
        the programs with tests."""
        alone = set()
        while True:
            regions = {}
            for name in {m["file"] for m in mutants.values()}:
                here = {n: m for n, m in mutants.items() if m["file"] == name and n not in alone}
                regions[name] = self.source(name).write_together(here)
            tests, errors = self.tests()
            if tests:
                chosen = [n for lines in regions.values() for _, _, ns in lines for n in ns]
                return chosen, tests
            spans = [span for error in errors for span in error["spans"]]
            wrong = {n for s in spans for first, last, numbers in regions.get(s["file_name"], [])
                     if first <= s["line_start"] <= last for n in numbers}
            if not wrong:
                sys.exit("".join(error["rendered"] for error in errors))
            alone |= wrong

    def restore(self):
        for source in self.sources.values():
            source.path.write_text(source.text)


def run_tests(tests, limits, number=None):
    """Runs the tests until one fails: `caught`, `missed` or `timeout`; and how long each took."""
    # The tests stop at the first that fails, an option of tests that is not stable yet.
    env = {**os.environ, "RUSTC_BOOTSTRAP": "1"}
    if number is not None:
        env["ORGANZA_MUTANT"] = str(number)
    took = []
    for (program, folder), limit in zip(tests, limits):
        start = time.monotonic()
        run = subprocess.Popen(
            [program, "-q", "-Zunstable-options", "--fail-fast"], cwd=folder, env=env,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        try:
            if run.wait(limit) != 0:
                return "caught", took
        except subprocess.TimeoutExpired:
            os.killpg(run.pid, signal.SIGKILL)
            run.wait()
            return "timeout", took
        took.append(time.monotonic() - start)
    return "missed", took


def main(crate, count, before=None):
    folder, commit = tree(crate)
    path, known = journal(folder, commit)
    if before:
        _, earlier = journal(folder, before)
        known = {**{p: o for p, o in earlier.items() if o != "missed"}, **known}
    mutants = listed(crate, folder)
    sample = random.Random(SEED).sample(range(len(mutants)), len(mutants))[:count]
    unknown = {p: mutants[p] for p in sample if p not in known}

    def note(place, outcome):
        known[place] = outcome
        with path.open("a") as lines:
            lines.write(json.dumps([place, outcome, mutants[place]["name"]]) + "\n")
        left = sum(p not in known for p in sample)
        print(f"{left} left; {outcome:9} {mutants[place]['name']}", file=sys.stderr, flush=True)

    if unknown:
        copy = Copy(crate, folder)
        together, tests = copy.build_together(unknown)
        print(f"{len(together)} mutants in one build", file=sys.stderr, flush=True)
        outcome, took = run_tests(tests, [None] * len(tests))
        if outcome != "missed":
            sys.exit("the tests fail without a mutant")
        limits = [60 + 5 * t for t in took]
        print(f"tests take {took} s", file=sys.stderr, flush=True)
        for place in unknown:
            if place in together:
                note(place, run_tests(tests, limits, place)[0])
        for place in unknown:
            if place not in together:
                copy.restore()
                copy.source(mutants[place]["file"]).write_alone(mutants[place])
                tests, _ = copy.tests()
                note(place, run_tests(tests, limits)[0] if tests else "unviable")
    kinds = ("caught", "missed", "timeout", "unviable")
    of = {kind: [mutants[p]["name"] for p in sample if known[p] == kind] for kind in kinds}
    died = len(of["caught"]) + len(of["timeout"])
    print(f"{crate} at {commit}: {died} of {died + len(of['missed'])} died "
          f"({len(of['timeout'])} by time), {len(of['unviable'])} did not compile, "
          f"of {len(mutants)} that exist")
    for kind in ("missed", "timeout", "unviable"):
        for name in of[kind]:
            print(f"{kind}: {name}")


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3, 4) or sys.argv[1] not in TESTS:
        sys.exit(__doc__)
    main(sys.argv[1], int((sys.argv[2:] or ["25"])[0]), *sys.argv[3:])
