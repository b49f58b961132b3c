"""Renders sheet.toml once for every scattering model and puts the pictures side
by side in sheet.png. Needs organza in the PATH (or its name as the argument)
and Pillow.
"""
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageDraw

HERE = Path(__file__).parent
ORGANZA = sys.argv[1] if len(sys.argv) > 1 else "organza"
FLAKE = "object.0.model=microflake"
PACKED, PLAIN = "object.0.model=packed", "object.0.model=plain"
EVERY = "object.0.optics.*."
MODELS = [
    ("SGGX mirrors", [FLAKE, "object.0.flake=sggx-specular"]),
    ("SGGX diffuse", [FLAKE, "object.0.flake=sggx-diffuse"]),
    ("Gaussian, gamma 0.1", [FLAKE, "object.0.flake=gaussian", EVERY + "gamma=0.1"]),
    ("Gaussian, gamma 0.4", [FLAKE, "object.0.flake=gaussian", EVERY + "gamma=0.4"]),
    ("sine power 100", [FLAKE, "object.0.flake=sin-power", EVERY + "sin_power=100"]),
    ("dielectric, plain (far field)", [PLAIN]),
    ("dielectric, packed (near)", [PACKED]),
    ("fitted cotton, packed", [PACKED, EVERY + "fitted=cotton"]),
    ("fitted silk, packed", [PACKED, EVERY + "fitted=silk"]),
    ("fitted gabardine, plain", [PLAIN, EVERY + "fitted=gabardine"]),
]
COLUMNS, LABEL, GAP = 5, 14, 4

with tempfile.TemporaryDirectory() as folder:
    cells = []
    for i, (name, keys) in enumerate(MODELS):
        picture = Path(folder) / f"{i}.png"
        sets = [word for key in keys for word in ("--set", key)]
        command = [ORGANZA, "render", HERE / "sheet.toml", "-o", picture, "--quiet", *sets]
        subprocess.run(command, check=True)
        cells.append((name, Image.open(picture).convert("RGB")))

width, height = cells[0][1].size
rows = -(-len(cells) // COLUMNS)
sheet = Image.new(
    "RGB",
    (COLUMNS * (width + GAP) + GAP, rows * (height + LABEL + GAP) + GAP),
    "white",
)
draw = ImageDraw.Draw(sheet)
for i, (name, cell) in enumerate(cells):
    x = GAP + i % COLUMNS * (width + GAP)
    y = GAP + i // COLUMNS * (height + LABEL + GAP)
    sheet.paste(cell, (x, y + LABEL))
    draw.text((x + 1, y), name, fill="black")
# Noise does not compress; 128 colours are enough to compare by eye.
sheet.quantize(128, dither=Image.Dither.NONE).save(HERE / "sheet.png", optimize=True)
