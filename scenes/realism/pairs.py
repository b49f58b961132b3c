"""Renders small cloths without and with one ingredient, by the light of realism.toml, and puts the
pictures side by side in pairs.jpg. Prints what the ingredient costs: seconds of processor
before the denoiser, and the most memory.

    python3 scenes/realism/pairs.py [--organza ORGANZA] [--spp N] [--denoise] [--only LABEL]
    python3 scenes/realism/pairs.py --sheet fibres    blends of materials and crimp: fibres.jpg
    python3 scenes/realism/pairs.py --sheet pile_pairs    tufts that collide, ruffle, crushed velvet
    python3 scenes/realism/pairs.py --sheet making        seams, creases, fringes, dye, lost threads

Needs Pillow, and the library of `organza denoise` for --denoise.
"""
import argparse
import json
import subprocess
import tempfile
from pathlib import Path

from PIL import Image, ImageDraw

HERE = Path(__file__).parent
SIZE, COLUMNS, LABEL, GAP = (230, 172), 4, 15, 4
FABRIC = """
name = "pair"
[draft]
weave = "{weave}"
[tile]
repeats = [{repeats}, {repeats}]
[warp]
yarn = "end"
per_cm = {per_cm}
colours = [{colour}]
{warp}
[weft]
yarn = "pick"
per_cm = {per_cm}
colours = [{weft_colour}]
{weft}
[yarn.end]
preset = "{preset}"
tex = {tex}
{yarn}
{end}
[yarn.pick]
preset = "{preset}"
tex = {tex}
{yarn}
[voxel]
size_um = 20.0
{tables}
"""
ECRU, INDIGO = "[0.55, 0.50, 0.42]", "[0.030, 0.048, 0.12]"
COTTON = dict(weave="plain", repeats=4, per_cm=22, preset="cotton", tex=30, warp="", weft="", yarn="", end="",
              tables="", colour=ECRU, weft_colour=ECRU)
SPUN = 'irregularity = "ring-spun cotton"'
FINE = {"tex": 20, "repeats": 6}
DENSE = {"per_cm": 25, "repeats": 5}
DENIM = {"weave": "twill-3-1-z", "per_cm": 24, "repeats": 3, "colour": INDIGO,
         "yarn": "wander = { amplitude = 0.16, length_mm = 0.6 }\nfibre_radius_cv_percent = 20.0"}
BEAN = '[optics."*"]\nsection = "bean"'
SATIN = {"weave": "satin-5-2", "repeats": 2, "per_cm": 26}
DARK = {"colour": "[0.12, 0.14, 0.16]", "weft_colour": "[0.12, 0.14, 0.16]"}


def finished(name):
    return {"yarn": SPUN + f'\nfinish = "{name}"'}


VELVET = ('[pile]\nkind = "cut"\nyarn = "pile"\nheight_mm = 1.1\nheight_cv_percent = 4.0\nevery = [2, 2]\n'
          'colours = [[0.36, 0.05, 0.07]]\nlean_deg = 22.0\nlean_direction_deg = 0.0\nlean_deviation_deg = 9.0\n'
          '[yarn.pile]\npreset = "rayon"\nkind = "filament"\ntex = 45.0')
