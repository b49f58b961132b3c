"""Reflection and transmission of plies beside explicit fibres: the table of benches/runs/plies.md.

    python3 benches/plies.py FOLDER [--organza PROGRAM] [--spp N]

Writes tables of `organza measure --albedo` to FOLDER and prints a line for each fabric, side and
angle: the light that is reflected and that is transmitted, scattered and straight, as explicit
fibres and as plies have it, each the mean of the channels; then processor time and memory.
"""

import argparse
import csv
import os
import pathlib
import subprocess

FABRICS = ["denim", "organza", "charmeuse", "jersey"]
ANGLES = [0, 45, 75, 180, 135, 105]
ROOT = pathlib.Path(__file__).resolve().parent.parent


def mean(row, share):
    return sum(float(row[f"{share}_{channel}"]) for channel in "rgb") / 3


def measure(program, fabric, model, pairs, folder, spp):
    """Rows of the table, processor seconds and peak memory in MiB."""
    table = folder / f"{fabric}.{model}.csv"
    command = [program, "measure", ROOT / f"scenes/fabrics/{fabric}.toml", "--albedo"]
    command += ["--model", model, "--pairs", pairs, "--spp", str(spp), "--threads", "1"]
    process = subprocess.Popen([*map(str, command), "-o", str(table), "--quiet"])
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{fabric} as {model}: organza failed")
    with open(table, newline="") as rows:
        return list(csv.DictReader(rows)), usage.ru_utime, usage.ru_maxrss / 1024


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--organza", default=ROOT / "target/release/organza")
    parser.add_argument("--spp", type=int, default=16384)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    pairs = arguments.folder / "pairs.csv"
    pairs.write_text("theta_i,phi_i\n" + "".join(f"{angle},0\n" for angle in ANGLES))
    print("| cloth, degrees | fibres: reflected, transmitted | plies: the same |\n|---|---|---|")
    costs = []
    for fabric in FABRICS:
        results = [
            measure(arguments.organza, fabric, model, pairs, arguments.folder, arguments.spp)
            for model in ("fibres", "plies")
        ]
        for rows in zip(*(rows for rows, _, _ in results)):
            angle = rows[0]["theta_i"]
            shares = [
                f"{mean(row, 'reflected'):.3f}, "
                f"{mean(row, 'transmitted') + mean(row, 'direct'):.3f}"
                for row in rows
            ]
            print(f"| {fabric}, {angle} | {shares[0]} | {shares[1]} |")
        costs.append((fabric, [(seconds, mib) for _, seconds, mib in results]))
    print("\n| cloth | fibres: s, MiB | plies: s, MiB |\n|---|---|---|")
    for fabric, both in costs:
        cells = " | ".join(f"{seconds:.2f}, {mib:.1f}" for seconds, mib in both)
        print(f"| {fabric} | {cells} |")


if __name__ == "__main__":
    main()
