"""Writes the pictures of light of the gallery: studio.hdr and window.hdr.
Equirectangular, linear Rec.709, 256 x 128. The middle of a picture lies behind the cloth as
the camera sees it, and its left is on the camera's left. Needs Python only.

    python3 light.py
"""
from math import cos, exp, frexp, radians, sin
from pathlib import Path

WIDTH, HEIGHT = 256, 128
HERE = Path(__file__).parent


def step(distance, softness):
    """1 inside (distance below 0), 0 outside, with a smooth edge."""
    return 1.0 / (1.0 + exp(max(-60.0, min(60.0, 4.0 * distance / softness))))


def panel(azimuth, elevation, centre, size, softness, colour):
    """A rectangular soft box; degrees. Azimuth is positive towards the left."""
    turn = (azimuth - centre[0] + 180.0) % 360.0 - 180.0
    aside = abs(turn) * cos(radians(elevation)) - size[0] / 2
    above = abs(elevation - centre[1]) - size[1] / 2
    share = step(aside, softness) * step(above, softness)
    return [share * c for c in colour]


def mix(low, high, share):
    return [a + (b - a) * share for a, b in zip(low, high)]


def studio(azimuth, elevation):
    """A large key from the left behind, a strip from the right behind as the rim, a weak
    broad fill from the front, and a grey background that darkens towards its edges."""
    away = (abs((azimuth + 180.0) % 360.0 - 180.0) / 180.0) ** 1.5
    up = 0.5 + 0.5 * sin(radians(elevation))
    return (
        mix([0.16, 0.17, 0.19], [0.07, 0.07, 0.075], away),
        panel(azimuth, elevation, (62.0, 42.0), (66.0, 46.0), 9.0, [5.2, 4.9, 4.4]),
        panel(azimuth, elevation, (-74.0, 22.0), (20.0, 56.0), 6.0, [2.2, 2.5, 3.0]),
        panel(azimuth, elevation, (180.0, 48.0), (120.0, 50.0), 20.0, [0.55, 0.56, 0.58]),
        [0.05 * up] * 3,
    )


def window(azimuth, elevation):
    """A window of small panes behind the cloth, sky above and garden below; a pale room."""
    room = [0.30, 0.27, 0.23]
    sky = mix([1.7, 1.65, 1.5], [1.25, 1.6, 2.15], step(-elevation + 12.0, 24.0))
    garden = [0.42, 0.55, 0.26]
    outside = mix(garden, sky, step(-elevation - 4.0, 9.0))
    turn = (azimuth + 180.0) % 360.0 - 180.0
    across = abs((turn + 4.5) % 9.0 - 4.5) - 0.7
    upward = abs((elevation + 5.5) % 11.0 - 5.5) - 0.6
    frame = min(across, upward)
    is_glass = step(abs(turn) - 38.0, 2.0) * step(abs(elevation - 4.0) - 34.0, 2.0)
    is_glass *= 1.0 - 0.93 * step(frame, 0.6)
    return (mix(room, outside, is_glass),)


def rgbe(colour):
    """A pixel of the Radiance format: three mantissas and their common exponent."""
    most = max(colour)
    if most < 1e-30:
        return bytes(4)
    mantissa, exponent = frexp(most)
    scale = mantissa * 256.0 / most
    return bytes([*(int(c * scale) for c in colour), exponent + 128])


def main():
    for picture in (studio, window):
        pixels = bytearray()
        for row in range(HEIGHT):
            elevation = 90.0 - 180.0 * (row + 0.5) / HEIGHT
            for column in range(WIDTH):
                azimuth = 180.0 - 360.0 * (column + 0.5) / WIDTH
                parts = picture(azimuth, elevation)
                pixels += rgbe([sum(c) for c in zip(*parts)])
        head = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {HEIGHT} +X {WIDTH}\n"
        (HERE / f"{picture.__name__}.hdr").write_bytes(head.encode() + pixels)


main()
