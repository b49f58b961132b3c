#!/usr/bin/env python3
"""Times how long the shipped fabrics take to voxelize, and to read from the cache.

    python3 benches/cache.py [--chart docs/cache.png]

Prints a row of benches/runs/commands.md#the-cache for each fabric: the least time of three runs without a
cache and of three with its entry there. ORGANZA names the program; target/release/organza
without it. The chart needs matplotlib.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ORGANZA = os.environ.get("ORGANZA", str(ROOT / "target/release/organza"))
FABRICS = ["organza", "silk_shantung", "linen", "denim", "wool_tweed", "towel", "jersey"]
RUNS = 3


def seconds(fabric, footprint, folder, more):
    command = [ORGANZA, "voxelize", f"scenes/fabrics/{fabric}.toml", "--footprint", footprint]
    command += ["-o", f"{folder}/out.ovox", "--quiet", *more]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("ORGANZA_CACHE")}
    started = time.perf_counter()
    subprocess.run(command, check=True, cwd=ROOT, env=environment)
    return time.perf_counter() - started


def measure(fabric, footprint, folder):
    cache = Path(folder) / f"{fabric}-{footprint}"
    built = min(seconds(fabric, footprint, folder, []) for _ in range(RUNS))
    seconds(fabric, footprint, folder, ["--cache", str(cache)])
    read = min(seconds(fabric, footprint, folder, ["--cache", str(cache)]) for _ in range(RUNS))
    [entry] = [path for path in cache.iterdir() if len(path.name) == 64]
    return built, read, entry.stat().st_size / 2**20


def chart(rows, path):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7, 3.4), dpi=110)
    names = [fabric.replace("_", " ") for fabric, *_ in rows]
    places = range(len(rows))
    axes.barh([p - 0.2 for p in places], [r[1] for r in rows], 0.38, label="built", color="#b0703c")
    axes.barh([p + 0.2 for p in places], [r[2] for r in rows], 0.38,
              label="from the cache", color="#33658a")
    axes.set_yticks(list(places), names)
    axes.invert_yaxis()
    axes.set_xlabel("time of organza voxelize --footprint axis, s")
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(path)


def main():
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for footprint in ["axis", "covered"]:
            for fabric in FABRICS:
                built, read, size = measure(fabric, footprint, folder)
                print(f"| {fabric} | {footprint} | {built:.2f} | {read:.2f} | {size:.1f} |", flush=True)
                if footprint == "axis":
                    rows.append((fabric, built, read))
    if "--chart" in sys.argv:
        chart(rows, sys.argv[sys.argv.index("--chart") + 1])


main()
