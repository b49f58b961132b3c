"""Measures all fabrics with organza and prints the tables of docs/trust.md as Markdown.

    python3 benches/fabric_tables.py reports DIR [--spp N] [--texels N] [FABRIC ...]
    python3 benches/fabric_tables.py voxels DIR [--spp N]
    python3 benches/fabric_tables.py packed DIR [--spp N] [FABRIC ...]
    python3 benches/fabric_tables.py hybrid DIR [--events K] [--weight W] [--spp N] [FABRIC ...]
    python3 benches/fabric_tables.py models DIR [--spp N] [FABRIC ...]
    python3 benches/fabric_tables.py levels DIR [--spp N] [FABRIC ...]

`reports` fits the surface of every fabric to its volume (with eight times the paths, as
the noise of the volume adds to the error of the fit) and compares all models of it:
DIR/FABRIC.toml and DIR/FABRIC/report.html. `voxels` measures reflection and transmission
of volumes by voxel size against explicit fibres. `packed` measures reflection, scattered
and direct transmission of packed fibres in voxels of their default size, `hybrid` those of
explicit fibres for the first K events of a path, or while it carries at least the share W, and
of packed ones after them, and `models` those of
explicit fibres, plain virtual scattering and micro-flakes under light at 60 degrees. `levels`
measures packed and plain fibres at the levels 0 to 3 against explicit fibres. Files that
are there already are not made again. ORGANZA names the program, THREADS the number of threads.
"""

import argparse
import csv
import json
import os
import pathlib
import subprocess

FABRICS = """denim cotton_twill wool_gabardine polyester_lining charmeuse silk_shantung
    organza linen jersey wool_tweed""".split()
FIBRE_MODELS = ["fibres", "packed", "plain", "volume"]
# Edges of voxels in micrometres.
VOXELS = {
    "organza": [3, 6, 12, 24],
    "linen": [10, 20, 40, 80],
    "denim": [10, 20, 40, 80],
    "wool_tweed": [10, 20, 40, 80],
}


def organza(made, *arguments):
    """Runs the program unless the file it makes is there."""
    if made.exists():
        return
    program = os.environ.get("ORGANZA", "target/release/organza")
    threads = os.environ.get("THREADS")
    more = ["--threads", threads] if threads else []
    subprocess.run([program, *map(str, arguments), "--quiet", *more], check=True)


def print_table(first, columns, rows):
    """A table in Markdown: a name and a cell for every column in each row."""
    print("| " + " | ".join([first, *columns]) + " |")
    print("|---" * (1 + len(columns)) + "|")
    for name, cells in rows:
        print("| " + " | ".join([name, *cells]) + " |")
    print()


def percent(figure):
    return f"{100 * figure['value']:.1f} %"


def green(report, model):
    """R, T, direct transmission of green light at 60 degrees along the weft."""
    measured = next(m for m in report["measured"] if m["model"] == model)
    at = [a for a in measured["albedo"] if round(a["incident"]["theta_deg"]) == 60]
    return [at[0][part]["mean"][1] for part in ("reflected", "transmitted", "direct")]


def within(report, model, limits):
    """Channels of all directions within limits, and how many have any."""
    by_model = {m["model"]: m["albedo"] for m in report["measured"]}
    good = total = 0
    for a, truth in zip(by_model[model], by_model["fibres"]):
        for c in range(3):
            limit = limits(truth, c)
            if limit is None:
                continue
            part, allowed = limit
            noise = 2 * (a[part]["se"][c] ** 2 + truth[part]["se"][c] ** 2) ** 0.5
            total += 1
            good += abs(a[part]["mean"][c] - truth[part]["mean"][c]) <= allowed + noise
    return f"{good} of {total}" if total else "-"


def reflection(truth, c):
    return "reflected", max(0.005, 0.05 * truth["reflected"]["mean"][c])


def transmission(truth, c):
    value = truth["transmitted"]["mean"][c]
    return ("transmitted", 0.05 * value) if value > 0.1 else None


def surface_errors(report):
    """Median error, 80th percentile, bias and noise of the fitted surface."""
    d = next(d for d in report["differences"] if d["model"] == "surface")["layout"]
    figures = [percent(d[key]) for key in ("median", "percentile_80", "bias")]
    return [*figures, f"{100 * d['noise_median']:.1f} %"]


