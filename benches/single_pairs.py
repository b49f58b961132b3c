"""Compares representations of ten fabrics with explicit fibres at single pairs of directions.

    python3 benches/single_pairs.py DIR [FABRIC ...]

DIR/scenes/fabrics holds fabrics and their far-field tables, as benches/distances.py makes them. 300
pairs up to 80 degrees, half of them in transmission, are the mean over the repeat. Prints the root mean
square difference over the root mean square value, without the share of the noise, and an interval of
95 % from drawing the pairs again. What is there already is not measured again. ORGANZA names the
program, THREADS the number of threads.
"""

import csv
import math
import os
import pathlib
import random
import subprocess
import sys

from distances import FABRICS
from surface_limits import write_pairs

MODELS = ["microflake", "plain", "packed", "plies", "table", "surface"]
PATHS, PATHS_OF_TRUTH = 2048, 8192
DRAWS = 500


def measured(folder, fabric, pairs, model):
    """Values and standard errors of the pairs."""
    out = folder / "single_pairs" / f"{fabric}.{model}.csv"
    if not out.exists():
        source = folder / "scenes" / "fabrics" / f"{fabric}.toml"
        truth = model == "fibres"
        arguments = ["--spp", PATHS_OF_TRUTH if truth else PATHS, "--seed", 1 if truth else 2]
        arguments += ["--threads", os.environ.get("THREADS", "2"), "--quiet"]
        program = os.environ.get("ORGANZA", "target/release/organza")
        command = [program, "measure", source, "--pairs", pairs, "--model", model, "-o", out, *arguments]
        subprocess.run(list(map(str, command)), check=True, stdout=subprocess.DEVNULL)
    with out.open() as file:
        rows = list(csv.DictReader(file))
    errors = [name for name in rows[0] if name.startswith(("se_", "error_")) or name.endswith("_se")]
    return [([float(r[c]) for c in "rgb"], [float(r[e]) for e in errors[:3]]) for r in rows]


def share(pairs):
    """Root mean square difference over the value, without noise, of pairs of truth and model."""
    off = value = 0.0
    for (true, noise), (own, own_noise) in pairs:
        off += sum((a - b) ** 2 - n * n - m * m for a, b, n, m in zip(own, true, noise, own_noise))
        value += sum(t * t - n * n for t, n in zip(true, noise))
    return math.sqrt(max(off, 0.0) / value) if value > 0.0 else math.nan


def main(folder, fabrics):
    """Prints a row for each fabric."""
    (folder / "single_pairs").mkdir(exist_ok=True)
    pairs = folder / "single_pairs" / "pairs.csv"
    write_pairs(pairs, 2)
    drawn = random.Random(3)
    print("| fabric | " + " | ".join(MODELS) + " |")
    print("|---|" + "---|" * len(MODELS))
    for fabric in fabrics:
        truth = measured(folder, fabric, pairs, "fibres")
        cells = []
        for model in MODELS:
            both = list(zip(truth, measured(folder, fabric, pairs, model)))
            parts = []
            for side in (both[0::2], both[1::2]):
                again = sorted(share(drawn.choices(side, k=len(side))) for _ in range(DRAWS))
                low, high = again[DRAWS // 40], again[-DRAWS // 40]
                parts.append(f"{100 * share(side):.0f} ({100 * low:.0f} to {100 * high:.0f})")
            cells.append(", ".join(parts) + " %")
        print(f"| {fabric.replace('_', ' ')} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(pathlib.Path(sys.argv[1]), sys.argv[2:] or FABRICS)
