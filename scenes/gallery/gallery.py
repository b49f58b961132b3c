"""Renders the scenes of the gallery and writes their pictures, a sheet of all of them and the
table of their times and noise. Needs Python with Pillow; runs in the root of the repository:

    python3 scenes/gallery/gallery.py --organza target/release/organza --size 1024 \\
        --median-error 0.02 --seconds 300 --threads 2 --table table.md

A scene that was rendered with the same settings is not rendered again, so an interrupted run
goes on where it stopped; what was rendered lies in the folder --work. Scenes are named by
their files without the ending: `gallery.py denim sail` renders these two.
"""
import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

from PIL import Image, ImageDraw

HERE = Path(__file__).parent
ORDER = [
    "organza", "denim", "charmeuse", "tweed", "jersey", "terry",
    "velvet", "lace", "sail", "napkin", "lining", "shirt",
]
PICTURE, CELL, LABEL, GAP, COLUMNS = 512, 256, 16, 4, 4
MOST_BYTES = 150_000


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("scenes", nargs="*", help="names of scenes; without, all of them")
    parser.add_argument("--organza", default="organza", help="the program")
    parser.add_argument("--size", type=int, default=1024, help="pixels of a side")
    parser.add_argument("--spp", type=int, default=65536, help="most samples a pixel")
    parser.add_argument("--median-error", type=float, default=0.02)
    parser.add_argument("--seconds", type=int, default=300, help="time limit of a scene")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--denoise", action="store_true", help="denoise the pictures")
    parser.add_argument("--work", type=Path, default=Path("target/gallery"))
    parser.add_argument("--table", type=Path, help="file to write the table to")
    return parser.parse_args()


def key(scene, given):
    """Names what a picture depends on: settings, scene, and the files of the gallery that
    the scene names."""
    text = scene.read_text()
    digest = hashlib.sha256(text.encode())
    for name in re.findall(r'"([^"\n]+\.(?:toml|obj|hdr))"', text):
        digest.update((HERE / name).read_bytes())
    settings = [given.size, given.spp, given.median_error, given.seconds, given.threads]
    digest.update(repr([*settings, given.denoise]).encode())
    return digest.hexdigest()


def representations(scene):
    found = re.findall(r'^model = "(\w+)"', scene.read_text(), re.MULTILINE)
    return ", ".join(dict.fromkeys(found))


def render(name, given):
    """Figures of a scene, rendered if they are not kept."""
    scene, record = HERE / f"{name}.toml", given.work / f"{name}.json"
    wanted = key(scene, given)
    if record.exists():
        kept = json.loads(record.read_text())
        if kept["key"] == wanted:
            return kept
    picture = given.work / f"{name}.png"
    command = [
        given.organza, "render", scene, "-o", picture, "--stats",
        "--set", f"camera.resolution=[{given.size},{given.size}]",
        "--spp", given.spp, "--target-median-error", given.median_error,
        "--time-limit", given.seconds, "--threads", given.threads,
    ] + (["--denoise"] if given.denoise else [])
    start = time.monotonic()
    process = subprocess.Popen(
        [str(word) for word in command],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )
    printed = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{name}: {printed}")
    # Absent where there is one sample a pixel.
    median = re.search(r"([\d.e+-]+) in the median pixel", printed)
    samples = re.search(r"(\d+) of \d+ samples a pixel", printed)
    figures = {
        "key": wanted,
        "size": given.size,
        "seconds": round(time.monotonic() - start, 1),
        "cpu_seconds": round(usage.ru_utime + usage.ru_stime, 1),
        "median_noise": float(median[1]) if median else None,
        "samples": int(samples[1]),
        "representation": representations(scene),
        "denoised": given.denoise,
    }
    record.write_text(json.dumps(figures, indent=2))
    return figures


def write_jpeg(picture, path, most_bytes):
    """Writes at the best quality that stays below a size."""
    for quality in range(92, 20, -4):
        part = path.with_suffix(".part.jpg")
        picture.save(part, quality=quality, optimize=True, progressive=True)
        if part.stat().st_size < most_bytes:
            break
    part.replace(path)


def sheet():
    """All pictures of the gallery, with their names."""
    names = [n for n in ORDER if (HERE / f"pictures/{n}.jpg").exists()]
    rows = -(-len(names) // COLUMNS)
    size = (COLUMNS * (CELL + GAP) + GAP, rows * (CELL + LABEL + GAP) + GAP)
    whole = Image.new("RGB", size, "white")
    draw = ImageDraw.Draw(whole)
    for i, name in enumerate(names):
        x = GAP + i % COLUMNS * (CELL + GAP)
        y = GAP + i // COLUMNS * (CELL + LABEL + GAP)
        with Image.open(HERE / f"pictures/{name}.jpg") as picture:
            whole.paste(picture.resize((CELL, CELL), Image.Resampling.LANCZOS), (x, y + LABEL))
        draw.text((x + 1, y + 2), name, fill="black")
    write_jpeg(whole, HERE / "gallery.jpg", 400_000)


def table(figures):
    lines = [
        "| scene | representation | size | samples a pixel | CPU time | median noise |",
        "|---|---|---|---|---|---|",
    ]
    for name, f in figures.items():
        noise = f"{100 * f['median_noise']:.1f} %" if f["median_noise"] else "unknown"
        lines.append(
            f"| {name} | {f['representation']} | {f['size']} | {f['samples']} "
            f"| {f['cpu_seconds']:.0f} s | {noise} |"
        )
    return "\n".join(lines) + "\n"


def main():
    given = arguments()
    unknown = [n for n in given.scenes if n not in ORDER]
    if unknown:
        sys.exit(f"unknown scenes: {', '.join(unknown)}; there are: {', '.join(ORDER)}")
    names = given.scenes or [n for n in ORDER if (HERE / f"{n}.toml").exists()]
    given.work.mkdir(parents=True, exist_ok=True)
    (HERE / "pictures").mkdir(exist_ok=True)
    figures = {}
    for name in names:
        figures[name] = render(name, given)
        with Image.open(given.work / f"{name}.png") as picture:
            small = picture.convert("RGB")
            if small.width > PICTURE:
                small = small.resize((PICTURE, PICTURE), Image.Resampling.LANCZOS)
        write_jpeg(small, HERE / f"pictures/{name}.jpg", MOST_BYTES)
        print(table({name: figures[name]}).splitlines()[-1], flush=True)
        if given.table:
            given.table.write_text(table(figures))
    sheet()


if __name__ == "__main__":
    main()
