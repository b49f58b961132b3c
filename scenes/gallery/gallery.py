"""Renders the scenes of the gallery, and measures the errors of their pictures.

Each scene is rendered once, as `organza render` does, and denoised. A part of it is rendered again
with another seed and without the cache of radiance, so that each sample is unbiased; the
difference, less the noise of the latter, is the error of the picture (errors.py). Needs Python
3.10 or newer with Pillow, NumPy and OpenEXR, and Open Image Denoise; runs in the root of the
repository:

    python3 -m venv target/gallery_python
    target/gallery_python/bin/pip install pillow numpy OpenEXR==3.5.3 pyoidn==2.5.1.0
    target/gallery_python/bin/python scenes/gallery/gallery.py \\
        --organza target/release/organza --publish

Pictures and figures lie in the folder --work. With --publish they also replace the pictures of the
gallery and the rows of these scenes in benches/runs/gallery.md, from which the tables of
docs/gallery.md and docs/trust.md are written. A scene that was rendered with the same settings is
not rendered again, so an interrupted run goes on where it stopped. Scenes are named by their files
without the ending: `gallery.py denim sail` renders these two. With --old PROGRAM --old-scenes FOLDER
an older program is measured instead, with its own scenes, and stands beside them in the tables.
"""
import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image, ImageDraw

from errors import errors, median_noise

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
RECORD, PAGE = ROOT / "benches/runs/gallery.md", ROOT / "docs/gallery.md"
TRUST = ROOT / "docs/trust.md"
BEGIN, END = "<!-- gallery.py writes from here -->", "<!-- to here -->"
ORDER = [
    "organza", "denim", "charmeuse", "tweed", "plaid", "jersey", "terry",
    "velvet", "stroked", "seam", "lace", "sail", "napkin", "lining", "shirt",
]
CELL, LABEL, GAP, COLUMNS = 256, 16, 4, 4
MOST_BYTES = 300_000
# Samples of a pixel; fewer of cloths among whose hairs a path is long.
SAMPLES = 32
FEWER = {"charmeuse": 24, "tweed": 8, "plaid": 56, "jersey": 8, "terry": 16, "velvet": 16, "stroked": 16, "seam": 6, "sail": 12, "napkin": 16, "shirt": 16}
# Threads as fine as pixels, which a denoiser smears.
NOT_DENOISED = {"charmeuse"}
# Samples of the unbiased part, and its seed.
PROOF_SPP, PROOF_SEED = 64, 2
# Samples of the part by an older program, and its edge.
OLD_SPP, OLD_PX = 16, 128
# The noise of the median pixel to which times are quoted.
NOISE = 0.05


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("scenes", nargs="*", help="names of scenes; without, all of them")
    parser.add_argument("--organza", default="organza", help="the program")
    parser.add_argument("--size", type=int, default=1024, help="pixels of a side")
    parser.add_argument("--spp", type=int, help="samples a pixel, instead of those of each scene")
    parser.add_argument("--proof", type=int, default=256, help="pixels of a side of the part")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--old", type=Path, help="an older program, to be measured as well")
    parser.add_argument("--old-scenes", type=Path, help="the folder of its gallery's scenes")
    parser.add_argument("--work", type=Path, default=Path("target/gallery"))
    parser.add_argument("--publish", action="store_true", help="replace pictures and tables")
    return parser.parse_args()


def inputs(file, found):
    """All files that a scene names, directly or through its fabrics."""
    if file not in found and file.exists():
        found[file] = file.read_bytes()
        if file.suffix == ".toml":
            for name in re.findall(r'"([^"\n]+\.\w+)"', found[file].decode()):
                inputs((file.parent / name).resolve(), found)
    return found


def key(scene, program, samples, given):
    """Identifies what the figures depend on: program, settings and files."""
    digest = hashlib.sha256(program.encode())
    for file, content in sorted(inputs(scene, {}).items()):
        digest.update(file.name.encode() + content)
    digest.update(repr([given.size, samples, given.proof, given.threads]).encode())
    return digest.hexdigest()


