#!/usr/bin/env python3
"""Compares the vector kernel with the general walk and with closed forms, by the command line.

    python3 benches/kernel_is_walk.py [PART ...]

Every case is a scene in a white surround, rendered by `--engine cpu` and by `--engine walk`:

- density: thin matter beside matter up to 1e9 times as dense. Absorbing, it passes exp(-1) of
  the light; lossless, the surround is seen everywhere.
- grid: four fabrics as absorbing `.vol` grids. What passes is summed here from the files, column
  by column.
- fabric: every fabric of scenes/fabrics, and cotton with many hairs, in voxels of their own size
  and of four times that size: micro-flakes, black and white; plain virtual fibres, white, from
  smooth to the widest blur; plain and packed ones of half the colour and of the default blur. The
  white ones show the surround. What black flakes pass is compared with exact stepping
  (`render.integrator = "regular"`).

Two estimates agree if they differ by at most 1e-3 and four of their standard errors. Cases that
the kernel refuses are counted, with the reason; there the walk alone is compared. A known-bad
twin of every comparison must fail: the expected value 2 % higher for the closed forms.

Prints a table for each part and the cases that disagree, and fails if there are any. What is
known stands in target/kernel_is_walk/COMMIT.jsonl; an interrupted run resumes there. ORGANZA
names the program.
"""

import itertools
import json
import math
import os
import statistics
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = os.environ.get("ORGANZA", str(ROOT / "target/release/organza"))
FOLDER = ROOT / "target" / "kernel_is_walk"
PARTS = ("density", "grid", "fabric")
LARGEST = 1e-3
# Seconds of one render, and the error of a pixel at which it ends: with 1024 pixels the mean has
# a thirty-second of it.
LIMIT_S, PIXEL_ERROR = 20, 0.006
CAMERA = """[camera]
origin_mm = {origin}
target_mm = {target}
up = [0.0, 1.0, 0.0]
width_mm = {width}
resolution = [32, 32]
filter = "box"
[[light]]
kind = "environment"
radiance = [1.0, 1.0, 1.0]
"""
HAIRS = """[draft]
weave = "plain"
[warp]
yarn = "cotton"
per_cm = 20.0
[weft]
yarn = "cotton"
per_cm = 20.0
[yarn.cotton]
preset = "cotton"
tex = 20.0
hairs = {{ per_mm = {per_mm} }}
[voxel]
size_um = 10.0
"""


def write_vol(path, cells, box):
    """A grid in Mitsuba's format; `cells` has the axes z, y, x, channel."""
    z, y, x, channels = cells.shape
    head = b"VOL\x03" + struct.pack("<5i6f", 1, x, y, z, channels, *box)
    path.write_bytes(head + cells.astype("<f4").tobytes())


def read_vol(path):
    data = path.read_bytes()
    _, x, y, z, channels, *box = struct.unpack("<5i6f", data[4:48])
    return np.frombuffer(data, "<f4", offset=48).reshape(z, y, x, channels), box


def render(scene, engine, more=(), limit_s=LIMIT_S):
    """What the program tells of a render of a scene's text."""
    path = FOLDER / "scene.toml"
    path.write_text(scene)
    told = subprocess.run(
        [PROGRAM, "render", path, "-o", FOLDER / "picture.exr", "--engine", engine, "--json",
         "--quiet", "--spp", "8192", "--target-error", str(PIXEL_ERROR), "--time-limit",
         str(limit_s), *more],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)  # fmt: skip
    if told.returncode != 0:
        sys.exit(f"{told.stderr}\nin the scene\n{scene}")
    told = json.loads(told.stdout)
    if told["standard_error"] is None:  # not two samples within the limit
        return render(scene, engine, more, 4 * limit_s)
    channels = zip(told["mean"], told["standard_error"])
    # Channels are not independent: the mean of their errors is an upper bound.
    mean, error = (statistics.fmean(values) for values in zip(*channels))
    return {"engine": told["backend"], "refused": told["kernel_refused"], "mean": mean,
            "error": error, "lost": told["cut"] + told["rejected"]}  # fmt: skip


