"""Writes evening.exr, the light of the back-lit scenes: a low sun behind thin
cloud over a pale sky. Equirectangular, linear Rec.709. Needs numpy and mitsuba."""

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
width, height = 256, 128
elevation = (0.5 - (np.arange(height) + 0.5) / height)[:, None] * np.pi
azimuth = (0.5 - (np.arange(width) + 0.5) / width)[None, :] * 2.0 * np.pi
# Right-handed: centre of the picture, its left, up.
direction = np.stack(
    np.broadcast_arrays(
        np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)
    ),
    -1,
)
sun = np.array([np.cos(np.radians(38)), -0.12, np.sin(np.radians(38))])
cos_sun = direction @ (sun / np.linalg.norm(sun))
rgb = np.array
up = np.clip(direction[..., 2:], 0.0, 1.0)
sky = rgb([0.10, 0.09, 0.11]) * (1 - up) ** 2 + rgb([0.03, 0.05, 0.11]) * (1 - (1 - up) ** 2)
ground = rgb([0.020, 0.018, 0.018])
sky = np.where(direction[..., 2:] > 0.0, sky, ground)
halo = np.exp((cos_sun - 1.0) / 0.10)[..., None] * rgb([0.14, 0.09, 0.05])
cloud = np.exp((cos_sun - 1.0) / 0.012)[..., None] * rgb([4.0, 2.9, 1.7])
disk = np.exp((cos_sun - 1.0) / 0.0012)[..., None] * rgb([120.0, 85.0, 48.0])
picture = (sky + halo + cloud + disk).astype(np.float16)
mi.Bitmap(picture).write("evening.exr")
