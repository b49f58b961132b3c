"""Writes evening.exr, the light of the back-lit scenes: a low sun in haze and a
bright cloud beside it, under a dusk sky. Equirectangular, linear Rec.709. Needs numpy
and mitsuba."""

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
width, height = 256, 128
elevation = (0.5 - (np.arange(height) + 0.5) / height)[:, None] * np.pi
azimuth = (0.5 - (np.arange(width) + 0.5) / width)[None, :] * 2.0 * np.pi
rgb = np.array


def toward(elevation, azimuth):
    """Right-handed: centre of the picture, its left, up."""
    flat = np.cos(elevation)
    parts = (flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation))
    return np.stack(np.broadcast_arrays(*parts), -1)


def glow(elevation_deg, azimuth_deg, width, colour):
    cosine = direction @ toward(*np.radians([elevation_deg, azimuth_deg]))
    return np.exp((cosine - 1.0) / width)[..., None] * rgb(colour)


direction = toward(elevation, azimuth)
up = np.clip(direction[..., 2:], 0.0, 1.0)
sky = rgb([0.42, 0.34, 0.36]) * (1 - up) ** 2 + rgb([0.13, 0.20, 0.42]) * (1 - (1 - up) ** 2)
sky = np.where(direction[..., 2:] > 0.0, sky, rgb([0.16, 0.13, 0.12]))
sun = glow(5, 0, 0.015, [14.0, 8.6, 3.8]) + glow(5, 0, 0.2, [0.07, 0.035, 0.014])
cloud = glow(31, -32, 0.02, [4.0, 4.6, 5.8])
picture = (sky + sun + cloud).astype(np.float16)
mi.Bitmap(picture).write("evening.exr")