def make_reports(folder, fabrics, spp, texels):
    for name in fabrics:
        fitted, report = folder / f"{name}.toml", folder / name / "report.json"
        journal = ["--journal", folder / f"{name}.journal"]
        fabric = f"scenes/fabrics/{name}.toml"
        organza(fitted, "fit", "surface", fabric, "-o", fitted, "--spp", 8 * spp, *journal)
        models = ["--models", "volume,surface,fibres,packed,plain"]
        pictures = ["--texels", texels, "--texel-spp", 32]
        organza(report, "compare", fitted, "-o", report.parent, "--spp", spp, *models, *pictures)
    reports = [json.loads((folder / n / "report.json").read_text()) for n in fabrics]
    print_table(
        "surface fitted to the volume",
        ["median error", "80th percentile", "bias", "noise alone"],
        [(r["name"], surface_errors(r)) for r in reports],
    )
    values = {m: (lambda r, m=m: ", ".join(f"{v:.3f}" for v in green(r, m))) for m in FIBRE_MODELS}
    print_table(
        "R, T, direct (green, 60 degrees)",
        FIBRE_MODELS,
        [(r["name"], [values[m](r) for m in FIBRE_MODELS]) for r in reports],
    )
    print_table(
        "within the limits",
        [f"{m}: R, T" for m in FIBRE_MODELS[1:]],
        [
            (
                r["name"],
                [
                    ", ".join(within(r, m, limits) for limits in (reflection, transmission))
                    for m in FIBRE_MODELS[1:]
                ],
            )
            for r in reports
        ],
    )


def mean_green(path):
    """Mean over the directions of R and scattered T, green."""
    with path.open() as file:
        rows = list(csv.DictReader(file))
    keys = ("reflected_g", "transmitted_g")
    return ", ".join(f"{sum(float(r[k]) for r in rows) / len(rows):.3f}" for k in keys)


def make_voxels(folder, spp):
    incident = folder / "incident.csv"
    incident.write_text("theta_i,phi_i\n0,0\n60,0\n60,90\n")

    def measured(name, model, um=None):
        path = folder / ".".join([name, model, *([str(um)] if um else []), "csv"])
        voxels = ["--voxel-um", um] if um else []
        organza(
            path, "measure", f"scenes/fabrics/{name}.toml", "--albedo", "--pairs", incident,
            "--spp", spp, "--model", model, "-o", path, *voxels,
        )  # fmt: skip
        return mean_green(path)

    models, rows = FIBRE_MODELS[1:], []
    for name, sizes in VOXELS.items():
        truth = measured(name, "fibres")
        for um in sizes:
            rows.append((f"{name}, {um} um", [truth, *(measured(name, m, um) for m in models)]))
    print_table("fabric, voxel", FIBRE_MODELS, rows)


# Polar angle and azimuth of the light, degrees: along the weft, the warp, between them.
LIGHTS = [(0, 0), (45, 0), (60, 0), (60, 45), (60, 90), (75, 0)]
PARTS = ["reflected", "transmitted", "direct"]


def off_by(row, truth, part):
    """The green value of explicit fibres, the error of packed ones and its standard error."""
    a, b = (float(r[f"{part}_g"]) for r in (row, truth))
    se = sum(float(r[f"se_{part}_g"]) ** 2 for r in (row, truth)) ** 0.5
    if b < 0.003:
        return f"{b:.4f}, {a - b:+.4f} ± {se:.4f}"
    return f"{b:.4f}, {100 * (a / b - 1):+.1f} ± {100 * se / b:.1f} %"


def make_packed(folder, fabrics, spp, keys=()):
    name_of_packed = ".".join(["packed", *keys])
    keys = [f"--set=scattering.{key}" for key in keys]
    incident = folder / "lights.csv"
    incident.write_text("theta_i,phi_i\n" + "".join(f"{t},{p}\n" for t, p in LIGHTS))
    rows = []
    for name in fabrics:
        by_model = {}
        for seed, model in enumerate(["fibres", "packed"]):
            shown = model if model == "fibres" else name_of_packed
            path = folder / f"{name}.{shown}.csv"
            organza(
                path, "measure", f"scenes/fabrics/{name}.toml", "--albedo", "--pairs", incident,
                "--spp", spp, "--model", model, "--seed", seed, "-o", path,
                *(keys if model == "packed" else []),
            )  # fmt: skip
            with path.open() as file:
                by_model[model] = list(csv.DictReader(file))
        for light, row, truth in zip(LIGHTS, by_model["packed"], by_model["fibres"]):
            cells = [off_by(row, truth, part) for part in PARTS]
            rows.append((f"{name} {light[0]}:{light[1]}", cells))
    print_table("fabric, light", ["R", "T scattered", "T direct"], rows)


