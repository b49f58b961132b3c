"""Renders the scenes of the gallery, and measures the noise and the error of their pictures.

Each scene is rendered as two halves with different samples. They are merged to the picture, which
is denoised, and their difference shows how far the denoised picture can be trusted (noise.py).
Needs Python 3.10 or newer with Pillow, NumPy and OpenEXR, and Open Image Denoise; runs in the root
of the repository:

    python3 -m venv target/gallery_python
    target/gallery_python/bin/pip install pillow numpy OpenEXR==3.5.3 pyoidn==2.5.1.0
    target/gallery_python/bin/python scenes/gallery/gallery.py \\
        --organza target/release/organza --publish

Pictures and figures lie in the folder --work. With --publish they also replace the pictures of the
gallery, the table of benches/runs/gallery.md and that of docs/gallery.md. A scene that was
rendered with the same settings is not rendered again, so an interrupted run goes on where it
stopped. Scenes are named by their files without the ending: `gallery.py denim sail` renders
these two.
"""
import argparse
import hashlib
import json
import math
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image, ImageDraw

from noise import Share, error_of_denoised, median_noise, noise_of_denoised

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
RECORD, PAGE = ROOT / "benches/runs/gallery.md", ROOT / "docs/gallery.md"
BEGIN, END = "<!-- gallery.py writes from here -->", "<!-- to here -->"
ORDER = [
    "organza", "denim", "charmeuse", "tweed", "jersey", "terry",
    "velvet", "lace", "sail", "napkin", "lining", "shirt",
]
CELL, LABEL, GAP, COLUMNS = 256, 16, 4, 4
MOST_BYTES = 300_000


def machine():
    """Processor, cores and compiler, as the records name them."""
    try:
        processor = Path("/proc/cpuinfo").read_text()
        name = re.search(r"^model name\s*: (.+)$", processor, re.MULTILINE)[1]
        compiler = subprocess.run(["rustc", "--version"], stdout=subprocess.PIPE, text=True).stdout
        kernel = " (AVX-512)" if "avx512f" in processor else ""
        return f"{name}{kernel}, {os.cpu_count()} virtual cores, Rust {compiler.split()[1]}"
    except (OSError, TypeError, IndexError):
        return "unknown"


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("scenes", nargs="*", help="names of scenes; without, all of them")
    parser.add_argument("--organza", default="organza", help="the program")
    parser.add_argument("--size", type=int, default=1024, help="pixels of a side")
    parser.add_argument("--spp", type=int, default=65536, help="most samples a pixel")
    parser.add_argument(
        "--median-error", type=float, default=0.02,
        help="noise of the median pixel at which a scene is done before its time",
    )
    parser.add_argument("--seconds", type=float, default=150, help="time for rendering a scene")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--work", type=Path, default=Path("target/gallery"))
    parser.add_argument("--publish", action="store_true", help="replace pictures and tables")
    parser.add_argument("--machine", default=machine(), help="for the record")
    parser.add_argument("--load", default="none", help="what else the machine does, for the record")
    return parser.parse_args()


def inputs(file, found):
    """All files that a scene names, directly or through its fabrics."""
    if file not in found and file.exists():
        found[file] = file.read_bytes()
        if file.suffix == ".toml":
            for name in re.findall(r'"([^"\n]+\.\w+)"', found[file].decode()):
                inputs((file.parent / name).resolve(), found)
    return found


def key(scene, program, given):
    """Identifies what the figures depend on: program, settings and files."""
    digest = hashlib.sha256(program.encode())
    for file, content in sorted(inputs(scene, {}).items()):
        digest.update(file.name.encode() + content)
    settings = [given.size, given.spp, given.median_error, given.seconds, given.threads]
    digest.update(repr(settings).encode())
    return digest.hexdigest()


def run(words):
    """Runs organza, in whose environment the denoiser of this Python is found."""
    environment = {"VIRTUAL_ENV": sys.prefix} | os.environ
    done = subprocess.run(
        [str(word) for word in words], env=environment, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )
    if done.returncode:
        raise RuntimeError(f"{' '.join(map(str, words))}: {done.stdout}")
    return done.stdout