# Label, what both cloths have, what only the second one has, and the angle of view in degrees.
PAIRS = [
    ("uneven threads", FINE, {"yarn": "evenness = { mass_cv_percent = 24.0 }",
                              "warp": "spacing_cv_percent = 12.0", "weft": "spacing_cv_percent = 12.0"}, 14),
    ("slubs", FINE, {"yarn": "slubs = { per_m = 90.0, length_mm = [3.0, 1.0], mass = [2.1, 0.1] }"}, 14),
    ("uneven, wandering fibres", DARK, {"yarn": "fibre_radius_cv_percent = 22.0\n"
                                      "wander = { amplitude = 0.2, length_mm = 0.6 }"}, 6),
    ("protruding fibres", {"yarn": "hairs = { per_mm = 0.0 }\nloops = { per_mm = 0.0 }"},
     {"yarn": "hairiness = { index = 6.0, length_mm = 1.0, reach_mm = 0.4, curl_mm = 0.5, returning = 0.4 }"}, 8),
    ("flattening", SATIN, {"yarn": "flattening = { crossing = 1.5, float = 0.8 }"}, 8),
    ("threads wander sideways", FINE, {"warp": "wander = { amplitude_um = 55.0, length_mm = 3.0 }"}, 14),
    ("reed marks", FINE, {"warp": "reed_dents = { ends = 2, gap_percent = 45.0 }"}, 14),
    ("ring dye", DENIM, {"end": "ring_dye = { core_colour = [0.42, 0.42, 0.39], depth = 0.4 }"}, 7),
    ("blend (melange)", DENSE | {"yarn": SPUN},
     {"yarn": SPUN + "\nblend = [{ share = 3.0 }, { share = 1.2, colour = [0.10, 0.11, 0.13] }, "
      "{ share = 0.5, colour = [0.42, 0.09, 0.05] }]"}, 8),
    ("print", DENSE | {"repeats": 6}, {"tables": '[print]\nimage = "roses.png"'}, 17),
    ("section: bean", DENSE | DARK, {"tables": BEAN}, 8),
    ("section: trilobal", {"preset": "polyester"} | DARK, {"tables": '[optics."*"]\nsection = "trilobal"'}, 8),
    ("finish: singed", {"yarn": SPUN}, finished("singed"), 8),
    ("finish: raised", {"yarn": SPUN}, finished("raised"), 8),
    ("finish: calendered", {"yarn": SPUN}, finished("calendered"), 8),
    ("finish: mercerised", DENSE | DARK | {"yarn": SPUN, "tables": BEAN}, finished("mercerised"), 8),
    ("finish: brushed", {"yarn": SPUN}, finished("brushed"), 8),
    ("pile", {}, {"tables": VELVET}, 16),
]

WOOL = {"preset": "wool", "tex": 60, "per_cm": 13, "repeats": 2}
FILAMENT = ('kind = "filament"\nfibre_volume_fraction = 0.35\nfibre_radius_um = 9.0\n'
            'twist = { direction = "Z", turns_per_m = 120.0 }')
FLECKS = ('irregularity = "woollen"\nblend = [{ share = 8.0 }, { share = 2.0, colour = [0.16, 0.15, 0.14] }, '
          '{ share = 0.8, colour = [0.45, 0.16, 0.05] }, { share = 0.6, colour = [0.06, 0.12, 0.24] }]')
DONEGAL = WOOL | {"tex": 190, "per_cm": 8.5, "repeats": 6, "yarn": 'irregularity = "woollen"',
                  "colour": "[0.055, 0.055, 0.06]", "weft_colour": "[0.20, 0.19, 0.18]"}
FLANNEL = WOOL | {"weave": "twill-2-2", "per_cm": 14, "repeats": 4, "yarn": 'irregularity = "woollen"',
                  "colour": "[0.22, 0.22, 0.23]", "weft_colour": "[0.09, 0.09, 0.10]"}
PILLED = WOOL | {"weave": "twill-2-2", "tex": 60, "per_cm": 15, "repeats": 5, "yarn": 'irregularity = "worsted wool"',
                 "colour": "[0.05, 0.09, 0.20]", "weft_colour": "[0.05, 0.09, 0.20]"}
