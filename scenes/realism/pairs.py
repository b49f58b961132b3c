"""Renders small cloths without and with one ingredient, by the light of realism.toml, and puts the
pictures side by side in pairs.png. Needs organza in the PATH (or its name as the argument) and Pillow.
"""
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageDraw

HERE = Path(__file__).parent
ORGANZA = sys.argv[1] if len(sys.argv) > 1 else "organza"
SIZE, COLUMNS, LABEL, GAP = (220, 165), 4, 14, 4
FABRIC = """
name = "pair"
[draft]
weave = "{weave}"
[tile]
repeats = [{repeats}, {repeats}]
[warp]
yarn = "yarn"
per_cm = {per_cm}
colours = [[0.55, 0.50, 0.42]]
{warp}
[weft]
yarn = "yarn"
per_cm = {per_cm}
colours = [[0.55, 0.50, 0.42]]
[yarn.yarn]
preset = "{preset}"
tex = {tex}
{yarn}
[voxel]
size_um = 20.0
{tables}
"""
COTTON = dict(weave="plain", repeats=4, per_cm=22, preset="cotton", tex=30, warp="", yarn="", tables="")
SPUN = 'irregularity = "ring-spun cotton"'
# Name of the ingredient, what both cloths have, what only the second one has, and the angle of view.
PAIRS = [
    ("flattening", {"weave": "satin-5-2", "repeats": 2, "per_cm": 26},
     {"yarn": "flattening = { crossing = 1.5, float = 0.8 }"}, 8),
    ("threads wander sideways", {"tex": 20, "repeats": 5},
     {"warp": "wander = { amplitude_um = 55.0, length_mm = 3.0 }"}, 14),
    ("reed marks", {"tex": 20, "repeats": 5},
     {"warp": "reed_dents = { ends = 2, gap_percent = 45.0 }"}, 14),
    ("finish: singed", {"yarn": SPUN}, {"yarn": SPUN + '\nfinish = "singed"'}, 8),
    ("finish: raised", {"yarn": SPUN}, {"yarn": SPUN + '\nfinish = "raised"'}, 8),
    ("finish: calendered", {"yarn": SPUN}, {"yarn": SPUN + '\nfinish = "calendered"'}, 8),
    ("section: trilobal", {"preset": "polyester"},
     {"tables": '[optics.yarn]\nsection = "trilobal"'}, 8),
    ("pile", {},
     {"tables": '[pile]\nkind = "cut"\nyarn = "yarn"\nheight_mm = 1.2\nevery = [2, 2]\n'
      "colours = [[0.55, 0.50, 0.42]]\nlean_deg = 18.0\nlean_deviation_deg = 9.0"}, 14),
]


def render(cloth, fov_deg, folder):
    file, picture = folder / "fabric.toml", folder / "cell.png"
    file.write_text(FABRIC.format(**cloth))
    sets = [f'object.1.fabric="{file}"', f"camera.fov_deg={fov_deg}", f"camera.resolution={list(SIZE)}"]
    sets = [word for one in sets for word in ("--set", one)]
    scene = HERE / "realism.toml"
    command = [ORGANZA, "render", scene, "-o", picture, "--quiet", "--spp", "12", "--threads", "2"]
    subprocess.run([*command, *sets], check=True)
    with Image.open(picture) as cell:
        return cell.convert("RGB")


def main():
    rows = -(-len(PAIRS) * 2 // COLUMNS)
    (width, height) = SIZE
    sheet = Image.new("RGB", (COLUMNS * (width + GAP) + GAP, rows * (height + LABEL + GAP) + GAP), "white")
    draw = ImageDraw.Draw(sheet)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for i, (label, both, added, fov_deg) in enumerate(PAIRS):
            off = COTTON | both
            for j, (word, cloth) in enumerate([("without", off), (label, off | added)]):
                cell = 2 * i + j
                x = GAP + cell % COLUMNS * (width + GAP)
                y = GAP + cell // COLUMNS * (height + LABEL + GAP)
                sheet.paste(render(cloth, fov_deg, folder), (x, y + LABEL))
                draw.text((x + 1, y), word, fill="black")
    # Noise does not compress; 32 colours are enough to compare by eye.
    sheet.quantize(32, dither=Image.Dither.NONE).save(HERE / "pairs.png", optimize=True)


if __name__ == "__main__":
    main()
