"""Noise and error of a denoised picture, from two renders with independent samples.

Radiances are arrays of shape (height, width, 3). A share is relative to the mean radiance of the
picture, over all pixels and channels.
"""
from typing import NamedTuple

import numpy as np

# Edge of the squares whose means are taken as independent: larger than the reach of the
# denoiser's strongest smoothing at most noise levels.
BLOCK_PX = 32


class Share(NamedTuple):
    """A root mean square as a share of the mean radiance, and its standard error.

    `value` is None where the mean square is below twice its standard error; the root mean square
    is then below `limit`.
    """

    value: float | None
    error: float
    limit: float

    def text(self):
        if self.value is None:
            return f"< {100 * self.limit:.2f} %"
        return f"{100 * self.value:.2f} % ± {100 * self.error:.2f} %"


def root(squares, mean):
    """Root mean square of values whose squares are estimated pixel by pixel.

    The standard error comes from the means of blocks. Differences between parts of the picture
    count as errors, too, so it is rather too large.
    """
    height, width = squares.shape[:2]
    edge = min(BLOCK_PX, height // 4, width // 4)
    rows, columns = height // edge, width // edge
    blocks = squares[: rows * edge, : columns * edge].reshape(rows, edge, columns, -1)
    blocks = blocks.mean(axis=(1, 3))
    square, error = float(squares.mean()), float(blocks.std(ddof=1) / np.sqrt(blocks.size))
    limit = np.sqrt(max(square, 0.0) + 2 * error) / mean
    if square <= 2 * error:
        return Share(None, 0.0, float(limit))
    value = np.sqrt(square)
    return Share(float(value / mean), float(error / (2 * value) / mean), float(limit))


def median_noise(mean, variance, through):
    """Standard error of the median pixel as a share of its value, over the pixels that met matter
    and are lit; `variance` is that of the pixel's mean. `organza render --stats` prints the same.
    """
    value = mean.astype(np.float64).sum(axis=2)
    counts = (through < 1) & (value > 0)
    error = np.sqrt(3 * variance.astype(np.float64).sum(axis=2)[counts])
    return float(np.median(error / value[counts])) if counts.any() else None


def noise_of_denoised(denoised_a, denoised_b, mean):
    """Noise of the denoised whole: half the difference of the denoised halves.

    The difference has twice the variance of a denoised half. That of the whole is half the
    variance of a half, as the denoiser's input has half the variance.
    """
    difference = (denoised_a - denoised_b).astype(np.float64)
    return root((difference / 2) ** 2, mean)


def error_of_denoised(denoised, noisy, variances, mean):
    """Error of a denoised half, bias included, without a reference.

    Each denoised half is compared with the noisy other half, whose samples it does not know. The
    expectation of the squared difference is the squared error of the denoised half plus the
    variance of the noisy one, which is known and subtracted. The mean of both ways is returned.
    """
    (denoised_a, denoised_b), (noisy_a, noisy_b) = denoised, noisy
    squares = [
        (denoised_a.astype(np.float64) - noisy_b) ** 2 - variances[1],
        (denoised_b.astype(np.float64) - noisy_a) ** 2 - variances[0],
    ]
    return root(np.mean(squares, axis=0), mean)
