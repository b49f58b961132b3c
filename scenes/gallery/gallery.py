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
gallery, the table of benches/runs/gallery.md and that of docs/gallery.md. A scene that was
rendered with the same settings is not rendered again, so an interrupted run goes on where it
stopped. Scenes are named by their files without the ending: `gallery.py denim sail` renders
these two.
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
BEGIN, END = "<!-- gallery.py writes from here -->", "<!-- to here -->"
ORDER = [
    "organza", "denim", "charmeuse", "tweed", "jersey", "terry",
    "velvet", "lace", "sail", "napkin", "lining", "shirt",
]
CELL, LABEL, GAP, COLUMNS = 256, 16, 4, 4
MOST_BYTES = 300_000
# Samples of a pixel; fewer of cloths among whose hairs a path is long.
SAMPLES, FEWER = 32, 16
HAIRY = {"jersey", "terry", "velvet", "napkin", "shirt"}
# Samples of the unbiased part, and its seed.
PROOF_SPP, PROOF_SEED = 64, 2


def machine():
    """Processor, cores and compiler, as the records name them."""
    try:
        processor = Path("/proc/cpuinfo").read_text()
        name = re.search(r"^model name\s*: (.+)$", processor, re.MULTILINE)[1]
        compiler = subprocess.run(["rustc", "--version"], stdout=subprocess.PIPE, text=True).stdout
        kernel = " (AVX-512)" if "avx512f" in processor else " (AVX2)" * ("avx2" in processor)
        return f"{name}{kernel}, {os.cpu_count()} virtual cores, Rust {compiler.split()[1]}"
    except (OSError, TypeError, IndexError):
        return "unknown"


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("scenes", nargs="*", help="names of scenes; without, all of them")
    parser.add_argument("--organza", default="organza", help="the program")
    parser.add_argument("--size", type=int, default=1024, help="pixels of a side")
    parser.add_argument("--spp", type=int, help="samples a pixel, instead of those of each scene")
    parser.add_argument("--proof", type=int, default=256, help="pixels of a side of the part")
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


def figures(name, program, given):
    """Figures of a scene, which is rendered if they are not kept."""
    scene, record = HERE / f"{name}.toml", given.work / f"{name}.json"
    samples = given.spp or (FEWER if name in HAIRY else SAMPLES)
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
    known = json.loads(run([*common, "-o", picture, "--spp", samples, "--denoise"]))
    stops = re.search(r"^exposure = (\S+)", scene.read_text(), re.MULTILINE)[1]
    shown = ["-o", given.work / f"{name}.png", f"--exposure={stops}", "--quiet"]
    run([given.organza, "develop", picture, *shown])
    low = (given.size - given.proof) // 2
    high = low + given.proof
    unbiased = json.loads(run([
        *common, "-o", part, "--spp", PROOF_SPP, "--seed", PROOF_SEED, "--set",
        'render.cache="off"', "--crop", f"{low},{low},{high},{high}",
    ]))
    other, variance = grey(part), grey(part, "variance.")
    middle = np.s_[low:high, low:high]
    noisy = errors(grey(picture, "noisy.")[middle], other, variance)
    # Seconds of processor in which unbiased samples bring the median pixel to the same error.
    whole = unbiased["render_cpu_s"] * (given.size / given.proof) ** 2
    noise = median_noise(other, variance)
    models = re.findall(r'^model = "(\w+)"', scene.read_text(), re.MULTILINE)
    result = {
        "key": wanted,
        "representation": ", ".join(dict.fromkeys(models)),
        "samples": samples,
        "seconds": known["total_s"],
        "setup_cpu_s": known["setup_cpu_s"],
        "render_cpu_s": known["render_cpu_s"],
        "memory_bytes": known["peak_memory_bytes"],
        "cache": known["cache"],
        "noisy": noisy,
        "denoised": errors(grey(picture)[middle], other, variance),
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
without a cache bring the median pixel of the whole picture to the same error, by their variance.
"""


def table(all_figures):
    """The table of the record."""
    lines = [
        "| scene | representation | samples | time | set-up | tracing | memory | mean | 16 x 16 | pixel "
        "| median pixel | denoised | unbiased |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, f in all_figures.items():
        noisy, unbiased = f["noisy"], f["unbiased_cpu_s"]
        lines.append(
            f"| {name} | {f['representation']} | {f['samples']} | {f['seconds']:.0f} s | {f['setup_cpu_s']:.0f} s "
            f"| {f['render_cpu_s']:.0f} s | {f['memory_bytes'] / 2**30:.1f} GiB "
            f"| {100 * noisy['mean']:+.1f} ± {100 * noisy['mean_error']:.1f} % "
            f"| {percent(noisy['block'])} | {percent(noisy['pixel'])} "
            f"| {percent(noisy['median'])} | {percent(f['denoised']['median'])} "
            f"| {'-' if unbiased is None else f'{unbiased:.0f} s'} |"
        )
    return "\n".join(lines) + "\n"


def page_table(all_figures, commit, given):
    """What docs/gallery.md says about the figures."""
    lines = [
        f"The pictures have {given.size} x {given.size} pixels; they are rendered on {given.threads} threads, and denoised ([Denoising](denoise.md)).",
        f"The [record](../benches/runs/gallery.md) of commit `{commit}` explains the figures; 0 stands where",
        "unbiased samples found none.",
        "",
        "| scene | samples | processor time | error of the median pixel | denoised | the same error without a cache |",
        "|---|---|---|---|---|---|",
    ]
    for name, f in all_figures.items():
        spent, unbiased = f["setup_cpu_s"] + f["render_cpu_s"], f["unbiased_cpu_s"]
        times = (unbiased + f["setup_cpu_s"]) / spent if unbiased and f["cache"] else None
        lines.append(
            f"| {name} | {f['samples']} | {spent:.0f} s | {percent(f['noisy']['median'])} "
            f"| {percent(f['denoised']['median'])} "
            f"| {'-' if times is None else f'{times:.1f} times the processor time'} |"
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
