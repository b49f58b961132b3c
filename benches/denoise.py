#!/usr/bin/env python3
"""How near denoised pictures are to converged ones, with guides and without.

    python3 benches/denoise.py FOLDER [--picture docs/denoise.png]

Prints the rows of benches/runs/gallery.md#denoising. Renders that are in FOLDER are not made again; the
converged ones take half an hour. Open Image Denoise must be where organza finds it; numpy and
OpenEXR are needed, for the picture Pillow, too. ORGANZA names the program; without it that of
target/release is used.

The relative mean squared error is that of all channels of all pixels, each squared difference
over the square of the converged value plus 0.01. FLIP is that of `organza difference`.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR

ROOT = Path(__file__).resolve().parent.parent
ORGANZA = os.environ.get("ORGANZA", str(ROOT / "target/release/organza"))
# Name, scene, further flags, samples of the converged picture.
VIEWS = [
    ("first_light", "first_light", ["--set", "camera.resolution=[192,192]"], 438),
    ("first_light, close", "first_light", ["--crop", "176,176,336,336"], 512),
    ("backlit_organza", "backlit_organza", ["--set", "camera.resolution=[192,192]"], 3072),
    ("denim_macro", "denim_macro",
     ["--set", "camera.resolution=[384,384]", "--crop", "112,112,272,272"], 465),
]
SAMPLES = [4, 16, 64]


def organza(*arguments):
    return subprocess.check_output([ORGANZA, *map(str, arguments)], cwd=ROOT)


def colours(path):
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    return np.stack([np.asarray(channels[n].pixels, dtype=np.float64) for n in "RGB"], -1)


def render(folder, view, samples, seed):
    name, scene, flags, _ = view
    path = folder / f"{name.replace(', ', '_')}_{samples}.exr"
    if not path.exists():
        organza("render", f"scenes/{scene}.toml", "-o", path, "--spp", samples, "--seed", seed,
                "--quiet", *flags)
    return path


def errors(reference, path):
    a, b = colours(path), colours(reference)
    flip = json.loads(organza("difference", "--json", reference, path))["flip"]
    return f"{np.mean((a - b) ** 2 / (b * b + 0.01)):.4f}, {flip:.3f}"


def main():
    folder = Path(sys.argv[1]).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    for view in VIEWS:
        reference = render(folder, view, view[3], 99)
        for samples in SAMPLES:
            noisy = render(folder, view, samples, 11)
            cells = [errors(reference, noisy)]
            for name, flags in [("plain", []), ("guided", ["--guides"])]:
                clean = noisy.with_suffix(f".{name}.exr")
                organza("denoise", noisy, "-o", clean, "--quiet", *flags)
                cells.append(errors(reference, clean))
            print(f"| {view[0]} | {samples} | {' | '.join(cells)} |", flush=True)
    if "--picture" in sys.argv:
        from PIL import Image

        view = VIEWS[1]
        name = view[0].replace(", ", "_")
        files = [f"{name}_16.exr", f"{name}_16.plain.exr", f"{name}_{view[3]}.exr"]
        shown = [np.clip(colours(folder / file), 0, 1) for file in files]
        srgb = [np.where(p <= 0.0031308, 12.92 * p, 1.055 * p ** (1 / 2.4) - 0.055) for p in shown]
        gap = np.ones((srgb[0].shape[0], 4, 3))
        joined = np.concatenate([srgb[0], gap, srgb[1], gap, srgb[2]], 1)
        picture = Image.fromarray((255 * joined + 0.5).astype(np.uint8))
        size = (2 * picture.width, 2 * picture.height)
        picture.resize(size, Image.Resampling.NEAREST).save(sys.argv[sys.argv.index("--picture") + 1], optimize=True)


main()
