"""Measures the gloss of finished poplin and prints it as a table.

    python3 scenes/realism/gloss.py [ORGANZA]

Gloss is what the cloth reflects from 60 degrees into the mirrored direction, over what it
reflects from there along its normal: of light along the weft and along the warp, the mean. A
matt surface has 1. Each tile is measured with several seeds of the geometry.
"""
import csv
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
ORGANZA = sys.argv[1] if len(sys.argv) > 1 else "organza"
SEEDS = range(8)
PATHS = 32768
PAIRS = [(60, 0, 60, 180), (60, 0, 0, 0), (60, 90, 60, 270), (60, 90, 0, 0)]
ROWS = [
    ("none", []),
    ("mercerised", ['yarn.cotton.finish="mercerised"']),
    ("none, but round fibres", ['optics.cotton.section="round"']),
    ("calendered", ['yarn.cotton.finish="calendered"']),
    ("mercerised, calendered", ['yarn.cotton.finish=["mercerised","calendered"]']),
    ("singed", ['yarn.cotton.finish="singed"']),
    ("raised", ['yarn.cotton.finish="raised"']),
]


def measured(settings, seed, folder):
    """Reflection of each pair, in green."""
    pairs, out = folder / "pairs.csv", folder / "out.csv"
    lines = ["theta_i,phi_i,theta_o,phi_o", *(",".join(map(str, pair)) for pair in PAIRS)]
    pairs.write_text("\n".join(lines) + "\n")
    sets = [word for one in [*settings, f"seed={seed}"] for word in ("--set", one)]
    command = [ORGANZA, "measure", HERE / "poplin.toml", "--pairs", pairs, "-o", out, "--model", "fibres",
               "--spp", str(PATHS), "--seed", str(seed), "--threads", "1", "--quiet"]
    subprocess.run([*command, *sets], check=True)
    with out.open() as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        return [float(row["g"]) for row in rows]


def main():
    print("| finish | mirrored, 1/sr | along the normal, 1/sr | gloss | standard error |")
    print("|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        for label, settings in ROWS:
            found = []
            for seed in SEEDS:
                values = measured(settings, seed, Path(name))
                mirrored, normal = (values[0] + values[2]) / 2, (values[1] + values[3]) / 2
                found.append((mirrored, normal, mirrored / normal))
            count = len(found)
            means = [sum(column) / count for column in zip(*found)]
            variance = sum((row[2] - means[2]) ** 2 for row in found) / (count - 1)
            error = (variance / count) ** 0.5
            print(f"| {label} | {means[0]:.4f} | {means[1]:.4f} | {means[2]:.2f} | {error:.2f} |", flush=True)


if __name__ == "__main__":
    main()
