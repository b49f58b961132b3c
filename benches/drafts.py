"""Renders drafts as a user does, `organza render X.wif -o X.png`, and times it.

    python3 benches/drafts.py DIR [WIF ...]

The drafts given and COUNT more, drawn by a generator: 2 x 2 to 2000 x 2000 threads; twills,
satins, pointed and random threadings, blocks of satins, random lift plans; with and without
spacings, thicknesses and colours. Pictures that are there already are not made again. In DIR:
the drafts, their pictures, sheet.png of all, and drafts.md with times, memory and refusals.
ORGANZA names the program, COUNT the number of drafts drawn (100), SEED what they are drawn from,
OPTIONS further options of each render. Needs numpy and pillow.
"""

import json
import math
import os
import pathlib
import shlex
import statistics
import subprocess
import sys
import time

import numpy
from PIL import Image, ImageDraw

ORGANZA = os.environ.get("ORGANZA", "organza")
THUMB = 192


def weave(rng, kind, ends, picks):
    """Shafts of the ends, treadles of the picks, and the shafts of each treadle."""
    shafts = min(int(rng.integers(2, 25)), ends)
    if kind == "random":  # Every pick lifts its own shafts.
        lifts = rng.random((picks, shafts)) < rng.uniform(0.3, 0.7)
        return numpy.arange(ends) % shafts, numpy.arange(picks), lifts
    if kind == "blocks":  # Two satins of five, face and back, in blocks of both directions.
        profile = [rng.integers(0, 2, n // 5 + 1) for n in (ends, picks)]
        step = numpy.arange(5)
        thread = numpy.arange(ends) % 5 + 5 * profile[0][numpy.arange(ends) // 5]
        treadle = numpy.arange(picks) % 5 + 5 * profile[1][numpy.arange(picks) // 5]
        bound = (step[:, None] * 2) % 5 == step[None, :]
        lifts = numpy.block([[bound, ~bound], [~bound, bound]])
        return thread, treadle, lifts
    shafts = max(shafts, min(3, ends))
    treadles = shafts
    i, j = numpy.arange(treadles)[:, None], numpy.arange(shafts)[None, :]
    if kind == "satin":
        steps = [s for s in range(2, shafts - 1) if math.gcd(s, shafts) == 1] or [1]
        lifts = (i * steps[0]) % shafts == j
    else:
        lifts = (j - i) % shafts < max(1, int(rng.integers(1, shafts)))
    threads = [numpy.arange(n) % shafts for n in (ends, picks)]
    if kind == "pointed":
        fold = numpy.concatenate([numpy.arange(shafts), numpy.arange(shafts - 2, 0, -1)])
        threads = [fold[numpy.arange(n) % len(fold)] for n in (ends, picks)]
    elif kind == "wandering":
        threads = [numpy.cumsum(rng.choice([-1, 1], n)) % shafts for n in (ends, picks)]
    return threads[0], threads[1], lifts


def wif(rng):
    """The text of a draft, and what kind it is."""
    ends, picks = (int(round(2 * 1000 ** rng.random())) for _ in range(2))
    kind = str(rng.choice(["twill", "satin", "pointed", "wandering", "blocks", "random"]))
    shaft, treadle, lifts = weave(rng, kind, ends, picks)
    has_lift_plan = kind == "random" or rng.random() < 0.3
    lines = ["[WIF]", "Version=1.1", "Date=April 20, 1997", "Developers=wif@mhsoft.com"]
    lines += ["Source Program=drafts.py", f"[TEXT]\nTitle={kind} {ends} x {picks}", "[CONTENTS]"]
    sections = []

    def section(name, rows):
        lines.append(f"{name}=true")
        sections.append(f"[{name}]\n" + "\n".join(rows))

    def numbered(rows):
        return [f"{n + 1}={row}" for n, row in enumerate(rows)]

    def lifted(row):
        return ",".join(str(n + 1) for n in numpy.flatnonzero(row)) or "0"

    section("THREADING", numbered(shaft + 1))
    if has_lift_plan:
        section("LIFTPLAN", numbered(lifted(lifts[t]) for t in treadle))
    else:
        section("TREADLING", numbered(treadle + 1))
        section("TIEUP", numbered(lifted(row) for row in lifts))
    size = [f"Shafts={lifts.shape[1]}", f"Treadles={lifts.shape[0]}"]
    section("WEAVING", [*size, f"Rising Shed={'true' if rng.random() < 0.7 else 'false'}"])
    colours = int(rng.choice([0, 2, 2, 5, 12]))
    if colours:
        section("COLOR PALETTE", [f"Entries={colours}", "Range=0,255"])
        table = rng.integers(0, 256, (colours, 3))
        section("COLOR TABLE", numbered(",".join(map(str, c)) for c in table))
    per_cm = 10 ** rng.uniform(0.5, 1.7)
    spaced = rng.choice(["none", "none", "warp", "both"])
    for n, (system, count) in enumerate([("WARP", ends), ("WEFT", picks)]):
        rows = [f"Threads={count}", "Units=centimeters"]
        if colours:
            rows.append(f"Color={min(n + 1, colours)}")
        if spaced == "both" or spaced == "warp" and n == 0:
            rows.append(f"Spacing={1 / (per_cm * rng.uniform(0.7, 1.4)):.4f}")
        section(system, rows)
        if colours > 2:
            stripes = rng.integers(1, colours + 1, count // 7 + 1)
            section(f"{system} COLORS", numbered(stripes[numpy.arange(count) // 7]))
    return "\n".join(lines + sections) + "\n"


def drawn(folder, count, seed):
    for n in range(count):
        path = folder / f"drawn_{n:03}.wif"
        path.write_text(wif(numpy.random.default_rng([seed, n])))
        yield path


def render(draft, picture):
    """What became of a draft; none again where its picture is there."""
    record = picture.with_suffix(".json")
    if record.exists():
        return json.loads(record.read_text())
    options = shlex.split(os.environ.get("OPTIONS", ""))
    command = [ORGANZA, "render", str(draft), "-o", str(picture), *options]
    began = time.monotonic()
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    said = child.stdout.read()
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    found = {
        "code": child.returncode,
        "seconds": time.monotonic() - began,
        "cpu_seconds": used.ru_utime + used.ru_stime,
        "mib": used.ru_maxrss / 1024,
        "said": said.strip().splitlines(),
    }
    record.write_text(json.dumps(found))
    return found


def sheet(shown, path):
    columns = math.ceil(math.sqrt(len(shown) * 1.6))
    rows = math.ceil(len(shown) / columns)
    whole = Image.new("RGB", (columns * THUMB, rows * (THUMB + 14)), "white")
    draw = ImageDraw.Draw(whole)
    for n, (name, picture) in enumerate(shown):
        at = (n % columns * THUMB, n // columns * (THUMB + 14))
        whole.paste(Image.open(picture).convert("RGB").resize((THUMB - 2, THUMB - 2)), at)
        draw.text((at[0], at[1] + THUMB), name[:30], "black")
    whole.save(path)


def main():
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    drafts = [pathlib.Path(p) for p in sys.argv[2:]]
    drafts += drawn(folder, int(os.environ.get("COUNT", 100)), int(os.environ.get("SEED", 1)))
    found = {}
    for draft in drafts:
        picture = folder / (draft.stem.replace(" ", "_") + ".png")
        found[draft.name] = render(draft, picture) | {"picture": picture}
        print(draft.name, {k: v for k, v in found[draft.name].items() if k != "said"}, flush=True)
    done = {name: f for name, f in found.items() if f["code"] == 0}
    lines = ["| | median | worst |", "|---|---|---|"]
    for key, unit in [("seconds", "s"), ("cpu_seconds", "s of CPU"), ("mib", "MiB")]:
        all_of = {name: f[key] for name, f in done.items()}
        worst = max(all_of, key=all_of.get)
        median = statistics.median(all_of.values())
        lines.append(f"| {unit} | {median:.0f} | {all_of[worst]:.0f} (`{worst}`) |")
    lines += ["", f"{len(done)} of {len(found)} drafts give a picture; the others are refused:", ""]
    for name, f in found.items():
        if f["code"] != 0:
            lines.append(f"- `{name}` ({f['seconds']:.1f} s, code {f['code']}): {f['said'][-1:]}")
    (folder / "drafts.md").write_text("\n".join(lines) + "\n")
    sheet([(name, f["picture"]) for name, f in done.items()], folder / "sheet.png")


if __name__ == "__main__":
    main()