# Pairs of the second sheet.
FIBRES = [
    ("heather of dyed and undyed wool", WOOL | {"colour": "[0.10, 0.13, 0.20]", "weft_colour": "[0.10, 0.13, 0.20]"},
     {"yarn": "blend = [{ share = 3.0 }, { share = 2.0, fibre = \"undyed\", fibre_radius_um = 16.0, "
      "fibre_density_g_per_cm3 = 1.31, colour = [0.62, 0.56, 0.44] }]"}, 7),
    ("wool and nylon", WOOL | DARK,
     {"yarn": 'blend = [{ mass_share = 70.0, fibre = "wool" }, { mass_share = 30.0, fibre = "nylon", '
      'colour = [0.75, 0.75, 0.72] }]', "tables": '[[optics."*"]]\nfibre = "nylon"\nsection = "trilobal"\n'
      'longitudinal_deg = 3.0'}, 7),
    ("crimp: textured filament", {"preset": "polyester", "tex": 40, "per_cm": 14, "yarn": FILAMENT} | DARK,
     {"yarn": FILAMENT + "\ncrimp = { per_cm = 14.0, amplitude_um = 48.0 }"}, 4.5),
    ("tufts of colour in a blend", WOOL | {"tex": 110, "per_cm": 10, "repeats": 4, "yarn": FLECKS}
     | {"colour": "[0.06, 0.06, 0.06]", "weft_colour": "[0.06, 0.06, 0.06]"},
     {"yarn": FLECKS + "\nblend_tufts = { fibres = 25.0, length_mm = 4.0 }"}, 12),
    ("neps", DONEGAL, {"yarn": DONEGAL["yarn"] + "\nneps = { per_m = 100.0, size_mm = [1.1, 0.3], colours = "
                      "[[0.42, 0.26, 0.08], [0.34, 0.06, 0.05], [0.50, 0.46, 0.37], [0.05, 0.17, 0.21]] }"}, 24),
    ("pills", PILLED, {"tables": "[wear]\npills = { per_cm2 = 7.0, size_mm = [1.0, 0.35] }"}, 20),
    ("fulling", FLANNEL, {"yarn": FLANNEL["yarn"] + "\nfulling = 0.7"}, 12),
    ("wear", DENIM, {"tables": "[wear]\namount = 0.9\ndepth_um = 90.0\ncolour = [0.3, 0.31, 0.31]"}, 7),
]

TERRY = {"repeats": 6, "per_cm": 14, "colour": "[0.34, 0.315, 0.28]", "weft_colour": "[0.34, 0.315, 0.28]", "yarn": ""}
LOOPS = ('[pile]\nkind = "loop"\nyarn = "pile"\nevery = [1, 2]\nheight_mm = 2.4\nheight_cv_percent = 8.0\n'
         'colours = [[0.34, 0.315, 0.28]]\nlean_deg = 8.0\nlean_deviation_deg = 16.0\nturn_deg = 35.0\n{}\n'
         '[yarn.pile]\npreset = "cotton"\ntex = 59.0\nfibre_volume_fraction = 0.32')
STROKED = {"scene": "../gallery/stroked.toml", "sets": ["object.0.stroke=[]"]}
CRUSHED = STROKED["sets"] + ["object.0.crush={ lean_deg = 50.0, size_mm = 7.0, seed = 1 }"]
PILE = [
    ("loops collide, ruffle", TERRY | {"tables": LOOPS.format("")},
     {"tables": LOOPS.format("collide = true\nruffle_deg = 28.0\nruffle_mm = 2.5")}, 16),
    ("cut tufts collide", {"tables": VELVET}, {"tables": VELVET.replace("[yarn.pile]", "collide = true\n[yarn.pile]")}, 16),
    ("stroked", STROKED, {"sets": []}, 26),
    ("crushed", STROKED, {"sets": CRUSHED}, 26),
]


def scene(name, without, within=(), frame=()):
    """A scene of the gallery, without and with something, and settings of both."""
    file = f"../gallery/{name}.toml"
    return {"scene": file, "sets": [*frame, *without]}, {"sets": [*frame, *within]}


def looking(x, y, z):
    return f"camera.target_mm=[{x}, {y}, {z}]"


