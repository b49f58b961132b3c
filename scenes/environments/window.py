"""Writes window.exr, the light of the back-lit close-up: a wide window behind the
cloth, warm below and blue above, and a dim warm room before it. Equirectangular,
linear Rec.709. Needs numpy and mitsuba."""

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
width, height = 128, 64
elevation = (0.5 - (np.arange(height) + 0.5) / height)[:, None] * np.pi
azimuth = (0.5 - (np.arange(width) + 0.5) / width)[None, :] * 2.0 * np.pi
rgb = np.array

# The centre of the picture lies behind the cloth.
toward_centre = np.cos(elevation) * np.cos(azimuth)
behind = 1.0 / (1.0 + np.exp(-(toward_centre + 0.1) / 0.22))[..., None]
up = (0.5 + 0.5 * np.sin(elevation))[..., None]
window = rgb([1.02, 0.80, 0.58]) * (1 - up) + rgb([0.55, 0.78, 1.12]) * up
room = rgb([0.42, 0.34, 0.26])
picture = (window * behind + room * (1 - behind)).astype(np.float16)
mi.Bitmap(picture).write("window.exr")
