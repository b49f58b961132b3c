"""Draws roses.png, the picture that roses.toml prints: two roses that repeat over an edge.

    python3 scenes/fabrics/print/roses.py

Needs Pillow.
"""
from math import cos, pi, sin
from pathlib import Path

from PIL import Image, ImageDraw

SIDE, FINER = 256, 4
PAPER, LEAF = (255, 255, 255), (24, 110, 58)
# From the outside: petals that get smaller and paler.
PETALS = [(1.0, (138, 14, 30)), (0.74, (176, 28, 42)), (0.5, (205, 66, 70)), (0.27, (226, 138, 120))]
# Middle and radius as shares of the side.
ROSES = [(0.36, 0.40, 0.20), (0.78, 0.82, 0.13)]


def disc(draw, x, y, radius, colour):
    """A disc, and its copies beyond the edges, so that the picture repeats."""
    side = SIDE * FINER
    for dx in (-side, 0, side):
        for dy in (-side, 0, side):
            draw.ellipse([x + dx - radius, y + dy - radius, x + dx + radius, y + dy + radius], fill=colour)


def main():
    side = SIDE * FINER
    sheet = Image.new("RGB", (side, side), PAPER)
    draw = ImageDraw.Draw(sheet)
    for u, v, r in ROSES:
        x, y, radius = u * side, v * side, r * side
        for k in range(5):
            angle = 2 * pi * (k + 0.5) / 5 + u
            disc(draw, x + 1.05 * radius * cos(angle), y + 1.05 * radius * sin(angle), 0.42 * radius, LEAF)
        for ring, (share, colour) in enumerate(PETALS):
            for k in range(5):
                angle = 2 * pi * (k + 0.5 * ring) / 5 + u
                away = 0.52 * share * radius
                disc(draw, x + away * cos(angle), y + away * sin(angle), 0.5 * share * radius, colour)
    small = sheet.resize((SIDE, SIDE), Image.Resampling.LANCZOS)
    small.quantize(32, dither=Image.Dither.NONE).save(Path(__file__).with_suffix(".png"), optimize=True)


if __name__ == "__main__":
    main()
