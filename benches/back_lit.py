"""Cloth against the light by explicit, hybrid and packed fibres, side by side.

    python3 benches/back_lit.py DIR [--size N] [--spp N] [--publish]

Renders organza and denim before a bright sky with a soft box behind them, each by explicit fibres,
by explicit ones for the first event of a path, and by packed ones at the levels 0 and 2, from two
seeds. Prints root mean square errors against explicit fibres without the share of the noise, over
the mean, of pixels and of squares of 8 x 8 pixels, the error of the mean, that of the darker half of
squares of 4 x 4 pixels, which are threads, and the CPU time. With
--publish the pictures become docs/back_lit.jpg. Pictures that are there already are not made
again. ORGANZA names the program. Needs Pillow, NumPy and OpenEXR.
"""

import argparse
import json
import math
import os
import pathlib
import resource
import subprocess

import numpy
import OpenEXR
from PIL import Image, ImageDraw

# Width of the view in mm, stops of exposure.
FABRICS = {"organza": (3.0, -0.9), "denim": (7.0, 1.5)}
MODELS = {
    "explicit fibres": 'model = "fibres"',
    "first event explicit": 'model = "packed"\nfirst_events = 1\nlod = 0',
    "packed fibres": 'model = "packed"\nlod = 0',
    "packed fibres, level 2": 'model = "packed"\nlod = 2',
}
BLOCK = 8
SCENE = """[render]
spp = {spp}
seed = {seed}

[camera]
origin_mm = [1.5, -4.0, 20.0]
target_mm = [0.0, 0.0, 0.0]
up = [0.0, 1.0, 0.0]
width_mm = {width}
resolution = [{size}, {size}]
filter = "gaussian"

[[light]]
kind = "rectangle"
corner_mm = [-10.0, 0.0, -50.0]
edge_u_mm = [30.0, 0.0, 0.0]
edge_v_mm = [0.0, 30.0, 0.0]
radiance = [9.0, 8.4, 7.0]
two_sided = true

[[light]]
kind = "environment"
radiance = [0.5, 0.6, 0.75]
hemisphere = "back"

[[object]]
kind = "cloth"
fabric = "{fabric}"
{model}
"""


def picture(folder, fabric, model, seed, given):
    """Height, width and colour of a picture, and the CPU time in s that it took."""
    name = f"{fabric}.{'-'.join(model.replace(',', '').split())}.{given.size}.{given.spp}.{seed}"
    path, kept = folder / f"{name}.exr", folder / f"{name}.json"
    if not kept.exists():
        scene = folder / f"{name}.toml"
        file = pathlib.Path("scenes/fabrics", f"{fabric}.toml").resolve()
        scene.write_text(
            SCENE.format(
                spp=given.spp, seed=seed, width=FABRICS[fabric][0], size=given.size,
                fabric=file, model=MODELS[model],
            )
        )  # fmt: skip
        program = os.environ.get("ORGANZA", "target/release/organza")
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        subprocess.run([program, "render", scene, "-o", path, "--quiet"], check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        kept.write_text(json.dumps(after - before))
    colours = OpenEXR.File(str(path)).channels()["RGB"].pixels.astype(float)
    return colours, json.loads(kept.read_text())


def blocks(colours, edge):
    """Means of squares of pixels."""
    height, width = (n // edge * edge for n in colours.shape[:2])
    rows = colours[:height, :width].reshape(height // edge, edge, width // edge, edge, 3)
    return rows.mean((1, 3))


def error(found, truth, edge):
    """Root mean square error of two pictures each, without their noise, over the mean."""
    a, b = ([blocks(p, edge) for p in pair] for pair in (found, truth))
    noise = (((a[0] - a[1]) ** 2).mean() + ((b[0] - b[1]) ** 2).mean()) / 4
    square = ((sum(a) / 2 - sum(b) / 2) ** 2).mean() - noise
    return math.sqrt(max(square, 0.0)) / (sum(b) / 2).mean()


def in_threads(found, truth):
    """Error of the mean where the first picture of the truth is dark, found by the second ones."""
    chosen, a, b = (blocks(p, 4).mean(2) for p in (truth[0], found[1], truth[1]))
    dark = chosen < numpy.median(chosen)
    return a[dark].mean() / b[dark].mean() - 1


def shown(colours, stops):
    """As sRGB of 8 bits."""
    linear = numpy.clip(colours * 2.0**stops, 0.0, 1.0)
    curve = numpy.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return Image.fromarray((255.0 * curve + 0.5).astype(numpy.uint8))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--size", type=int, default=360, help="pixels of a side")
    parser.add_argument("--spp", type=int, default=256, help="samples a pixel of a seed")
    parser.add_argument("--publish", action="store_true", help="replace docs/back_lit.jpg")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    sheet_size = (len(MODELS) * (given.size + 4) - 4, len(FABRICS) * (given.size + 20) - 4)
    sheet = Image.new("RGB", sheet_size, "white")
    draw = ImageDraw.Draw(sheet)
    print("| cloth, representation | pixels | 8 x 8 | mean | threads | CPU time |")
    print("|---|---|---|---|---|---|")
    for row, (fabric, (_, stops)) in enumerate(FABRICS.items()):
        truth = None
        for column, model in enumerate(MODELS):
            made = [picture(given.folder, fabric, model, seed, given) for seed in (1, 2)]
            found, seconds = [p for p, _ in made], sum(s for _, s in made)
            truth = truth or found
            errors = [f"{100 * error(found, truth, edge):.1f} %" for edge in (1, BLOCK)]
            mean = sum(p.mean() for p in found) / sum(p.mean() for p in truth) - 1
            if found is truth:
                cells = [""] * 4
            else:
                means = [mean, in_threads(found, truth)]
                cells = [*errors, *(f"{100 * m:+.1f} %" for m in means)]
            print(f"| {fabric}, {model} | {' | '.join(cells)} | {seconds:.0f} s |")
            x, y = column * (given.size + 4), row * (given.size + 20)
            draw.text((x + 1, y + 2), f"{fabric}, {model}", fill="black")
            sheet.paste(shown(sum(found) / 2, stops), (x, y + 16))
    sheet.save(given.folder / "back_lit.png")
    if given.publish:
        sheet.save("docs/back_lit.jpg", quality=88, optimize=True)


if __name__ == "__main__":
    main()
