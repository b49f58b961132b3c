#!/usr/bin/env python3
"""Changes the code in one place at a time and counts which changes the tests of its crate find.

    python3 benches/mutants.py scatter [COUNT]      tests COUNT mutants (25), then prints a table
    python3 benches/mutants.py scatter COUNT COMMIT tests those of them again that survived at COMMIT

Needs `cargo install cargo-mutants --locked`. The mutants are drawn with a fixed seed from all
those that cargo-mutants lists for the crate, so a greater COUNT extends the same sample. Each is
tested in a copy of the commit that is checked out, target/mutants/CRATE/tree, with the tests in
TESTS. What is known already is in target/mutants/CRATE/COMMIT.jsonl: an interrupted run resumes
there. Before the first mutant the tests are run on the code as it is, and must pass. A mutant is
known by its place in the list, which new tests do not change; so what died at an earlier COMMIT
need not be tested again if only tests have changed since.

A mutant that fails to compile is no evidence, and is not counted among those that died. One that
makes the tests run past TIMEOUT_S counts as found, and is listed apart.
"""

import json
import os
import random
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SEED = 24
TIMEOUT_S = 300
# Tests of each crate that are quick enough to be run once a mutant.
TESTS = {
    "scatter": ["--lib", "--test", "ply_precision", "--test", "slabs"],
    "volume": [],
    "kernel": ["--lib"],
    "measure": ["--lib"],
}
# Packages that the tests are in, if they are not in the crate alone.
PACKAGES = {}
# Code that these tests do not compile: the engine for graphics cards.
EXCLUDED = {"kernel": ["crates/kernel/src/gpu/**"]}
# Exit statuses of cargo-mutants.
OUTCOMES = {0: "caught", 2: "missed", 3: "timeout"}


def tree(crate):
    """A copy of the commit that is checked out, and its name."""
    commit = subprocess.check_output(["git", "rev-parse", "HEAD"], cwd=ROOT, text=True).strip()
    copy = ROOT / "target" / "mutants" / crate / "tree"
    copy.mkdir(parents=True, exist_ok=True)
    archive = subprocess.Popen(["git", "archive", commit], cwd=ROOT, stdout=subprocess.PIPE)
    subprocess.run(["tar", "-x", "-m", "-C", copy], stdin=archive.stdout, check=True)
    if archive.wait() != 0:
        sys.exit("git archive failed")
    return copy, commit[:7]


def chosen(crate):
    """Arguments that choose the code of a crate."""
    excluded = [f"--exclude={pattern}" for pattern in EXCLUDED.get(crate, [])]
    return ["--package", f"organza-{crate}", *excluded]


def packages(crate):
    return [f"organza-{name}" for name in PACKAGES.get(crate, [crate])]


def listed(crate, copy):
    """Names of all mutants of a crate."""
    command = ["cargo", "mutants", "--list", *chosen(crate)]
    return subprocess.check_output(command, cwd=copy, text=True).splitlines()


def environment(copy):
    build = {"CARGO_TARGET_DIR": str(copy.parent / "build")}
    return {**os.environ, **build, "CARGO_INCREMENTAL": "0", "CARGO_PROFILE_DEV_DEBUG": "0"}


def check_unchanged(crate, copy):
    """Runs the tests on the code as it is."""
    command = ["cargo", "test", "-q", *TESTS[crate]]
    command += [f"--package={package}" for package in packages(crate)]
    run = subprocess.run(command, cwd=copy, env=environment(copy), capture_output=True, text=True)
    if run.returncode != 0:
        sys.exit(f"the tests fail without a mutant:\n{run.stdout[-1000:]}{run.stderr[-1000:]}")


def test(crate, copy, name, place):
    """Tests one mutant: `caught`, `missed`, `timeout` or `unviable`.

    It is chosen by its place in the list: patterns of names do not keep mutants of the kind
    `delete field` out."""
    out = copy.parent / "out"
    command = ["cargo", "mutants", "--in-place", "--baseline=skip", f"--timeout={TIMEOUT_S}"]
    command += [*chosen(crate), "--output", str(out)]
    command += [f"--test-package={package}" for package in packages(crate)]
    command += ["--sharding", "round-robin", "--shard", place]
    command += [f"--cargo-arg={argument}" for argument in TESTS[crate]]
    run = subprocess.run(command, cwd=copy, env=environment(copy), capture_output=True, text=True)
    if run.returncode not in OUTCOMES:
        sys.exit(f"cargo-mutants failed on {name}:\n{run.stdout}{run.stderr}")
    found = json.loads((out / "mutants.out" / "outcomes.json").read_text())
    tested = [o["scenario"]["Mutant"]["name"] for o in found["outcomes"]]
    if tested != [name]:
        sys.exit(f"cargo-mutants tested {tested} for {name}")
    return "unviable" if found["unviable"] else OUTCOMES[run.returncode]


def journal(copy, commit):
    """The file of what is known at a commit, and what it holds: outcomes by place."""
    path = copy.parent / f"{commit}.jsonl"
    if not path.exists():
        return path, {}
    lines = (json.loads(line) for line in path.read_text().splitlines())
    return path, {place: outcome for place, outcome, _ in lines}


def main(crate, count, before=None):
    copy, commit = tree(crate)
    path, known = journal(copy, commit)
    names = listed(crate, copy)
    sample = random.Random(SEED).sample(range(len(names)), len(names))[:count]
    if not known:
        check_unchanged(crate, copy)
    if before:
        _, earlier = journal(copy, before)
        known = {**{p: o for p, o in earlier.items() if o != "missed"}, **known}
    for i, place in enumerate(sample):
        if place not in known:
            known[place] = test(crate, copy, names[place], f"{place}/{len(names)}")
            with path.open("a") as lines:
                lines.write(json.dumps([place, known[place], names[place]]) + "\n")
        print(f"{i + 1}/{count} {known[place]:9} {names[place]}", file=sys.stderr, flush=True)
    kinds = (*OUTCOMES.values(), "unviable")
    of = {kind: [names[p] for p in sample if known[p] == kind] for kind in kinds}
    died = len(of["caught"]) + len(of["timeout"])
    viable = died + len(of["missed"])
    print(f"{crate} at {commit}: {died} of {viable} died ({len(of['timeout'])} by time), "
          f"{len(of['unviable'])} did not compile, of {len(names)} that exist")
    for kind in ("missed", "timeout"):
        for name in of[kind]:
            print(f"{kind}: {name}")


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3, 4) or sys.argv[1] not in TESTS:
        sys.exit(__doc__)
    main(sys.argv[1], int((sys.argv[2:] or ["25"])[0]), *sys.argv[3:])
