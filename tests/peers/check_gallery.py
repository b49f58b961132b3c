#!/usr/bin/env python3
"""Checks the figures of scenes/gallery/gallery.py: noise and error of denoised pictures whose truth
is known, and a small run of the script.

    check_gallery.py --organza FILE --out FOLDER

Needs NumPy, OpenEXR, Pillow and pyoidn.
"""

import argparse
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent.parent
GALLERY = ROOT / "scenes/gallery"
sys.path.insert(0, str(GALLERY))

from noise import error_of_denoised, median_noise, noise_of_denoised  # noqa: E402

SEED = 7
SIDE = 256


def smoothed(image):
    """A denoiser whose error can be computed: the mean of 3 x 3 pixels."""
    return np.mean([np.roll(image, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)], axis=0)


def synthetic(rng, truth, samples):
    """Mean and estimated variance of the mean of skewed samples, as paths have them."""
    paths = truth * rng.exponential(1.0, (samples, *truth.shape))
    return paths.mean(axis=0), paths.var(axis=0, ddof=1) / samples


def check_figures():
    rng = np.random.default_rng(SEED)
    y, x = np.mgrid[0:SIDE, 0:SIDE]
    truth = (1 + 0.5 * np.sin(x / 1.5) * np.sin(y / 2.0))[..., None] * np.ones(3)
    mean = truth.mean()
    halves = [synthetic(rng, truth, 8) for _ in range(2)]
    raw, variances = [h[0] for h in halves], [h[1] for h in halves]
    smooth = [smoothed(r) for r in raw]

    def rms(image):
        return np.sqrt((image**2).mean()) / mean

    error = error_of_denoised(smooth, raw, variances, mean)
    known = np.sqrt(np.mean([rms(s - truth) ** 2 for s in smooth]))
    assert abs(error.value - known) < 4 * error.error, (error, known, SEED)
    assert error.error < 0.02 * error.value, error
    # Known bad: a half that knows its own noise; the bias alone; the variance not subtracted.
    own = error_of_denoised(smooth[::-1], raw, variances, mean)
    bias = rms(smoothed(truth) - truth)
    whole = error_of_denoised(smooth, raw, [0 * v for v in variances], mean)
    for wrong in (own.value or 0.0, bias, whole.value):
        assert abs(wrong - known) > 4 * error.error, (wrong, known, SEED)

    noise = noise_of_denoised(*smooth, mean)
    merged = smoothed((raw[0] + raw[1]) / 2)
    expected = rms(merged - smoothed(truth))
    assert abs(noise.value - expected) < 4 * np.hypot(noise.error, noise.error), (noise, expected)
    # Known bad: the noise of a half.
    assert abs(noise.value * np.sqrt(2) - expected) > 8 * noise.error

    exact = noise_of_denoised(truth, truth, mean)
    assert exact.value is None and exact.limit == 0.0
    nothing = error_of_denoised([truth] * 2, raw, variances, mean)
    # No tolerance: a limit that would hide half of the error would be of no use.
    assert nothing.value is None and nothing.limit < 0.5 * known, (nothing, known)
    print(f"error {error.text()} ({100 * known:.2f} %), noise {noise.text()}", flush=True)


def check_run(organza, out):
    command = [
        sys.executable, GALLERY / "gallery.py", "sail", "--organza", organza, "--size", "96",
        "--seconds", "6", "--threads", "1", "--work", out,
    ]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    assert "| sail | surface | 96 |" in done.stdout, done.stdout
    figures = json.loads((out / "sail.json").read_text())
    assert (out / "sail.png").exists() and figures["samples"] % 2 == 0

    # The merged picture is that of one render, and so is its median noise.
    at_once = subprocess.run(
        [
            organza, "render", GALLERY / "sail.toml", "-o", out / "once.exr", "--threads", "1",
            "--spp", str(figures["samples"]), "--set", "camera.resolution=[96,96]", "--stats",
        ],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=True,
    ).stdout
    printed = float(re.search(r"([\d.e+-]+) in the median pixel", at_once)[1])
    assert abs(figures["median_noise"] - printed) < 2e-3 * printed, (figures, printed)
    assert median_noise(np.ones((1, 1, 3)), np.ones((1, 1, 3)), np.ones((1, 1))) is None
    print(f"sail: {figures['samples']} samples, median noise {printed:.4f}", flush=True)


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
