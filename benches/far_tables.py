"""Makes far-field tables and prints the figures of docs/far_tables.md.

    python3 benches/far_tables.py errors DIR [FABRIC...]   errors at held-out pairs
    python3 benches/far_tables.py drape DIR                draped denim by table, surface, fibres

Tables that are there already are not made again. ORGANZA names the program, THREADS the number
of threads. `drape` needs numpy and OpenEXR.
"""

import json
import os
import pathlib
import shutil
import subprocess
import sys

FABRICS = ["denim", "charmeuse", "organza", "towel", "polyester_lining"]
KINDS = ["reflected", "transmitted", "reflected_grazing", "transmitted_grazing"]
PATHS = ["--held-out", "128", "--held-out-spp", "65536"]


def organza(*arguments):
    """Runs the program and returns what it prints."""
    program = os.environ.get("ORGANZA", "target/release/organza")
    threads = os.environ.get("THREADS", "1")
    command = [program, *map(str, arguments), "--threads", threads]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def table(folder, fabric):
    """The description of a fabric's table, made beside a copy of the fabric."""
    scenes = folder / "scenes"
    if not scenes.exists():
        shutil.copytree("scenes", scenes)
    path = scenes / "fabrics" / f"{fabric}.toml"
    made = path.with_suffix(".bsdf")
    if not made.exists():
        organza("table", path, "-o", made, "--journal", folder / f"{fabric}.journal", *PATHS)
    return json.loads(organza("info", made, "--json"))


def errors(folder, fabrics):
    """Errors of tables and surface models at the held-out pairs."""
    print("| fabric | " + " | ".join(k.replace("_", ", ") for k in KINDS) + " |")
    for fabric in fabrics or FABRICS:
        about = table(folder, fabric)
        for name, key in [("table", "errors"), ("surface model", "errors_of_surface_model")]:
            by_kind = {e["kind"]: e for e in about.get(key, [])}
            cells = []
            for kind in KINDS:
                e = by_kind.get(kind)
                shares = (f"{100 * e[x]:.1f}" for x in ("rms", "worst")) if e else ()
                cells.append(" %, ".join(shares) + " %" if e else "")
            print(f"| {fabric}, {name} | " + " | ".join(cells) + " |")


def drape(folder):
    """Mean of the cloth's pixels, and the error of blocks of pixels, against explicit fibres."""
    import numpy
    import OpenEXR

    table(folder, "denim")
    text = pathlib.Path("scenes/towel.toml").read_text()
    text = text.replace("fabrics/towel", "fabrics/denim")
    pictures = {}
    for model in ("fibres", "table", "surface"):
        scene = folder / "scenes" / f"draped_{model}.toml"
        scene.write_text(text.replace('lod = "auto"', f'model = "{model}"'))
        made = folder / f"{model}.exr"
        if not made.exists():
            small = ["--set", "camera.resolution=[320,320]", "--set", "camera.fov_deg=26"]
            organza("render", scene, "-o", made, "--spp", 32, *small)
        channels = OpenEXR.File(str(made)).channels()
        depth = numpy.asarray(channels["depth_mm"].pixels).reshape(320, 320)
        pictures[model] = numpy.asarray(channels["RGB"].pixels)[..., :3]
        if model == "fibres":
            cloth = numpy.isfinite(depth)

    def blocks(x):
        return x.reshape(16, 20, 16, 20, -1).mean((1, 3))

    truth = pictures["fibres"]
    inside = blocks(cloth[..., None].astype(float))[..., 0] > 0.99
    for model in ("table", "surface"):
        picture = pictures[model]
        change = picture[cloth].mean(0) / truth[cloth].mean(0) - 1
        apart = (blocks(picture) - blocks(truth))[inside]
        rms = numpy.sqrt((apart**2).mean() / (blocks(truth)[inside] ** 2).mean())
        print(model, "mean", [f"{100 * c:+.1f} %" for c in change], f"blocks {100 * rms:.1f} %")


def main():
    what, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    if what == "errors":
        errors(folder, sys.argv[3:])
    elif what == "drape":
        drape(folder)
    else:
        sys.exit(__doc__)


main()