def density():
    """Cases of two cells of 1 mm, seen through the thin one."""
    for ratio, albedo in itertools.product([10.0**i for i in range(10)], [0.0, 1.0]):
        # The walk through lossless matter of 1e9 per mm takes 2^20 events a path.
        if albedo == 1.0 and ratio > 1e4:
            continue
        box = (0, 0, 0, 2, 1, 1)
        write_vol(FOLDER / "sigma.vol", np.array([1.0, ratio]).reshape(1, 1, 2, 1), box)
        write_vol(FOLDER / "sggx.vol", np.array([1.0, 1, 1, 0, 0, 0]).reshape(1, 1, 1, 6), box)
        scene = CAMERA.format(origin=[0.5, 0.5, 5.0], target=[0.5, 0.5, 0.0], width=0.9)
        scene += '[[object]]\nkind = "grid"\nextinction = "sigma.vol"\nsggx = "sggx.vol"\n'
        scene += f"albedo = [{albedo}, {albedo}, {albedo}]\n"
        yield f"{ratio:.0e}, albedo {albedo}", scene, math.exp(-1) if albedo == 0.0 else 1.0, False


def grid():
    """Cases of fabrics as grids that absorb, seen along z."""
    for fabric in ("denim", "organza", "jersey", "wool_tweed"):
        base = FOLDER / fabric
        if not base.with_suffix(".sigma_t.vol").exists():
            subprocess.run(
                [PROGRAM, "voxelize", ROOT / f"scenes/fabrics/{fabric}.toml", "-o",
                 base.with_suffix(".vol"), "--voxel-um", "40", "--quiet"], check=True)  # fmt: skip
        sigma, box = read_vol(base.with_suffix(".sigma_t.vol"))
        sggx, _ = read_vol(base.with_suffix(".sggx.vol"))
        # Extinction toward z: sigma_t times the root of the matrix's element zz.
        along = sigma[..., 0] * np.sqrt(np.maximum(sggx[..., 2], 0.0))
        depth = along.astype(float).sum(axis=0) * (box[5] - box[2]) / sigma.shape[0]
        centre = [(box[0] + box[3]) / 2, (box[1] + box[4]) / 2]
        # A window of whole cells around the centre: the camera sees a square.
        cell = (box[3] - box[0]) / sigma.shape[2], (box[4] - box[1]) / sigma.shape[1]
        side = 0.8 * min(box[3] - box[0], box[4] - box[1])
        xs = box[0] + cell[0] * np.arange(sigma.shape[2] + 1)
        ys = box[1] + cell[1] * np.arange(sigma.shape[1] + 1)
        share = lambda edges, c: np.diff(np.clip(edges, c - side / 2, c + side / 2)) / side
        weights = np.outer(share(ys, centre[1]), share(xs, centre[0]))
        passed = float((weights * np.exp(-depth)).sum())
        scene = CAMERA.format(origin=[*centre, 20.0], target=[*centre, 0.0], width=side)
        scene += f'[[object]]\nkind = "grid"\nextinction = "{fabric}.sigma_t.vol"\n'
        scene += f'sggx = "{fabric}.sggx.vol"\nalbedo = [0.0, 0.0, 0.0]\n'
        yield fabric, scene, passed, False


def fabric():
    """Cases of fabrics: name, scene, expected value if known, and whether exact stepping is
    asked for it."""
    fabrics = [(path.stem, path) for path in sorted((ROOT / "scenes/fabrics").glob("*.toml"))]
    for per_mm in (30.0, 300.0, 1e4):
        path = FOLDER / f"hairs_{per_mm:.0f}.toml"
        path.write_text(HAIRS.format(per_mm=per_mm))
        fabrics.append((f"{per_mm:.0f} hairs per mm", path))
    three = lambda x: f"[{x}, {x}, {x}]"
    flakes = lambda albedo: f'model = "microflake"\n[object.optics."*"]\nalbedo = {three(albedo)}'
    fibres = lambda model, colour, blur: (
        f'model = "{model}"\n[object.optics."*"]\ncolour = {three(colour)}\n'
        f"longitudinal_deg = {blur}\nazimuthal_deg = {2 * blur}"
    )
    looks = [("black flakes", flakes(0.0), None), ("white flakes", flakes(1.0), 1.0)]
    looks += [(f"plain, white, {blur} deg", fibres("plain", 1.0, blur), 1.0)
              for blur in (0.0, 3.0, 7.0, 12.0, 19.9, 34.0)]  # fmt: skip
    looks += [(f"{model}, half, 6 deg", fibres(model, 0.5, 6.0), None)
              for model in ("plain", "packed")]  # fmt: skip
    for (name, path), times, (look, keys, exact) in itertools.product(fabrics, (4, 1), looks):
        size_um = float(path.read_text().split("[voxel]\nsize_um = ")[1].split()[0])
        # Of the fabric's own voxels, flakes and two blurs; they take the most time.
        if times == 1 and look.endswith((" 0.0 deg", "3.0 deg", "12.0 deg", "19.9 deg")):
            continue
        scene = CAMERA.format(origin=[3.0, -4.0, 12.0], target=[0.7, 0.6, 0.0], width=2.5)
        scene += f'[[object]]\nkind = "cloth"\nfabric = "{path}"\nlod = 0\n'
        scene += f"voxel_um = {times * size_um}\n{keys}\n"
        yield f"{name}, {times} voxels, {look}", scene, exact, look == "black flakes"


