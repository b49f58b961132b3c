"""Measures the levels and the surface model of the tea towel against its finest level, and
prints the figures of docs/far_field.md.

    python3 benches/far_field.py levels DIR     pairs of directions, five seeds
    python3 benches/far_field.py albedo DIR     directional albedo of the surface model
    python3 benches/far_field.py zoom DIR       pictures where one representation replaces another

Files that are there already are not made again. ORGANZA names the program, THREADS the number
of threads.
"""

import csv
import json
import os
import pathlib
import resource
import subprocess
import sys

TOWEL = "scenes/fabrics/towel.toml"
SEEDS = range(5)


def organza(made, *arguments):
    """Runs the program unless the file it makes is there; its CPU seconds, if it ran."""
    if made.exists():
        return None
    program = os.environ.get("ORGANZA", "target/release/organza")
    threads = os.environ.get("THREADS", "1")
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    command = [program, *map(str, arguments), "--quiet", "--threads", threads, "-o", str(made)]
    subprocess.run(command, check=True)
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def rows(path):
    """Rows of numbers; comments and the head are left out."""
    lines = [line for line in path.read_text().splitlines() if line[:1].isdigit()]
    return [[float(cell) for cell in row] for row in csv.reader(lines)]


def levels(folder):
    """Root mean square and total differences from level 0; see tests/far.rs."""
    pairs, seconds = "tests/data/level_pairs.csv", {}
    for seed in SEEDS:
        for name in ("0", "1", "2", "3", "4", "surface"):
            what = ["--model", name] if name == "surface" else ["--level", name]
            own_seed = 10 * seed + (9 if name == "surface" else int(name))
            took = organza(
                folder / f"{name}.{seed}.csv", "measure", TOWEL, *what,
                "--pairs", pairs, "--spp", 4096, "--seed", own_seed,
            )  # fmt: skip
            seconds.setdefault(name, []).extend([took] if took else [])
    channels = (4, 5, 6)

    def errors(row):
        return row[7:10] if len(row) > 9 else [0.0] * 3

    for name in ("0", "1", "2", "3", "4", "surface"):
        took = sorted(seconds[name])
        line = [f"{took[len(took) // 2]:.1f} s of user time"] if took else []
        for reflected in (True, False):
            off, noise, total, total_se = [], [], [], []
            for seed in SEEDS:
                both = zip(rows(folder / f"{name}.{seed}.csv"), rows(folder / f"0.{seed}.csv"))
                both = [(r, f) for r, f in both if ((f[0] < 90) == (f[2] < 90)) == reflected]
                level = sum(f[c] ** 2 for _, f in both for c in channels)
                whole = sum(f[c] for _, f in both for c in channels)
                variance = sum(e**2 for pair in both for row in pair for e in errors(row))
                off.append((sum((r[c] - f[c]) ** 2 for r, f in both for c in channels) - variance) / level)
                noise.append((variance / level) ** 0.5)
                total.append(sum(r[c] for r, _ in both for c in channels) / whole - 1)
                # The channels of a pair share their paths, so their errors add.
                of_pair = sum(sum(errors(row)) ** 2 for pair in both for row in pair)
                total_se.append(of_pair**0.5 / whole)
            mean = [100 * sum(values) / len(values) for values in (noise, total, total_se)]
            rms = 100 * max(sum(off) / len(off), 0) ** 0.5
            line.append(
                f"{'R' if reflected else 'T'} rms {rms:.1f} % (noise of one seed {mean[0]:.1f} %), "
                f"total {mean[1]:+.1f} +- {mean[2] / len(SEEDS) ** 0.5:.1f} %"
            )
        if name != "0" or took:
            print(f"{name}: " + "; ".join(line if name != "0" else line[:1]))
    off, count = 0, 0
    finest = [rows(folder / f"0.{seed}.csv") for seed in SEEDS]
    for i, row in enumerate(rows(folder / "surface.0.csv")):
        for c in channels:
            mean = sum(values[i][c] for values in finest) / len(finest)
            count += mean > 0
            off += mean > 0 and abs(row[c] / mean - 1) > 0.25
    print(f"surface more than a quarter off: {off} of {count} values")


def albedo(folder):
    """Reflected and transmitted light of the surface over that of the volume, less one."""
    incident = folder / "incident.csv"
    lights = [(0, 0), (15, 0), (30, 0), (45, 0), (60, 0), (75, 0), (45, 90), (60, 90), (75, 90)]
    incident.write_text("theta_i,phi_i\n" + "".join(f"{t},{p}\n" for t, p in lights))
    tables = []
    for name, what in (("surface", ["--model", "surface"]), ("volume", ["--level", "0"])):
        path = folder / f"albedo.{name}.csv"
        organza(path, "measure", TOWEL, "--albedo", *what, "--pairs", incident, "--spp", 200_000)
        with path.open() as file:
            tables.append(list(csv.DictReader(file)))
    for light, surface, volume in zip(lights, *tables):
        keys = [f"{part}_{c}" for part in ("reflected", "transmitted") for c in "rgb"]
        off = [100 * (float(surface[k]) / float(volume[k]) - 1) for k in keys]
        print(f"{light[0]}:{light[1]}  R", *(f"{x:+.0f} %" for x in off[:3]), end="  T ")
        print(*(f"{x:+.0f} %" for x in off[3:]))


def zoom(folder):
    """Means of pictures of the towel in two representations."""
    for fov, (before, after) in ((0.4256, ("0", "1")), (5.9, ("1", '"surface"'))):
        pictures = []
        for seed, lod in enumerate((before, after)):
            path = folder / f"zoom.{fov}.{seed}.exr"
            organza(
                path, "render", "scenes/towel.toml", "--spp", 512, "--seed", seed,
                "--set", f"camera.fov_deg={fov}", "--set", "camera.resolution=[48,48]",
                "--set", f"object.0.lod={lod}",
            )  # fmt: skip
            pictures.append(path)
        program = os.environ.get("ORGANZA", "target/release/organza")
        command = [program, "difference", *map(str, pictures), "--json"]
        found = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
        changes = []
        for colour in ("red", "green", "blue"):
            one = found[colour]
            change = 100 * (one["mean"] / one["reference_mean"] - 1)
            noise = abs(change / one["significance"]["mean_z"])
            changes.append(f"{change:+.1f} +- {noise:.1f} %")
        print(f"level {before} to {after}: " + ", ".join(changes))


if __name__ == "__main__":
    if len(sys.argv) != 3 or sys.argv[1] not in ("levels", "albedo", "zoom"):
        sys.exit(__doc__)
    given = pathlib.Path(sys.argv[2])
    given.mkdir(parents=True, exist_ok=True)
    {"levels": levels, "albedo": albedo, "zoom": zoom}[sys.argv[1]](given)
