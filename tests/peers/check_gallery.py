#!/usr/bin/env python3
"""Checks the figures of scenes/gallery/gallery.py: errors of pictures whose truth is known, and a
small run of the script.

    check_gallery.py --organza FILE --out FOLDER

Needs NumPy, OpenEXR, Pillow and pyoidn.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent.parent
GALLERY = ROOT / "scenes/gallery"
sys.path.insert(0, str(GALLERY))

from errors import errors, median_noise  # noqa: E402

SEED = 7
SIDE = 256


def check_figures():
    rng = np.random.default_rng(SEED)
    y, x = np.mgrid[0:SIDE, 0:SIDE]
    truth = 1 + 0.5 * np.sin(x / 1.5) * np.sin(y / 2.0)
    # A picture that is 10 % too bright in its left half, with an error of 20 % in each pixel.
    image = truth * np.where(x < SIDE / 2, 1.1, 1.0) * (1 + 0.2 * rng.standard_normal(x.shape))
    # Skewed samples, as paths have them.
    paths = truth * rng.exponential(1.0, (64, SIDE, SIDE))
    other, variance = paths.mean(axis=0), paths.var(axis=0, ddof=1) / 64
    found = errors(image, other, variance)
    known = np.sqrt(((image - truth) ** 2).mean())
    assert abs(found["mean"] - 0.05) < 4 * found["mean_error"], (found, SEED)
    assert abs(found["pixel"] - known) < 0.02 * known, (found, known, SEED)
    assert abs(found["median"] - known) < 0.05 * known, (found, known, SEED)
    # Half the blocks are off by 10 %, all by a sixteenth of the noise of a pixel.
    coarse = np.sqrt(0.1**2 / 2 + (0.2 / 16) ** 2)
    assert abs(found["block"] - coarse) < 0.05 * coarse, (found, coarse, SEED)
    # Known bad: the noise of the other picture counts.
    wrong = errors(image, other, 0 * variance)
    assert abs(wrong["pixel"] - known) > 0.05 * known, (wrong, known, SEED)
    noise = median_noise(other, variance)
    assert abs(noise - 1 / 8) < 0.05 / 8, (noise, SEED)
    print(f"errors {found}, noise {noise:.4f}", flush=True)


def check_run(organza, out):
    command = [
        sys.executable, GALLERY / "gallery.py", "sail", "--organza", organza, "--size", "96",
        "--spp", "4", "--proof", "64", "--threads", "1", "--work", out,
    ]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    assert "| sail | `-` | fibres without cache |" in done.stdout, done.stdout
    figures = json.loads((out / "sail.json").read_text())
    assert (out / "sail.png").exists() and figures["cache"] is None
    print(f"sail: {figures['noisy']}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--organza", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    check_figures()
    check_run(given.organza.resolve(), given.out.resolve())


if __name__ == "__main__":
    main()