def run(words):
    """Runs organza, in whose environment the denoiser of this Python is found; what it printed."""
    environment = {"VIRTUAL_ENV": sys.prefix} | os.environ
    words = [str(word) for word in words]
    done = subprocess.run(
        words, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)}: {done.stderr}")
    return done.stdout


def grey(path, prefix=""):
    """Mean of the three channels of a picture, of which a name may begin so."""
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    values = [np.asarray(channels[prefix + c].pixels, dtype=np.float64) for c in "RGB"]
    if prefix == "variance.":
        # Channels of a path rise and fall together.
        return np.mean(np.sqrt(values), axis=0) ** 2
    return np.mean(values, axis=0)


def middle_of(size, edge):
    """Where a part in the middle begins and ends, and the flag that renders it alone."""
    low = (size - edge) // 2
    return low, low + edge, ["--crop", f"{low},{low},{low + edge},{low + edge}"]


def tracing(known):
    """Seconds of processor of the samples alone; older programs count what is done before."""
    return known["render_cpu_s"] - known.get("prepare_cpu_s", 0)


def old_seconds(name, given):
    """Seconds of processor in which an older program brings the median pixel to NOISE."""
    part = given.work / f"{name}.old.exr"
    known = json.loads(run([
        given.old, "render", given.old_scenes / f"{name}.toml", "-o", part, "--quiet", "--json",
        "--threads", given.threads, "--spp", OLD_SPP, "--seed", PROOF_SEED,
        "--set", f"camera.resolution=[{given.size},{given.size}]", *middle_of(given.size, OLD_PX)[2],
    ]))
    noise = median_noise(grey(part), grey(part, "variance."))
    part.unlink()
    whole = tracing(known) * (given.size / OLD_PX) ** 2
    return known["setup_cpu_s"] + whole * (noise / NOISE) ** 2


def figures(name, program, given):
    """Figures of a scene, which is rendered if they are not kept."""
    scene, record = HERE / f"{name}.toml", given.work / f"{name}.json"
    samples = given.spp or FEWER.get(name, SAMPLES)
    wanted = key(scene, program, samples, given)
    if record.exists():
        kept = json.loads(record.read_text())
        if kept["key"] == wanted:
            return kept
    picture, part = given.work / f"{name}.exr", given.work / f"{name}.part.exr"
    common = [
        given.organza, "render", scene, "--threads", given.threads, "--quiet", "--json",
        "--set", f"camera.resolution=[{given.size},{given.size}]",
    ]
    is_denoised = name not in NOT_DENOISED
    denoise = ["--denoise"] if is_denoised else []
    known = json.loads(run([*common, "-o", picture, "--spp", samples, *denoise]))
    stops = re.search(r"^exposure = (\S+)", scene.read_text(), re.MULTILINE)[1]
    shown = ["-o", given.work / f"{name}.png", f"--exposure={stops}", "--quiet"]
    run([given.organza, "develop", picture, *shown])
    low, high, crop = middle_of(given.size, given.proof)
    unbiased = json.loads(run([
        *common, "-o", part, "--spp", PROOF_SPP, "--seed", PROOF_SEED, "--set",
        'render.cache="off"', *crop,
    ]))
    other, variance = grey(part), grey(part, "variance.")
    middle = np.s_[low:high, low:high]
    noisy = errors(grey(picture, "noisy." if is_denoised else "")[middle], other, variance)
    # Seconds of processor in which unbiased samples bring the median pixel to the same error.
    whole = tracing(unbiased) * (given.size / given.proof) ** 2
    noise = median_noise(other, variance)
    models = re.findall(r'^model = "(\w+)"', scene.read_text(), re.MULTILINE)
    result = {
        "key": wanted,
        "representation": ", ".join(dict.fromkeys(models)) + ("" if known["cache"] else " without cache"),
        "samples": samples,
        "seconds": known["total_s"],
        "setup_cpu_s": known["setup_cpu_s"],
        "render_cpu_s": known["render_cpu_s"],
        "memory_bytes": known["peak_memory_bytes"],
        "cache": known["cache"],
        "noisy": noisy,
        "denoised": errors(grey(picture)[middle], other, variance) if is_denoised else None,
        "unbiased_cpu_s": whole * (noise / noisy["median"]) ** 2 if noisy["median"] > 0 else None,
    }
    record.write_text(json.dumps(result, indent=2))
    part.unlink()
    return result