def agree(a, b):
    difference = abs(a["mean"] - b["mean"])
    return difference <= LARGEST + 4 * math.hypot(a["error"], b["error"])


def judge(part, known):
    """Prints what is known of a part; the number of cases that disagree."""
    cases = [(name, c) for (p, name), c in known.items() if p == part]
    bad, twins, compared, refused, differences = [], [0, 0], 0, {}, []
    for name, case in cases:
        pairs = []
        if case["cpu"]["engine"] == "walk":
            why = case["cpu"]["refused"].split(":")[0]
            why = " ".join(w for w in why.split() if not any(c.isdigit() for c in w))
            refused[why] = refused.get(why, 0) + 1
        else:
            pairs.append(("kernel and walk", case["cpu"], case["walk"]))
            a, b = case["cpu"], case["walk"]
            differences.append((name, a["mean"] - b["mean"], math.hypot(a["error"], b["error"])))
        if case["exact"] is not None:
            pairs += [(e, case[e], case["exact"]) for e in ("cpu", "walk")]
            # Black flakes through which little passes cannot reject 2 %.
            if case["exact"]["mean"] > 0.1:
                wrong = {**case["exact"], "mean": 1.02 * case["exact"]["mean"]}
                twins[0] += 1
                twins[1] += not agree(case["walk"], wrong)
        if case["cpu"]["lost"] + case["walk"]["lost"]:
            print(f"paths were cut or samples rejected: {name}")
        compared += len(pairs)
        for what, a, b in pairs:
            if not agree(a, b):
                bad.append(f"{name}, {what}: {a['mean']:.5f} +- {a['error']:.5f} against "
                           f"{b['mean']:.5f} +- {b['error']:.5f}")  # fmt: skip
    print(f"{part}: {len(cases)} cases, {compared} comparisons, {len(bad)} disagree; "
          f"twins rejected: {twins[1]} of {twins[0]}; left to the walk: {refused or 0}")
    if differences:
        spread = max(differences, key=lambda d: abs(d[1]))
        mean = statistics.fmean(d[1] for d in differences)
        error = math.sqrt(sum(d[2] ** 2 for d in differences)) / len(differences)
        print(f"  kernel less walk in {len(differences)}: mean {mean:+.6f} +- {error:.6f}, greatest "
              f"{spread[1]:+.5f} +- {spread[2]:.5f} ({spread[0]})")
    print("".join(f"  {line}\n" for line in bad), end="")
    return len(bad) + (twins[0] > 0 and twins[1] < twins[0] / 2)


def main(parts):
    FOLDER.mkdir(parents=True, exist_ok=True)
    commit = subprocess.check_output(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, text=True).strip()  # fmt: skip
    journal = FOLDER / f"{commit}.jsonl"
    known = {}
    if journal.exists():
        for line in journal.read_text().splitlines():
            part, name, case = json.loads(line)
            known[part, name] = case
    wrong = 0
    for part in parts:
        for name, scene, exact, stepped in globals()[part]():
            if (part, name) in known:
                continue
            case = {engine: render(scene, engine) for engine in ("cpu", "walk")}
            case["exact"] = None if exact is None else {"mean": exact, "error": 0.0}
            if stepped:
                case["exact"] = render(scene, "walk", ["--set", "render.integrator=regular"])
            known[part, name] = case
            with journal.open("a") as lines:
                lines.write(json.dumps([part, name, case]) + "\n")
            print(name, *(f"{e} {case[e]['mean']:.5f} +- {case[e]['error']:.5f}"
                          for e in case if case[e]), file=sys.stderr, flush=True)  # fmt: skip
        wrong += judge(part, known)
    return wrong


if __name__ == "__main__":
    chosen = sys.argv[1:] or PARTS
    if any(part not in PARTS for part in chosen):
        sys.exit(__doc__)
    sys.exit(1 if main(chosen) else 0)
