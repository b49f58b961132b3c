"""Compares every representation of ten fabrics at five widths of a pixel, from 0.01 to 10 mm.

    python3 benches/distances.py DIR          makes tables, runs the bench, prints the summary
    python3 benches/distances.py DIR print    prints the summary again

What is there already is not made again: an interrupted run resumes. Every row, with error, interval,
time and memory, is in DIR/choices.csv. ORGANZA names the program, THREADS the number of
threads, PATHS those from each node of a far-field table.
"""

import csv
import os
import pathlib
import shutil
import statistics
import subprocess
import sys

FABRICS = [
    "denim", "cotton_twill", "wool_gabardine", "polyester_lining", "charmeuse", "silk_shantung",
    "organza", "linen", "jersey", "wool_tweed",
]  # fmt: skip
WIDTHS = "0.01,0.03,0.1,1,10"
# Noise to which times are quoted, a share of the mean.
NOISE = 0.02


def organza(*arguments):
    """Runs the program."""
    program = os.environ.get("ORGANZA", "target/release/organza")
    command = [program, *map(str, arguments), "--threads", os.environ.get("THREADS", "2")]
    subprocess.run(command, check=True)


def measure(folder):
    """For each fabric a far-field table beside a copy of it, then its bench; then all rows."""
    scenes = folder / "scenes"
    if not scenes.exists():
        shutil.copytree("scenes", scenes)
    rows = ""
    for fabric in FABRICS:
        path = scenes / "fabrics" / f"{fabric}.toml"
        table = path.with_suffix(".bsdf")
        if not table.exists():
            spp = os.environ.get("PATHS", "131072")
            journal = folder / f"{fabric}.journal"
            organza("table", path, "-o", table, "--spp", spp, "--held-out", 0, "--journal", journal)
        report = folder / "reports" / fabric
        if not (report / "choices.csv").exists():
            organza("bench", path, "-o", report, "--trackers", "usual", "--pixel-mm", WIDTHS)
        own = (report / "choices.csv").read_text()
        rows += own if not rows else own.split("\n", 1)[1]
    folder.joinpath("choices.csv").write_text(rows)


def percent(values):
    """Median, root mean square and largest of some shares."""
    square = statistics.fmean(v * v for v in values)
    return f"{100 * statistics.median(values):.1f}, {100 * square**0.5:.1f}, {100 * max(values):.1f} %"


def summary(folder):
    """Errors and times over all fabrics, by width, light and choice."""
    rows = list(csv.DictReader((folder / "choices.csv").open()))
    views = {}
    for r in rows:
        model = r["model"] + " with a cache" * (r["tracker"] == "cached")
        choice = (model, float(r["voxel_scale"]), int(r["level"]))
        views.setdefault((float(r["pixel_mm"]), r["lit"], choice), {})[r["fabric"]] = r
    print("| pixel | choice | lit from the front: error | from behind: error | time | memory |")
    print("|---|---|---|---|---|---|")
    for width in sorted({key[0] for key in views}):
        choices = list(dict.fromkeys(key[2] for key in views if key[0] == width))
        for choice in choices:
            cells, times, memory = [], [], []
            for lit in ("front", "back"):
                found = views.get((width, lit, choice), {})
                cells.append(percent([float(r["rmse"]) for r in found.values()]) if found else "")
                fibres = views.get((width, lit, ("fibres", 1.0, 0)), {})
                for fabric, r in found.items():
                    times.append(seconds(r) / seconds(fibres[fabric]))
                    memory.append(int(r["memory_bytes"]) / 2**20)
            if choice[0] == "fibres":
                cells = ["the reference"] * 2
            print(
                f"| {width:g} mm | {name_of(choice)} | {cells[0]} | {cells[1]} | "
                f"{statistics.median(times):.2f} | {statistics.median(memory):.0f} MiB |"
            )
    print()
    cheapest(views)
    print()
    within(views)


def name_of(choice):
    """A choice in words."""
    model, scale, level = choice
    return model if scale == 1.0 and level == 0 else f"{model}, voxels x {scale:g}, level {level}"


def cheapest(views):
    """How many views have which model as the cheapest of those known to be within an error."""
    tolerances = (0.02, 0.03, 0.05, 0.1, 0.2)
    print("| pixel | " + " | ".join(f"within {100 * t:g} %" for t in tolerances) + " |")
    print("|---|" + "---|" * len(tolerances))
    for width in sorted({key[0] for key in views}):
        cells = []
        for tolerance in tolerances:
            counts = {}
            for fabric, lit in {(f, k[1]) for k, found in views.items() if k[0] == width for f in found}:
                best = []
                for (w, side, choice), found in views.items():
                    r = found.get(fabric)
                    if (w, side) != (width, lit) or r is None:
                        continue
                    left = tolerance**2 - float(r["rmse_high"]) ** 2
                    if left > 0.0:
                        best.append((float(r["setup_s"]) + float(r["noise_s"]) / left, choice[0]))
                if best:
                    counts[min(best)[1]] = counts.get(min(best)[1], 0) + 1
            ordered = sorted(counts.items(), key=lambda c: (-c[1], c[0]))
            cells.append(", ".join(f"{model} {count}" for model, count in ordered))
        print(f"| {width:g} mm | " + " | ".join(cells) + " |")


def seconds(row):
    """Time of a picture with that noise, set-up included."""
    return float(row["setup_s"]) + float(row["noise_s"]) / NOISE**2


def within(views):
    """In how many of the fabrics each choice is within an error and faster than fibres."""
    print("| pixel, lit from | within 3 % and faster than explicit fibres |")
    print("|---|---|")
    places = dict.fromkeys((width, lit) for width, lit, _ in views)
    for width, lit in sorted(places):
        fibres = views.get((width, lit, ("fibres", 1.0, 0)), {})
        fastest = []
        for fabric, reference in fibres.items():
            near = []
            for (w, side, choice), found in views.items():
                if (w, side) == (width, lit) and fabric in found and choice[0] != "fibres":
                    r = found[fabric]
                    if float(r["rmse_high"]) < 0.03 and seconds(r) < seconds(reference):
                        near.append((seconds(r) / seconds(reference), choice))
            if near:
                share, choice = min(near)
                fastest.append(f"{fabric}: {choice[0]} ({1 / share:.1f} times as fast)")
        print(f"| {width:g} mm, {lit} | {'; '.join(fastest) or 'none'} |")


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3) or sys.argv[2:] not in ([], ["print"]):
        sys.exit(__doc__)
    given = pathlib.Path(sys.argv[1])
    given.mkdir(parents=True, exist_ok=True)
    if len(sys.argv) == 2:
        measure(given)
    summary(given)
