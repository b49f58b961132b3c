#!/usr/bin/env python3
"""Changes the code in one place at a time and counts which changes the tests of its crate find.

    python3 benches/mutants.py scatter [COUNT]       tests COUNT mutants (25), then prints a table
    python3 benches/mutants.py scatter COUNT COMMIT  tests those again that survived at COMMIT

Needs `cargo install cargo-mutants --locked`, which lists the mutants of a crate. COUNT of them
are drawn with a fixed seed, so a greater COUNT extends the same sample. To build once and not once
a mutant, all are written into one copy of the commit that is checked out: a function with a
mutant has its body twice, and the variable ORGANZA_MUTANT chooses the mutant that runs. Those
that do not compile in this way (constants, for example) are built alone; those that do not
compile alone are no evidence, and are not counted among those that died.

The copy, target/mutants/CRATE/tree, is tested with TESTS until the first test fails. Without a
mutant all tests must pass, in a third of LIMIT_S seconds of processor time for each program with
tests. A mutant with which one takes LIMIT_S counts as found, and is listed apart. What is known
already is in target/mutants/CRATE/COMMIT.jsonl: an interrupted run resumes there. A mutant is
known by its place in the list, which new tests do not change; what died at an earlier COMMIT dies
as long as only tests are added.
"""

import json
import os
import random
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SEED = 24
LIMIT_S = 300
# Programs with tests that run at once; the last tests of each leave processors idle.
AT_ONCE = 4
# Packages and their tests that are quick enough to be run once a mutant.
TESTS = {
    "scatter": [
        ["scatter", "--lib", "--test=packed_precision", "--test=ply_precision", "--test=slabs"]
    ],
    "volume": [["volume", "--lib", "--test=volume"]],
    "kernel": [["kernel", "--lib"], ["transport", "--test=kernel"]],
    "measure": [["measure", "--lib", "--tests"]],
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


def source(folder):
    """The commit that is checked out, in a folder; and its name."""
    commit = subprocess.check_output(["git", "rev-parse", "HEAD"], cwd=ROOT, text=True).strip()
    folder.mkdir(parents=True, exist_ok=True)
    archive = subprocess.Popen(["git", "archive", commit], cwd=ROOT, stdout=subprocess.PIPE)
    subprocess.run(["tar", "-x", "-C", folder], stdin=archive.stdout, check=True)
    if archive.wait() != 0:
        sys.exit("git archive failed")
    return commit[:7]


def journal(folder, commit):
    """The file of what is known at a commit, and what it holds: outcomes by place."""
    path = folder / f"{commit}.jsonl"
    if not path.exists():
        return path, {}
    lines = (json.loads(line) for line in path.read_text().splitlines())
    return path, {place: outcome for place, outcome, _ in lines}


def listed(crate, folder):
    """All mutants of a crate."""
    command = ["cargo", "mutants", "--list", "--json", "--package", f"organza-{crate}"]
    command += [f"--exclude={pattern}" for pattern in EXCLUDED.get(crate, [])]
    return json.loads(subprocess.check_output(command, cwd=folder, text=True))


class Source:
    """A source file and its mutants."""

    def __init__(self, text):
        self.text = text
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

    def alone(self, mutant):
        return self.mutated(mutant, 0, len(self.text))

    def together(self, mutants):
        """The text with those mutants, by number, that can be chosen when the program runs; and
        the lines on which each function with mutants lies, with the numbers of its mutants."""
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
        return out + self.text[done:], lines


class Copy:
    """A copy of the commit, with mutants or without."""

    def __init__(self, crate, folder):
        self.crate, self.folder = crate, folder
        self.root = f"crates/{crate}/src/lib.rs"

    def source(self, name):
        text = (self.folder / "source" / name).read_text()
        return Source(text + SWITCH if name == self.root else text)

    def write(self, texts):
        """Makes the copy that of the commit but for the texts of some files. Writes what differs
        only, or cargo builds all again."""
        texts = {self.root: self.source(self.root).text, **texts}
        for path in filter(Path.is_file, (self.folder / "source").rglob("*")):
            name = str(path.relative_to(self.folder / "source"))
            content = texts[name].encode() if name in texts else path.read_bytes()
            copy = self.folder / "tree" / name
            if not copy.exists() or copy.read_bytes() != content:
                copy.parent.mkdir(parents=True, exist_ok=True)
                copy.write_bytes(content)

    def tests(self):
        """Programs with the tests of the crate and the folders that they run in, none if they do
        not compile; and the errors."""
        build = {"CARGO_TARGET_DIR": str(self.folder / "build"), "CARGO_INCREMENTAL": "0"}
        build |= {"CARGO_PROFILE_DEV_DEBUG": "0"}
        found = []
        for package, *chosen in TESTS[self.crate]:
            command = ["cargo", "test", "--no-run", "--message-format=json"]
            run = subprocess.run(
                [*command, f"--package=organza-{package}", *chosen],
                cwd=self.folder / "tree", env={**os.environ, **build}, capture_output=True,
                text=True)
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
            texts, regions = {}, {}
            for name in {m["file"] for m in mutants.values()}:
                here = {n: m for n, m in mutants.items() if m["file"] == name and n not in alone}
                texts[name], regions[name] = self.source(name).together(here)
            self.write(texts)
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

    def build_alone(self, mutant):
        """Builds one mutant; returns the programs with tests, none if it does not compile."""
        self.write({mutant["file"]: self.source(mutant["file"]).alone(mutant)})
        return self.tests()[0]


def run_tests(tests, number=None):
    """Runs the tests until one fails: `caught`, `missed` or `timeout`; and the most processor
    time that a program took."""
    # The tests stop at the first that fails, an option of tests that is not stable yet.
    env = {**os.environ, "RUSTC_BOOTSTRAP": "1", "ORGANZA_MUTANT": str(number)}
    most = 0
    for program, folder in tests:
        command = [program, "-q", "-Zunstable-options", "--fail-fast"]
        run = subprocess.Popen(
            ["sh", "-c", f'ulimit -t {LIMIT_S}; exec "$@"', "sh", *command],
            cwd=folder, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        _, status, usage = os.wait4(run.pid, 0)
        most = max(most, usage.ru_utime + usage.ru_stime)
        if os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL):
            return "timeout", most
        if status != 0:
            return "caught", most
    return "missed", most


def main(crate, count, before=None):
    folder = ROOT / "target" / "mutants" / crate
    commit = source(folder / "source")
    path, known = journal(folder, commit)
    if before:
        _, earlier = journal(folder, before)
        known = {**{p: o for p, o in earlier.items() if o != "missed"}, **known}
    mutants = listed(crate, folder / "source")
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
        with ThreadPoolExecutor(AT_ONCE) as pool:
            unchanged = pool.submit(run_tests, tests)
            runs = {pool.submit(run_tests, tests, p): p for p in unknown if p in together}
            for run in as_completed(runs):
                note(runs[run], run.result()[0])
        outcome, took_s = unchanged.result()
        print(f"without a mutant: {outcome}, {took_s:.1f} s", file=sys.stderr, flush=True)
        if outcome != "missed" or took_s > LIMIT_S / 3:
            path.unlink()
            sys.exit("the tests fail or take too long without a mutant")
        for place in unknown:
            if place not in together:
                tests = copy.build_alone(mutants[place])
                note(place, run_tests(tests)[0] if tests else "unviable")
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
