#!/usr/bin/env python3
"""Lists the literal tolerances of the tests, and how near the tests come to them.

    python3 benches/tolerances.py                       every tolerance, by file and line
    python3 benches/tolerances.py measure [CARGO ARGS]  with the greatest value that was compared

A tolerance is the right side of `assert!(VALUE < BOUND, ...)` or `<=` if it has a number with
a point or an exponent in it. `measure` copies the repository to target/tolerances, writes
every such assertion so that it prints both sides, and runs `cargo test CARGO ARGS` there,
`-p organza-basis` for instance. The margin is the bound over the value, the least of all times
that the assertion was passed; those above 2 come first, for they would let an error of the
size of the bound pass unseen. The reason of a margin is printed beside it: the sentence with
the word "margin" in the comment above the assertion, or what the bound is derived from where
the bound itself says so. Bounds of 3 to 5 standard errors, of at most 32 roundings (`EPSILON`)
and of the probability at which a wrong variant is rejected do.

`measure` fails if a margin above 2 has no reason.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
COPY = ROOT / "target" / "tolerances"
MARK = "tolerance:"
# A number with a point or an exponent, no field and no range.
NUMBER = re.compile(r"(?<![\w.])\d[\d_]*(?:\.\d[\d_]*(?:e-?\d+)?|e-?\d+)(?:_?f(?:32|64))?(?![\w.])")

# Names of standard errors, and of differences that are counted in them.
STANDARD_ERROR = r"\b(se|sigma|error|errors|deviation|standard_error|error_a|sqrt|four_sigma)\b"
STANDARDISED = r"^(z|sigmas|deviations|far|apart|off|above|distance|errors)\b"


def sources(root):
    """Rust files with tests."""
    folders = [root / "crates", root / "tests"]
    files = (f for folder in folders for f in sorted(folder.rglob("*.rs")))
    return [f for f in files if "assert!(" in f.read_text()]


def closing(text, start):
    """Where the bracket that opens at `start` is closed; strings, characters and comments
    are skipped."""
    depth, i = 0, start
    while i < len(text):
        c = text[i]
        if c == '"':
            i += 1
            while text[i] != '"':
                i += 2 if text[i] == "\\" else 1
        elif text.startswith("//", i):
            i = text.index("\n", i)
        elif c == "'" and (m := re.match(r"'(\\.[^']*|[^\\])'", text[i:])):
            i += m.end() - 1
        elif c in "([{":
            depth += 1
        elif c in ")]}":
            depth -= 1
            if depth == 0:
                return i
        i += 1
    raise ValueError("a bracket is not closed")


def top_level(text, pattern):
    """Matches of a pattern outside of all brackets and strings."""
    found, i = [], 0
    while i < len(text):
        if text[i] in "([{":
            i = closing(text, i) + 1
            continue
        if text[i] == '"':
            i += 1
            while text[i] != '"':
                i += 2 if text[i] == "\\" else 1
        if m := pattern.match(text, i):
            found.append(m)
            i = m.end()
            continue
        i += 1
    return found


def assertions(text):
    """Of every assertion with a tolerance: where its condition is, and its two sides."""
    for m in re.finditer(r"(?<!\w)assert!\(", text):
        line = text.rfind("\n", 0, m.start()) + 1
        if "//" in text[line : m.start()]:
            continue
        end = closing(text, m.end() - 1)
        inside = text[m.end() : end]
        commas = top_level(inside, re.compile(","))
        condition = inside[: commas[0].start()] if commas else inside
        if "//" in condition or top_level(condition, re.compile(r"&&|\|\|")):
            continue
        compared = top_level(condition, re.compile(r"\s<=?\s"))
        if len(compared) != 1:
            continue
        value, bound = condition[: compared[0].start()], condition[compared[0].end() :]
        if not NUMBER.search(bound) or "|" in value:
            continue
        yield m.end(), m.end() + len(condition), value.strip(), bound.strip(), compared[0][0]


def derived(value, bound):
    """What a bound is derived from, if it says so itself. The value may then lie far below it:
    by chance in the first two cases, and as it should in the third."""
    factors = [float(re.sub(r"_?f(32|64)$|_", "", n)) for n in NUMBER.findall(bound)]
    if "p_value" in value and "abs()" not in value:
        return "derived: the probability at which a wrong variant is rejected"
    if "EPSILON" in bound and max(factors) <= 32.0:
        return "derived: rounding"
    counted = re.fullmatch(r"[345](\.\d)?", bound) and re.search(STANDARDISED, value)
    added = re.search(r" \+ (?!1e-[6-9])", bound)
    times = re.match(r"\(?[345](\.\d)? [*/] ", bound) or bound.startswith("four_sigma")
    if counted or (times and re.search(STANDARD_ERROR, bound) and not added):
        return "derived: standard errors"
    return ""


def reason(text, start, value, bound):
    """What the bound of an assertion, or the comment above it, says of its margin. A comment
    holds for all assertions that follow it without other code between them."""
    ends = {}
    for m in re.finditer(r"^ *(?:debug_)?assert\w*!\(", text[:start], re.M):
        if m.end() < start:
            ends[text.count("\n", 0, closing(text, m.end() - 1))] = text.count("\n", 0, m.start())
    lines = text.split("\n")
    at = text.count("\n", 0, text.rindex("assert!", 0, start))
    comments = []
    while at > 0:
        if m := re.match(r"\s*//+ (.*)", lines[at - 1]):
            comments.insert(0, m[1])
            at -= 1
        elif at - 1 in ends:
            at = ends[at - 1]
        else:
            break
    sentences = re.split(r"(?<=[.:;])\s+(?=[A-Z])", " ".join(comments))
    given = [s for s in sentences if re.search(r"\bmargin\b", s, re.I)]
    return given[-1] if given else derived(value, bound)


def listed():
    """Prints every tolerance."""
    count = 0
    for path in sources(ROOT):
        text = path.read_text()
        for start, _, value, bound, _ in assertions(text):
            line = text.count("\n", 0, start) + 1
            count += 1
            words = [" ".join(side.split()) for side in (bound, value)]
            print(f"{path.relative_to(ROOT)}:{line}: {words[0]}    for {words[1]}")
    print(f"{count} tolerances", file=sys.stderr)


def instrumented(text, name):
    """A file whose assertions print both sides."""
    out, at = [], 0
    for start, end, value, bound, sign in assertions(text):
        line = text.count("\n", 0, start) + 1
        keep_lines = "\n" * text.count("\n", start, end)
        out.append(text[at:start])
        out.append(
            f"{{ let (compared, limit) = ({value}, {bound}); "
            f"let is_within = compared {sign.strip()} limit; "
            f'eprintln!("{MARK} {name}:{line} {{:e}} {{:e}}", compared, limit); is_within }}{keep_lines}'
        )
        at = end
    return "".join(out) + text[at:]


def copied():
    """Writes the copy. What cargo built there stays, and every file has the time of its
    original, so that a second measurement builds only what has changed."""
    COPY.mkdir(parents=True, exist_ok=True)
    for old in COPY.iterdir():
        if old.name != "target":
            shutil.rmtree(old) if old.is_dir() else old.unlink()
    skip = shutil.ignore_patterns("target", ".git", "artifacts")
    shutil.copytree(ROOT, COPY, ignore=skip, dirs_exist_ok=True)
    for path in sources(COPY):
        times = path.stat()
        path.write_text(instrumented(path.read_text(), str(path.relative_to(COPY))))
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


def measure(arguments):
    """Runs the tests of a copy that prints, and tells the margins."""
    reasons = {}
    for path in sources(ROOT):
        text = path.read_text()
        for start, _, value, bound, _ in assertions(text):
            place = f"{path.relative_to(ROOT)}:{text.count(chr(10), 0, start) + 1}"
            reasons[place] = reason(text, start, value, bound)
    copied()
    command = ["cargo", "test", "--no-fail-fast", *arguments, "--", "--nocapture"]
    run = subprocess.run(command, cwd=COPY, stderr=subprocess.PIPE, text=True, errors="replace")
    least = {}
    for m in re.finditer(rf"{MARK} (\S+) (\S+) (\S+)$", run.stderr, re.M):
        value, bound = float(m[2]), float(m[3])
        margin = bound / value if value > 0 else float("inf")
        old = least.get(m[1])
        if old is None or margin < old[0]:
            least[m[1]] = (margin, value, bound)
    if not least:
        sys.exit(run.stderr[-2000:])
    if run.returncode:
        print("a test failed or does not build:", file=sys.stderr)
        print(*re.findall(r"^(?:error.*|thread .* panicked.*|.* test failed.*)$", run.stderr, re.M), sep="\n", file=sys.stderr)
    loose, with_reason = 0, 0
    for place, (margin, value, bound) in sorted(least.items(), key=lambda item: -item[1][0]):
        why = reasons[place]
        print(f"{margin:10.3g}  {value:.3e} of {bound:.3e}  {place}  {why}")
        loose += margin > 2
        with_reason += margin > 2 and bool(why)
    print(
        f"{len(least)} tolerances, {loose} with a margin above 2, {with_reason} of these with a reason",
        file=sys.stderr,
    )
    return run.returncode == 0 and loose == with_reason


if __name__ == "__main__":
    if sys.argv[1:2] == ["measure"]:
        sys.exit(0 if measure(sys.argv[2:]) else 1)
    elif len(sys.argv) == 1:
        listed()
    else:
        sys.exit(__doc__)
