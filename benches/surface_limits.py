"""Finds how near the surface model can come to the far-field table of each of ten fabrics.

    python3 benches/surface_limits.py DIR [FABRIC ...]

DIR/scenes/fabrics holds fabrics and their tables, as benches/distances.py makes them. 300 pairs of
directions up to 80 degrees are drawn, evenly over both hemispheres of the eye; the table's values
there, which have no noise, are what `organza fit` searches for, over far more places than by default.
Errors are then measured at 300 other pairs. What is there already is not made again. ORGANZA names
the program, PATIENCE the evaluations of the scan and of each descent.
"""

import csv
import math
import os
import pathlib
import random
import statistics
import subprocess
import sys

from distances import FABRICS

PAIRS = 300
MOST_THETA = math.radians(80.0)
COLUMNS = ["theta_i", "phi_i", "theta_o", "phi_o"]


def organza(*arguments):
    """Runs the program."""
    program = os.environ.get("ORGANZA", "target/release/organza")
    threads = ["--threads", os.environ.get("THREADS", "2")]
    subprocess.run([program, *map(str, arguments), *threads], check=True, stdout=subprocess.DEVNULL)


def write_pairs(path, seed):
    """Pairs of directions, light before the cloth, every second eye behind it."""
    drawn = random.Random(seed)

    def direction(is_behind):
        theta = math.acos(1.0 - drawn.random() * (1.0 - math.cos(MOST_THETA)))
        theta = math.pi - theta if is_behind else theta
        return [f"{math.degrees(theta):.3f}", f"{drawn.random() * 360.0:.3f}"]

    with path.open("w", newline="") as file:
        out = csv.writer(file)
        out.writerow(COLUMNS)
        for k in range(PAIRS):
            out.writerow(direction(False) + direction(k % 2 == 1))


def values(path):
    """Of every pair its value in red, green and blue."""
    with path.open() as file:
        return [[float(row[c]) for c in "rgb"] for row in csv.DictReader(file)]


def errors(truth, found, first):
    """Root mean square error over that of the values, and the median relative error, of a side."""
    flat = [
        (t, f)
        for true, own in list(zip(truth, found))[first::2]
        for t, f in zip(true, own)
    ]
    square = math.sqrt(sum((f - t) ** 2 for t, f in flat) / sum(t * t for t, _ in flat))
    median = statistics.median(abs(f - t) / t for t, f in flat if t > 0.0)
    return 100.0 * square, 100.0 * median


def main(folder, fabrics):
    """Prints a row for each fabric."""
    own = folder / "surface_limits"
    own.mkdir(exist_ok=True)
    pairs = [own / "fitted.csv", own / "held_out.csv"]
    for seed, path in enumerate(pairs):
        write_pairs(path, seed)
    print("| fabric | reflected: as shipped | fitted | transmitted: as shipped | fitted |")
    print("|---|---|---|---|---|")
    for fabric in fabrics:
        source = folder / "scenes" / "fabrics" / f"{fabric}.toml"
        fitted = source.with_name(f"{fabric}_fitted.toml")
        tables = {}

        def measured(path, model, which):
            out = own / f"{path.stem}.{model}.{pairs[which].stem}.csv"
            if not out.exists():
                organza("measure", path, "--pairs", pairs[which], "--model", model, "-o", out)
            tables[path.stem, model, which] = out
            return out

        data = measured(source, "table", 0)
        if not fitted.exists():
            patience = os.environ.get("PATIENCE", "1000,1000")
            organza("fit", "surface", source, "--data", data, "--patience", patience, "-o", fitted)
        truth = values(measured(source, "table", 1))
        shown = [values(measured(path, "surface", 1)) for path in (source, fitted)]
        cells = []
        for side in (0, 1):
            for found in shown:
                square, median = errors(truth, found, side)
                cells.append(f"{square:.0f}, {median:.0f} %")
        print(f"| {fabric} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(pathlib.Path(sys.argv[1]), sys.argv[2:] or FABRICS)