def write_jpeg(image, path, most_bytes):
    """Writes at the best quality that stays below a size."""
    part = path.with_suffix(".part.jpg")
    for quality in range(92, 20, -4):
        image.save(part, quality=quality, optimize=True, progressive=True)
        if part.stat().st_size < most_bytes:
            break
    part.replace(path)


def sheet(folder, path):
    """All pictures of a folder, with their names."""
    names = [n for n in ORDER if (folder / f"{n}.jpg").exists()]
    rows = -(-len(names) // COLUMNS)
    size = (COLUMNS * (CELL + GAP) + GAP, rows * (CELL + LABEL + GAP) + GAP)
    whole = Image.new("RGB", size, "white")
    draw = ImageDraw.Draw(whole)
    for i, name in enumerate(names):
        x = GAP + i % COLUMNS * (CELL + GAP)
        y = GAP + i // COLUMNS * (CELL + LABEL + GAP)
        with Image.open(folder / f"{name}.jpg") as image:
            whole.paste(image.resize((CELL, CELL), Image.Resampling.LANCZOS), (x, y + LABEL))
        draw.text((x + 1, y + 2), name, fill="black")
    write_jpeg(whole, path, 400_000)


def percent(share):
    return f"{100 * share:.1f} %"


EXPLANATION = """\
*Time* is the wall time of the whole render with what is learned and denoised; the seconds of
processor are those of the set-up and of tracing, learning included. The errors are those of a part
in the middle, by unbiased samples with another seed: of the mean, with its standard error; root
mean square of blocks of 16 x 16 pixels and of pixels over the mean; and of the median pixel over
the value around it, before and after denoising. *Unbiased* is the processor time in which samples
without a cache bring the median pixel of the whole picture to the same error, by their variance;
*old* that in which the program of commit `e9d4afc` brought its own picture to 5 % of median noise.
"""
COLUMNS_OF_RECORD = [
    "scene", "commit", "representation", "samples", "time", "set-up", "tracing", "memory", "mean",
    "16 x 16", "pixel", "median pixel", "denoised", "unbiased", "old",
]


def row(name, commit, f):
    """The row of the record."""
    noisy, seconds = f["noisy"], lambda s: "-" if s is None else f"{s:.0f} s"
    cells = [
        name, f"`{commit}`", f["representation"], f["samples"], seconds(f["seconds"]),
        seconds(f["setup_cpu_s"]), seconds(f["render_cpu_s"]), f"{f['memory_bytes'] / 2**30:.1f} GiB",
        f"{100 * noisy['mean']:+.1f} ± {100 * noisy['mean_error']:.1f} %", percent(noisy["block"]),
        percent(noisy["pixel"]), percent(noisy["median"]),
        percent(f["denoised"]["median"]) if f["denoised"] else "-",
        seconds(f["unbiased_cpu_s"]), "-",
    ]
    return dict(zip(COLUMNS_OF_RECORD, map(str, cells)))


def kept_rows():
    """The rows that stand in the record, by scene."""
    block = RECORD.read_text().split(BEGIN, 1)[1].split(END, 1)[0]
    lines = [line for line in block.splitlines() if line.startswith("| ")]
    cells = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]
    rows = (dict(zip(cells[0], line)) for line in cells[1:])
    return {row["scene"]: row for row in rows}


def markdown(columns, rows):
    lines = [columns, ["---"] * len(columns), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines).replace("| --- |", "|---|").replace(
        " --- |", "---|"
    )


def number(cell):
    """The first number of a cell; none where nothing was measured."""
    found = re.search(r"[-+]?\d+(\.\d+)?", cell)
    return float(found[0]) if found else None


def page_table(rows, given):
    """What docs/gallery.md says about the figures."""
    lines = [
        f"The pictures have {given.size} x {given.size} pixels; they are rendered on {given.threads} threads, and most are denoised ([Denoising](denoise.md)).",
        "The [record](../benches/runs/gallery.md) explains the figures; 0 stands where unbiased samples",
        "found none.",
        "",
    ]
    columns = ["scene", "samples", "time", "error of the median pixel", "denoised"]
    cells = [[r["scene"], r["samples"], r["time"], r["median pixel"], r["denoised"]] for r in rows]
    return "\n".join(lines) + "\n" + markdown(columns, cells)


