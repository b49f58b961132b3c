"""Corrections of plies fitted to explicit fibres: the table of benches/runs/plies.md.

    python3 benches/ply_fits.py FOLDER [--organza PROGRAM] [--spp N] [--steps N] [--fabrics NAMES]

Fits each fabric with `organza fit plies`, and prints the errors at values that were held
out, before and after, with their noise, then the corrections.
"""

import argparse
import json
import pathlib
import subprocess

FABRICS = "denim,organza,charmeuse,jersey"
ROOT = pathlib.Path(__file__).resolve().parent.parent


def fit(arguments, fabric):
    command = [arguments.organza, "fit", "plies", ROOT / f"scenes/fabrics/{fabric}.toml"]
    command += ["--spp", arguments.spp, "--patience", f"0,{arguments.steps}", "--threads", 1]
    command += ["-o", arguments.folder / f"{fabric}.toml", "--json", "--quiet"]
    command += ["--journal", arguments.folder / f"{fabric}.journal"]
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--organza", default=ROOT / "target/release/organza")
    parser.add_argument("--spp", type=int, default=1024)
    parser.add_argument("--steps", type=int, default=40)
    parser.add_argument("--fabrics", default=FABRICS)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    print("| cloth | held out | before, % | after, % | noise, % |\n|---|---|---|---|---|")
    found = []
    for fabric in arguments.fabrics.split(","):
        answer = fit(arguments, fabric)
        held_out = answer["held_out"]
        for before, after in zip(held_out["before"], held_out["after"]):
            shares = [before["rms"], after["rms"], after["noise"]]
            cells = " | ".join(f"{100 * share:.1f}" for share in shares)
            print(f"| {fabric} | {before['group']} | {cells} |", flush=True)
        found.append((fabric, answer["parameters"]))
    print("\n| cloth | corrections |\n|---|---|")
    for fabric, parameters in found:
        cells = (f"{p['name']} {p['value']:.2f} +- {p['se']:.2f}" for p in parameters)
        print(f"| {fabric} | {'; '.join(cells)} |")


if __name__ == "__main__":
    main()
