"""Compares a far-field table with and without its texture with explicit fibres, in pictures.

    python3 benches/far_texture.py DIR FABRIC PIXEL_MM front|back

Renders 64 x 64 pixels of a flat cloth under the sun, from the front with an even sky, from two seeds,
and prints root mean square errors without the share of the noise, over the mean. Tables and pictures
that are there already are not made again. ORGANZA names the program, PATHS those from each node of
the table. Needs numpy and OpenEXR.
"""

import math
import os
import pathlib
import shutil
import subprocess
import sys

import numpy
import OpenEXR

PIXELS = 64
TO_CAMERA = (0.2, -0.4, 0.89)
SCENE = """[render]
spp = {spp}
seed = {seed}

[camera]
kind = "perspective"
origin_mm = {origin}
target_mm = [0.0, 0.0, 0.0]
up = [0.0, 1.0, 0.0]
fov_deg = {fov}
resolution = [{pixels}, {pixels}]

[[light]]
kind = "directional"
direction = [0.45, -0.45, {down}]
irradiance = [2.2, 2.15, 2.0]
{sky}
[[object]]
kind = "cloth"
fabric = "{fabric}.toml"
model = "{model}"
"""
SKY = """
[[light]]
kind = "environment"
radiance = [0.35, 0.38, 0.42]
"""


def organza(*arguments):
    """Runs the program."""
    program = os.environ.get("ORGANZA", "target/release/organza")
    subprocess.run([program, *map(str, arguments)], check=True)


def picture(folder, fabric, pixel_mm, side, model, seed, spp):
    """Height, width and colour of a picture."""
    path = folder / f"{fabric}.{model}.{pixel_mm}.{side}.{seed}.exr"
    if not path.exists():
        distance_mm = 6000.0 * pixel_mm
        scene = SCENE.format(
            spp=spp,
            seed=seed,
            origin=[x * distance_mm for x in TO_CAMERA],
            fov=2.0 * math.degrees(math.atan(0.5 * PIXELS * pixel_mm / distance_mm)),
            pixels=PIXELS,
            down=-0.77 if side == "front" else 0.77,
            sky=SKY if side == "front" else "",
            fabric=fabric,
            model=model,
        )
        folder.joinpath("scene.toml").write_text(scene)
        organza("render", folder / "scene.toml", "-o", path)
    return OpenEXR.File(str(path)).channels()["RGB"].pixels.astype(float)


def square(values):
    """The mean of the squares."""
    return (values**2).mean()


def main(folder, fabric, pixel_mm, side):
    """Prints the errors of one view."""
    truth = None
    for kind, texels in (("textured", "1024"), ("plain", "0")):
        own = folder / kind
        own.mkdir(parents=True, exist_ok=True)
        shutil.copy(f"scenes/fabrics/{fabric}.toml", own)
        table = own / f"{fabric}.bsdf"
        if not table.exists():
            spp = os.environ.get("PATHS", "131072")
            cloth = own / f"{fabric}.toml"
            organza("table", cloth, "-o", table, "--spp", spp, "--held-out", 0, "--texels", texels)
        if truth is None:
            truth = [picture(own, fabric, pixel_mm, side, "fibres", s, 1024) for s in (1, 2)]
        shown = [picture(own, fabric, pixel_mm, side, "table", s, 512) for s in (1, 2)]
        exact, found = sum(truth) / 2, sum(shown) / 2
        noise = (square(truth[0] - truth[1]) + square(shown[0] - shown[1])) / 4
        error = math.sqrt(max(square(found - exact) - noise, 0.0)) / exact.mean()
        bias = found.mean((0, 1)) / exact.mean((0, 1)) - 1
        print(
            f"{fabric}, {pixel_mm} mm, {side}, {kind}: {100 * error:.1f} %, mean "
            + " ".join(f"{100 * b:+.1f}" for b in bias)
            + f" %, noise {100 * math.sqrt(noise) / exact.mean():.1f} %"
        )


if __name__ == "__main__":
    if len(sys.argv) != 5 or sys.argv[4] not in ("front", "back"):
        sys.exit(__doc__)
    main(pathlib.Path(sys.argv[1]), sys.argv[2], float(sys.argv[3]), sys.argv[4])