def make_models(folder, fabrics, spp):
    incident = folder / "sixty.csv"
    incident.write_text("theta_i,phi_i\n60,0\n")
    models, rows, largest = ["fibres", "plain", "microflake"], [], 0.0
    for name in fabrics:
        cells = []
        for seed, model in enumerate(models):
            path = folder / f"{name}.{model}.sixty.csv"
            organza(
                path, "measure", f"scenes/fabrics/{name}.toml", "--albedo", "--pairs", incident,
                "--spp", spp, "--model", model, "--seed", seed, "-o", path,
            )  # fmt: skip
            with path.open() as file:
                row = next(csv.DictReader(file))
            cells.append(", ".join(f"{float(row[f'{part}_g']):.3f}" for part in PARTS))
            largest = max(largest, *(float(row[f"se_{part}_g"]) for part in PARTS))
        rows.append((name, cells))
    print_table("R, T scattered, T direct", models, rows)
    print(f"largest standard error {largest:.4f}")


def make_levels(folder, fabrics, spp):
    incident = folder / "lights.csv"
    incident.write_text("theta_i,phi_i\n" + "".join(f"{t},{p}\n" for t, p in LIGHTS))

    def measured(name, model, seed, *level):
        path = folder / ".".join([name, model, *map(str, level[1:]), "levels.csv"])
        organza(
            path, "measure", f"scenes/fabrics/{name}.toml", "--albedo", "--pairs", incident,
            "--spp", spp, "--model", model, "--seed", seed, "-o", path, *level,
        )  # fmt: skip
        with path.open() as file:
            return list(csv.DictReader(file))

    def cell(rows, truths, part):
        values = [tuple(float(r[f"{part}_g"]) for r in pair) for pair in zip(rows, truths)]
        total = sum(b for _, b in values)
        bias = sum(a - b for a, b in values) / total
        squares = sum((a - b) ** 2 for a, b in values) / sum(b * b for _, b in values)
        noise = sum(float(r[f"se_{part}_g"]) ** 2 for r in [*rows, *truths]) ** 0.5 / total
        return f"{100 * squares**0.5:.1f} %, {100 * bias:+.1f} ± {100 * noise:.1f} %"

    rows = []
    for name in fabrics:
        truths = measured(name, "fibres", 0)
        for model in ["packed", "plain"]:
            for level in range(4):
                found = measured(name, model, 1, "--level", level)
                cells = [cell(found, truths, part) for part in PARTS]
                rows.append((f"{name}, {model}, {level}", cells))
    print_table("fabric, model, level", ["R", "T scattered", "T direct"], rows)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["reports", "voxels", "packed", "hybrid", "models", "levels"])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("fabrics", nargs="*", default=FABRICS)
    parser.add_argument("--spp", type=int, help="paths a pair or direction")
    parser.add_argument("--events", type=int, help="first events of hybrid fibres")
    parser.add_argument("--weight", type=float, help="while_weight of hybrid fibres")
    parser.add_argument("--texels", type=int, default=96)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    if given.what == "reports":
        make_reports(given.folder, given.fabrics, given.spp or 1024, given.texels)
    elif given.what == "packed":
        make_packed(given.folder, given.fabrics, given.spp or 60_000)
    elif given.what == "hybrid":
        keys = [f"first_events={given.events}"] if given.events is not None else []
        keys += [f"while_weight={given.weight}"] if given.weight is not None else []
        make_packed(given.folder, given.fabrics, given.spp or 60_000, keys or ["first_events=1"])
    elif given.what == "models":
        make_models(given.folder, given.fabrics, given.spp or 60_000)
    elif given.what == "levels":
        make_levels(given.folder, given.fabrics, given.spp or 60_000)
    else:
        make_voxels(given.folder, given.spp or 65536)


if __name__ == "__main__":
    main()
