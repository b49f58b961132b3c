"""Draws the sections of fibres, their lobes, and satin.toml with each of them, side by side
in sections.png. Needs cargo, organza in the PATH (or its name as the argument) and Pillow.
"""
import csv
import math
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageDraw

HERE = Path(__file__).parent
ORGANZA = sys.argv[1] if len(sys.argv) > 1 else "organza"
NAMES = ["round", "bean", "trilobal", "triangle", "ribbon"]
SIZE, LABEL, GAP, SCALE = 200, 14, 4, 3
COLOURS = ["#3060c0", "#c03028", "#208040"]

example = ["cargo", "run", "-q", "-p", "organza-scatter", "--example", "sections"]
rows = subprocess.run(example, check=True, capture_output=True, text=True, cwd=HERE).stdout
outlines, lobes = {}, {}
for name, first, *numbers in csv.reader(rows.splitlines()):
    name = "round" if name == "ellipse:1" else name
    numbers = [float(n) for n in numbers]
    if first == "outline":
        outlines.setdefault(name, []).append(numbers[:2])
    else:
        lobes.setdefault(name, []).append((math.radians(float(first)), numbers))


def drawing(draw_on):
    cell = Image.new("RGB", (SIZE * SCALE, SIZE * SCALE), "white")
    draw_on(ImageDraw.Draw(cell))
    return cell.resize((SIZE, SIZE), Image.Resampling.LANCZOS)


def outline(name):
    middle, per = SIZE * SCALE / 2, SIZE * SCALE / 4.6
    points = [(middle + per * x, middle - per * y) for x, y in outlines[name]]
    return drawing(lambda d: d.polygon(points, fill="#e8e4dc", outline="#404040", width=SCALE))


def polar(name):
    middle, per = SIZE * SCALE / 2, SIZE * SCALE / 2.9
    both = [(s * a, values) for s in (1, -1) for a, values in lobes[name][:: s]]

    def draw_on(d):
        d.line([(0, middle), (0.15 * middle, middle)], fill="#404040", width=2 * SCALE)
        for lobe, colour in enumerate(COLOURS):
            points = [
                (middle + per * math.sqrt(v[lobe]) * math.cos(a), middle - per * math.sqrt(v[lobe]) * math.sin(a))
                for a, v in both
            ]
            d.line(points + points[:1], fill=colour, width=SCALE + 1)

    return drawing(draw_on)


def satin(name, folder):
    picture = Path(folder) / "cell.png"
    section = f'object.1.optics={{ "*" = {{ section = "{name}" }} }}'
    command = [ORGANZA, "render", HERE / "sections.toml", "-o", picture, "--quiet", "--set", section]
    subprocess.run(command, check=True)
    with Image.open(picture) as cell:
        return cell.convert("RGB")


sheet = Image.new("RGB", (len(NAMES) * (SIZE + GAP) + GAP, 3 * (SIZE + GAP) + LABEL + GAP), "white")
draw = ImageDraw.Draw(sheet)
with tempfile.TemporaryDirectory() as folder:
    for i, name in enumerate(NAMES):
        x = GAP + i * (SIZE + GAP)
        draw.text((x + 1, 1), name, fill="black")
        for row, cell in enumerate([outline(name), polar(name), satin(name, folder)]):
            sheet.paste(cell, (x, LABEL + row * (SIZE + GAP)))
sheet.quantize(200, dither=Image.Dither.NONE).save(HERE / "sections.png", optimize=True)
