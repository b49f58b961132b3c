"""Renders realism.toml with each irregularity of raw_denim.toml alone, with none and with
all, and puts the pictures side by side in realism.png. Needs organza in the PATH (or its
name as the argument) and Pillow.
"""
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageDraw

HERE = Path(__file__).parent
ORGANZA = sys.argv[1] if len(sys.argv) > 1 else "organza"
THREADS = ("evenness", "spacing_cv_percent")
FIBRES = ("fibre_radius_cv_percent", "wander")
HAIRS = ("hairiness",)
DYE = ("ring_dye",)
CELLS = [
    ("ideal yarns", ()),
    ("uneven threads", THREADS),
    ("uneven, wandering fibres", FIBRES),
    ("protruding fibres", HAIRS),
    ("ring dye", DYE),
    ("all of them", THREADS + FIBRES + HAIRS + DYE),
]
COLUMNS, LABEL, GAP = 3, 14, 4


def kept(line, keys):
    key = line.split("=")[0].strip()
    return key in keys or key not in THREADS + FIBRES + HAIRS + DYE


fabric = (HERE / "../fabrics/irregular/raw_denim.toml").read_text().splitlines()
cells = []
with tempfile.TemporaryDirectory() as folder:
    file, picture = Path(folder) / "fabric.toml", Path(folder) / "cell.png"
    for name, keys in CELLS:
        file.write_text("\n".join(line for line in fabric if kept(line, keys)))
        sets = ["--set", f'object.1.fabric="{file}"']
        command = [ORGANZA, "render", HERE / "realism.toml", "-o", picture, "--quiet", *sets]
        subprocess.run(command, check=True)
        with Image.open(picture) as cell:
            cells.append((name, cell.convert("RGB")))

width, height = cells[0][1].size
rows = -(-len(cells) // COLUMNS)
size = (COLUMNS * (width + GAP) + GAP, rows * (height + LABEL + GAP) + GAP)
sheet = Image.new("RGB", size, "white")
draw = ImageDraw.Draw(sheet)
for i, (name, cell) in enumerate(cells):
    x = GAP + i % COLUMNS * (width + GAP)
    y = GAP + i // COLUMNS * (height + LABEL + GAP)
    sheet.paste(cell, (x, y + LABEL))
    draw.text((x + 1, y), name, fill="black")
# Noise does not compress; 128 colours are enough to compare by eye.
sheet.quantize(128, dither=Image.Dither.NONE).save(HERE / "realism.png", optimize=True)