def to_noise(seconds):
    """A time to a stated noise, in a unit that a reader can picture."""
    if seconds is None:
        return "-"
    minutes = seconds / 60
    return f"{minutes:.0f} min" if minutes < 100 else f"{minutes / 60:.0f} h"


def trust_table(rows):
    """What docs/trust.md says: times to one noise, and what the cache costs in truth."""
    columns = ["scene", "`e9d4afc`", "no cache", "cache", "mean", "16 x 16", "memory"]
    lines = []
    for r in rows:
        median, unbiased = number(r["median pixel"]) / 100, number(r["unbiased"])
        longer = (median / NOISE) ** 2
        without = None if unbiased is None else number(r["set-up"]) + unbiased * longer
        cached = number(r["set-up"]) + number(r["tracing"]) * longer
        of_cache = [to_noise(cached), r["mean"], r["16 x 16"]]
        if r["representation"] != "fibres":
            of_cache = ["-"] * 3
        lines.append([r["scene"], to_noise(number(r["old"])), to_noise(without), *of_cache, r["memory"]])
    return markdown(columns, lines)


def replace_block(path, block):
    """Replaces what stands between the markers of a page."""
    head, rest = path.read_text().split(BEGIN, 1)
    tail = rest.split(END, 1)[1]
    part = path.with_suffix(".part")
    part.write_text(f"{head}{BEGIN}\n\n{block}\n{END}{tail}")
    part.replace(path)


def checked_out_commit():
    git = ["git", "-C", ROOT, "rev-parse", "--short=7", "HEAD"]
    return subprocess.run(git, stdout=subprocess.PIPE, text=True, check=True).stdout.strip()


def publish(all_figures, program, given):
    """Replaces the pictures and the tables of the repository."""
    built = re.search(r"^commit: ([0-9a-f]{7})", program, re.MULTILINE)
    commit = built[1] if built else checked_out_commit()
    for name in all_figures:
        with Image.open(given.work / f"{name}.png") as image:
            write_jpeg(image.convert("RGB"), HERE / f"pictures/{name}.jpg", MOST_BYTES)
    sheet(HERE / "pictures", HERE / "gallery.jpg")
    rows = kept_rows()
    for name, found in all_figures.items():
        old = rows.get(name, {}).get("old", "-")
        rows[name] = row(name, commit, found) | {"old": old}
    write_tables(rows, given)


def write_tables(rows, given):
    """The record, and the tables that are made of it."""
    rows = [rows[name] for name in ORDER if name in rows]
    cells = [[r[column] for column in COLUMNS_OF_RECORD] for r in rows]
    replace_block(RECORD, f"{EXPLANATION}\n{markdown(COLUMNS_OF_RECORD, cells)}")
    replace_block(PAGE, page_table(rows, given))
    replace_block(TRUST, trust_table(rows))


def main():
    given = arguments()
    unknown = [n for n in given.scenes if n not in ORDER]
    if unknown:
        sys.exit(f"unknown scenes: {', '.join(unknown)}; there are: {', '.join(ORDER)}")
    given.work.mkdir(parents=True, exist_ok=True)
    if given.old:
        for name in given.scenes or ORDER:
            rows = kept_rows()
            rows[name]["old"] = f"{old_seconds(name, given):.0f} s"
            write_tables(rows, given)
            print(name, rows[name]["old"], flush=True)
        return
    program = run([given.organza, "--version", "--verbose"])
    all_figures, failures = {}, []
    for name in given.scenes or ORDER:
        try:
            all_figures[name] = figures(name, program, given)
        except RuntimeError as error:
            failures.append(name)
            print(f"{name}: {error}", file=sys.stderr, flush=True)
            continue
        print(f"| {' | '.join(row(name, '-', all_figures[name]).values())} |", flush=True)
    if given.publish and all_figures:
        publish(all_figures, program, given)
    if failures:
        sys.exit(f"not rendered: {', '.join(failures)}")


if __name__ == "__main__":
    main()