def picture(path):
    """Channels of a picture by name, and its header."""
    file = OpenEXR.File(str(path), separate_channels=True)
    channels = {name: np.asarray(channel.pixels) for name, channel in file.channels().items()}
    return channels, file.header()


def colours(channels, prefix=""):
    return np.stack([channels[prefix + c] for c in "RGB"], axis=-1)


def range_end(path):
    """The number after the last sample of a picture."""
    comments = picture(path)[1]["comments"]
    return int(re.search(r"^samples=\d+\.\.(\d+)$", comments, re.MULTILINE)[1])


def halves(scene, given, first, second):
    """Renders two halves with equal numbers of samples; gives the samples of a pixel."""
    common = [
        given.organza, "render", scene, "--threads", given.threads, "--quiet",
        "--set", f"camera.resolution=[{given.size},{given.size}]",
    ]
    most = max(given.spp // 2, 2)
    run([
        *common, "-o", first, "--samples", f"0..{most}", "--time-limit", given.seconds / 2,
        "--target-median-error", given.median_error * math.sqrt(2),
    ])
    samples = range_end(first)
    if samples < 2:  # of one sample the variance is unknown
        samples = 2
        run([*common, "-o", first, "--samples", "0..2"])
    run([*common, "-o", second, "--samples", f"{samples}..{2 * samples}"])
    return 2 * samples


def judge(noisy, denoised, whole):
    """Figures of a picture from the files of its halves."""
    parts = [picture(path)[0] for path in noisy]
    raw, variances = [colours(p) for p in parts], [colours(p, "variance.") for p in parts]
    smooth = [colours(picture(path)[0]) for path in denoised]
    merged = picture(whole)[0]
    mean = float(colours(merged).astype(np.float64).mean())
    return {
        "median_noise": median_noise(
            colours(merged), colours(merged, "variance."), merged["through"]
        ),
        "denoised_noise": noise_of_denoised(*smooth, mean),
        "denoised_error": error_of_denoised(smooth, raw, variances, mean),
    }


def figures(name, program, given):
    """Figures of a scene, which is rendered if they are not kept."""
    scene, record = HERE / f"{name}.toml", given.work / f"{name}.json"
    wanted = key(scene, program, given)
    if record.exists():
        kept = json.loads(record.read_text())
        if kept["key"] == wanted:
            return kept
    noisy = [given.work / f"{name}.{half}.exr" for half in "ab"]
    denoised = [given.work / f"{name}.{half}.denoised.exr" for half in "ab"]
    whole = given.work / f"{name}.exr"
    started = time.monotonic()
    samples = halves(scene, given, *noisy)
    rendered = time.monotonic()
    run([given.organza, "merge", *noisy, "-o", whole, "--quiet"])
    threads = ["--threads", given.threads, "--quiet"]
    run([given.organza, "denoise", whole, "-o", given.work / f"{name}.png", *threads])
    seconds_to_denoise = time.monotonic() - rendered
    for a, b in zip(noisy, denoised):
        run([given.organza, "denoise", a, "-o", b, *threads])
    models = re.findall(r'^model = "(\w+)"', scene.read_text(), re.MULTILINE)
    result = {
        "key": wanted,
        "size": given.size,
        "representation": ", ".join(dict.fromkeys(models)),
        "samples": samples,
        "seconds": rendered - started,
        "seconds_to_denoise": seconds_to_denoise,
        **judge(noisy, denoised, whole),
    }
    record.write_text(json.dumps(result, indent=2))
    for path in [*noisy, *denoised]:
        path.unlink()
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
    return "unknown" if share is None else f"{100 * share:.1f} %"


EXPLANATION = """\
Each picture is merged from two halves with different samples. *Rendering* is the wall time of
both halves, in which the cloth is built twice. The median noise is the standard error of the
median pixel as a share of its value, before denoising; at few samples it comes out too small, as
rare bright paths are missing. The *noise* of the denoised picture is the root mean square of half
the difference of the denoised halves. Its *error* is the root mean square of the difference of a
denoised half and the noisy other half, less the noise of the latter; it includes what the denoiser
smears, and is that of half the samples, so that of the whole picture is smaller. Both are shares
of the picture's mean; their standard errors come from blocks of 32 x 32 pixels. Where an error is
below twice its standard error, an upper limit stands in its place.

The median noise times the root of the samples is about the noise of one path. The square of that
over 0.0004 is the number of samples that a median noise of 2 % takes.
"""


def table(all_figures):
    """The table of the record."""
    lines = [
        "| scene | representation | size | samples a pixel | rendering | denoising "
        "| median noise | denoised: noise | denoised: error |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, f in all_figures.items():
        lines.append(
            f"| {name} | {f['representation']} | {f['size']} | {f['samples']} "
            f"| {f['seconds']:.0f} s | {f['seconds_to_denoise']:.0f} s "
            f"| {percent(f['median_noise'])} | {Share(*f['denoised_noise']).text()} "
            f"| {Share(*f['denoised_error']).text()} |"
        )
    return "\n".join(lines) + "\n"


def page_table(all_figures, commit, given):
    """What docs/gallery.md says about the figures."""
    known = {n: f["median_noise"] for n, f in all_figures.items() if f["median_noise"]}
    done = [n for n, noise in known.items() if noise <= given.median_error]
    lines = [
        f"The pictures are rendered at {given.size} x {given.size} pixels on {given.threads} "
        "threads, and denoised ([Denoising](denoise.md)). The",
        f"[record](../benches/runs/gallery.md) of commit `{commit}` explains the figures. The aim of",
        f"{100 * given.median_error:.0f} % is reached by: {', '.join(done) or 'no scene'}.",
        "",
        "| scene | time | samples a pixel | median noise | error of the denoised picture |",
        "|---|---|---|---|---|",
    ]
    for name, f in all_figures.items():
        lines.append(
            f"| {name} | {f['seconds']:.0f} s | {f['samples']} | {percent(f['median_noise'])} "
            f"| {Share(*f['denoised_error']).text()} |"
        )
    return "\n".join(lines) + "\n"


def replace_block(path, block, rows={}):
    """Replaces what stands between the markers of a page, and rows of its first table."""
    text = path.read_text()
    head, rest = text.split(BEGIN, 1)
    tail = rest.split(END, 1)[1]
    for name, value in rows.items():
        head, count = re.subn(
            rf"^\| {name} \|.*$", lambda _: f"| {name} | {value} |", head, 1, re.MULTILINE
        )
        assert count == 1, f"{path}: no row {name}"
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
    command = " ".join(["python3 scenes/gallery/gallery.py", *sys.argv[1:]])
    rows = {"commit": f"`{commit}`", "command": f"`{command}`", "load": given.load}
    rows["machine"] = f"{given.machine}; {given.threads} threads"
    replace_block(RECORD, f"{EXPLANATION}\n{table(all_figures)}", rows)
    replace_block(PAGE, page_table(all_figures, commit, given))


def main():
    given = arguments()
    unknown = [n for n in given.scenes if n not in ORDER]
    if unknown:
        sys.exit(f"unknown scenes: {', '.join(unknown)}; there are: {', '.join(ORDER)}")
    given.work.mkdir(parents=True, exist_ok=True)
    program = run([given.organza, "--version", "--verbose"])
    all_figures, failures = {}, []
    for name in given.scenes or ORDER:
        try:
            all_figures[name] = figures(name, program, given)
        except RuntimeError as error:
            failures.append(name)
            print(f"{name}: {error}", file=sys.stderr, flush=True)
            continue
        print(table({name: all_figures[name]}).splitlines()[-1], flush=True)
        (given.work / "table.md").write_text(table(all_figures))
    if given.publish and all_figures:
        publish(all_figures, program, given)
    if failures:
        sys.exit(f"not rendered: {', '.join(failures)}")


if __name__ == "__main__":
    main()