NAVY = DENSE | {"colour": "[0.03, 0.04, 0.10]", "weft_colour": "[0.03, 0.04, 0.10]", "repeats": 6}
HOLES = [f"object.{o}.stitch.{row}.hole_mm=0.0" for o in (0, 1) for row in (0, 1)]
SELVEDGE = 'object.0.fringe=[{ from_mm = [139.0, 50.0], to_mm = [141.0, 150.0], keep = "weft", turn = true }]'
MAKING = [
    ("seam", *scene("seam", ["object.0.stitch=[]"]), 16),
    ("holes of the needle", *scene("sail", HOLES), 5),
    ("crease", *scene("napkin", ["object.0.crease=[]"], frame=[looking(0, 4, -1)]), 7),
    ("fringe", *scene("napkin", ["object.0.fringe=[]"], frame=[looking(0, 33, 0)]), 9),
    ("selvedge", *scene("napkin", ["object.0.fringe=[]"], [SELVEDGE], [looking(37, 0, 0)]), 4),
    ("missing threads", FINE, {"warp": "missing = [4]", "weft": "missing = [7]"}, 14),
    ("dye of the piece", DENSE, {"tables": "[print]\ncolour = [0.30, 0.04, 0.07]\nside = \"both\""}, 8),
    ("discharge", NAVY, {"tables": '[print]\nimage = "roses.png"\nmode = "discharge"'}, 17),
]


def render(cloth, fov_deg, folder, options):
    file, picture = folder / "fabric.toml", folder / "cell.png"
    file.write_text(FABRIC.format(**cloth))
    scene, own = cloth.get("scene"), f'object.1.fabric="{file}"'
    sets = cloth["sets"] if scene else [own]
    sets = [*sets, f"camera.fov_deg={fov_deg}", f"camera.resolution={list(SIZE)}"]
    sets = [word for one in sets for word in ("--set", one)]
    command = [options.organza, "render", HERE / (scene or "realism.toml"), "-o", picture, "--quiet", "--json",
               "--spp", str(options.spp), "--threads", str(options.threads)]
    words = [*command, *sets, *(["--denoise"] if options.denoise else [])]
    known = json.loads(subprocess.run(words, check=True, stdout=subprocess.PIPE).stdout)
    with Image.open(picture) as cell:
        return cell.convert("RGB"), known["setup_cpu_s"] + known["render_cpu_s"], known["peak_memory_bytes"] / 2**20


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--organza", default="organza")
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--denoise", action="store_true")
    parser.add_argument("--only", help="pairs whose label holds this")
    parser.add_argument("--sheet", choices=["pairs", "fibres", "pile_pairs", "making"], default="pairs")
    parser.add_argument("-o", "--outfile", type=Path, help="SHEET.jpg without it")
    options = parser.parse_args()
    sheet_of = {"pairs": PAIRS, "fibres": FIBRES, "pile_pairs": PILE, "making": MAKING}[options.sheet]
    pairs = [pair for pair in sheet_of if options.only is None or options.only in pair[0]]
    rows = -(-len(pairs) * 2 // COLUMNS)
    (width, height) = SIZE
    sheet = Image.new("RGB", (COLUMNS * (width + GAP) + GAP, rows * (height + LABEL + GAP) + GAP), "white")
    draw = ImageDraw.Draw(sheet)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "roses.png").write_bytes((HERE / "../fabrics/print/roses.png").read_bytes())
        for i, (label, both, added, fov_deg) in enumerate(pairs):
            off = COTTON | both
            costs = []
            for j, (word, cloth) in enumerate([("without", off), (label, off | added)]):
                cell = 2 * i + j
                x = GAP + cell % COLUMNS * (width + GAP)
                y = GAP + cell // COLUMNS * (height + LABEL + GAP)
                picture, *cost = render(cloth, fov_deg, folder, options)
                costs.append(cost)
                sheet.paste(picture, (x, y + LABEL))
                draw.text((x + 1, y + 1), word, fill="black")
            (off_s, off_mib), (on_s, on_mib) = costs
            print(f"{label}: {off_s:.1f} to {on_s:.1f} s ({100 * on_s / off_s - 100:+.0f} %), "
                  f"{off_mib:.0f} to {on_mib:.0f} MiB ({100 * on_mib / off_mib - 100:+.0f} %)", flush=True)
    sheet.save(options.outfile or HERE / f"{options.sheet}.jpg", quality=78)


if __name__ == "__main__":
    main()
