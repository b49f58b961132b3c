"""Errors of a picture, from another one of the same scene whose noise is known.

Radiances are arrays of shape (height, width), means of the three channels. All errors are shares.
"""
import numpy as np

# Edge of the squares of pixels in which an error is compared with the value there.
NEAR_PX = 4
# Edge of the squares whose means show what is off further than from pixel to pixel.
BLOCK_PX = 16


def blocks(image, edge):
    """Means of squares of pixels; what is left at the edges of the picture is left out."""
    rows, columns = image.shape[0] // edge, image.shape[1] // edge
    squares = image[: rows * edge, : columns * edge].reshape(rows, edge, columns, edge)
    return squares.mean(axis=(1, 3))


def errors(image, other, variance):
    """Errors of an image by another one that is unbiased and has that variance of the mean.

    Gives the error of the mean and its standard error, the root mean square of the errors of
    pixels and of blocks over the mean of the other picture, and the median of the errors of pixels
    over the value around them. The noise of the other picture is not counted.
    """
    mean, difference = float(other.mean()), image - other
    squares = difference**2 - variance
    coarse = blocks(difference, BLOCK_PX)
    of_blocks = coarse**2 - blocks(variance, BLOCK_PX) / BLOCK_PX**2
    near = blocks(squares, NEAR_PX) / blocks(other, NEAR_PX) ** 2
    return {
        "mean": float(difference.mean()) / mean,
        "mean_error": float(coarse.std(ddof=1)) / np.sqrt(coarse.size) / mean,
        "pixel": float(np.sqrt(max(squares.mean(), 0))) / mean,
        "block": float(np.sqrt(max(of_blocks.mean(), 0))) / mean,
        "median": float(np.median(np.sqrt(np.maximum(near, 0)))),
    }


def median_noise(image, variance):
    """Noise of the median pixel over the value around it, as `errors` gives the error."""
    near = blocks(variance, NEAR_PX) / blocks(image, NEAR_PX) ** 2
    return float(np.median(np.sqrt(near)))
