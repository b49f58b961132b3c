"""How often `organza fit cloth --quick` recognises cloth in pictures as a camera takes them.

    pip install pillow numpy OpenEXR==3.5.3
    python benches/photographs.py --organza target/release/organza --out target/photographs --publish

Renders five weaves once, then makes photographs of them with 2.5 to 12 pixels a thread: JPEG, noise,
blur, wrinkles, perspective, uneven light. Each is fitted with its width and lamp stated. Writes a line
for each photograph to OUT/results.csv, goes on where that file ends, and with --publish the table of docs/photographs.md.
"""
import argparse
import csv
import json
import math
import os
import pathlib
import subprocess
import time

import numpy as np
import OpenEXR
from PIL import Image

PAGE = pathlib.Path("docs/photographs.md")
MARK = "<!-- photographs.py writes from here -->"
END = "<!-- to here -->"

# Threads per cm and tex of warp and weft, their colours, ends and picks of the repeat.
WEAVES = {
    "plain": ([22, 19], [22, 34], [[0.55, 0.30, 0.20], [0.25, 0.40, 0.60]], 1),
    "twill-2-1-z": ([28, 24], [22, 26], [[0.45, 0.40, 0.30], [0.30, 0.35, 0.50]], 3),
    "twill-3-1-z": ([30, 20], [22, 30], [[0.15, 0.20, 0.35], [0.60, 0.58, 0.50]], 4),
    "satin-5-2": ([40, 22], [14, 24], [[0.60, 0.15, 0.12], [0.50, 0.45, 0.30]], 5),
    "basket-2-2": ([18, 16], [30, 30], [[0.50, 0.45, 0.30], [0.20, 0.30, 0.50]], 4),
}
# Ends in the picture, pixels from end to end, samples.
SOURCES = {"far": (60, 8, 12), "near": (24, 12, 24)}
# Pixels from end to end, and the picture that they are made of.
PIXELS = {2.5: "far", 3.5: "far", 6.0: "far", 12.0: "near"}
# What a camera does: quality of the JPEG, noise as a share, blur in pixels, wrinkles in threads, degrees
# by which the cloth is tilted.
TAKEN = {
    "good": (95, 0.01, 0.5, 0.0, 0.0),
    "JPEG 60, noise 4 %": (60, 0.04, 0.5, 0.0, 0.0),
    "blur 1 pixel": (90, 0.02, 1.0, 0.0, 0.0),
    "blur 2 pixels": (90, 0.02, 2.0, 0.0, 0.0),
    "wrinkles": (90, 0.02, 0.7, 0.8, 0.0),
    "tilted by 10 degrees": (90, 0.02, 0.7, 0.0, 10.0),
}
# Longer fits count as none.
LONGEST_S = 30
LAMP = (30, 45)
WHITE = 0.8


def render(organza, folder, weave, source):
    """The cloth in linear colours and its width, mm."""
    per_cm, tex, colours, repeat = WEAVES[weave]
    ends, pixels, samples = SOURCES[source]
    repeats = -(-ends // repeat)
    size = [10 * repeats * repeat / n for n in per_cm]
    width = repeats * repeat * pixels
    height = round(width * size[1] / size[0])
    fibres = 'preset = "cotton"\nfibre_radius_um = 12.0'
    name = f"{weave}-{source}"
    picture = folder / f"{name}.exr"
    if not picture.exists():
        (folder / f"{name}.toml").write_text(
            f'seed = 11\n[draft]\nweave = "{weave}"\n'
            f'[warp]\nyarn = "a"\nper_cm = {per_cm[0]}\ncolours = [{colours[0]}]\n'
            f'[weft]\nyarn = "b"\nper_cm = {per_cm[1]}\ncolours = [{colours[1]}]\n'
            f"[yarn.a]\n{fibres}\ntex = {tex[0]}\n[yarn.b]\n{fibres}\ntex = {tex[1]}\n"
            f"[tile]\nrepeats = [{repeats}, {repeats}]\n"
        )
        theta, phi = map(math.radians, LAMP)
        toward = [math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)]
        scene = folder / f"{name}.scene.toml"
        scene.write_text(
            f"[render]\nspp = {samples}\n[camera]\nkind = \"orthographic\"\nwidth_mm = {size[0]}\n"
            f"origin_mm = [{size[0] / 2}, {size[1] / 2}, 100]\ntarget_mm = [{size[0] / 2}, {size[1] / 2}, 0]\n"
            f"up = [0, 1, 0]\nresolution = [{width}, {height}]\nfilter = \"box\"\n"
            f"[[light]]\nkind = \"directional\"\ndirection = {[-v for v in toward]}\n"
            f"irradiance = {[math.pi * WHITE / toward[2]] * 3}\n"
            f'[[object]]\nkind = "cloth"\nfabric = "{name}.toml"\nmodel = "fibres"\n'
        )
        subprocess.run([organza, "render", scene, "-o", picture, "--quiet"], check=True)
    with OpenEXR.File(str(picture)) as file:
        channels = file.channels()
        rgb = channels["RGB"].pixels if "RGB" in channels else np.stack([channels[c].pixels for c in "RGB"], axis=-1)
    return np.asarray(rgb[..., :3], dtype=np.float64), size[0], pixels


def blurred(image, sigma):
    """A Gaussian blur, standard deviation in pixels."""
    if sigma <= 0:
        return image
    reach = math.ceil(4 * sigma)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    kernel /= kernel.sum()
    for axis in (0, 1):
        padded = np.pad(image, [(reach, reach) if a == axis else (0, 0) for a in range(3)], mode="reflect")
        image = sum(k * np.take(padded, np.arange(image.shape[axis]) + i, axis=axis) for i, k in enumerate(kernel))
    return image


def between(image, x, y):
    """Bilinear values at places in pixels."""
    h, w, _ = image.shape
    x, y = np.clip(x, 0, w - 1.001), np.clip(y, 0, h - 1.001)
    i, j = x.astype(int), y.astype(int)
    u, v = (x - i)[..., None], (y - j)[..., None]
    top = image[j, i] * (1 - u) + image[j, i + 1] * u
    low = image[j + 1, i] * (1 - u) + image[j + 1, i + 1] * u
    return top * (1 - v) + low * v


def photograph(rng, image, scale, pixels, taken):
    """The picture as a camera takes it, `scale` of its pixels in one of the camera's: sRGB, 8 bit."""
    _, noise, blur, wrinkle, tilt = taken
    h, w, _ = image.shape
    columns, rows = int(w / scale), int(h / scale)
    x, y = np.meshgrid((np.arange(columns) + 0.5) * scale, (np.arange(rows) + 0.5) * scale)
    if wrinkle:
        # Waves of 15 to 25 threads, each by a share of a thread.
        reach = wrinkle * pixels
        for _ in range(3):
            turn, length = rng.uniform(0, 2 * np.pi), rng.uniform(15, 25) * pixels
            wave = np.sin(2 * np.pi * (x * np.cos(turn) + y * np.sin(turn)) / length + rng.uniform(0, 6.3))
            toward = rng.uniform(0, 2 * np.pi)
            x, y = x + reach / 2 * wave * np.cos(toward), y + reach / 2 * wave * np.sin(toward)
    if tilt:
        # About the upright axis through the middle, from twice the cloth's width away.
        across, up = x - w / 2, y - h / 2
        far = 2 * w
        sin, cos = math.sin(math.radians(tilt)), math.cos(math.radians(tilt))
        depth = far / (far * cos - across * sin)
        x, y = across * depth + w / 2, up * (1 + across * depth * sin / far) + h / 2
    light = between(blurred(image, 0.45 * scale), x, y)
    light = blurred(light, blur)
    # The lens darkens the corners, and the light falls off to one side.
    across, up = np.meshgrid(np.linspace(-1, 1, columns), np.linspace(-1, 1, rows))
    light *= (1 - 0.1 * (across**2 + up**2) + 0.08 * across)[..., None]
    light = light * (1 + noise * rng.standard_normal(light.shape)) + 0.2 * noise * rng.standard_normal(light.shape)
    light = np.clip(light, 0, 1)
    srgb = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return Image.fromarray((255 * srgb + 0.5).astype(np.uint8))


def fit(organza, folder, picture, width_mm):
    """What organza finds, or why it finds nothing; and the seconds."""
    words = ["fit", "cloth", "--quick", "--front", picture, "--width-mm", f"{width_mm}"]
    words += ["--light", f"{LAMP[0]},{LAMP[1]}", "--white", f"{WHITE}", "-o", folder / "fitted.toml", "--json", "--quiet"]
    began = time.monotonic()
    try:
        done = subprocess.run([organza, *map(str, words)], capture_output=True, text=True, timeout=LONGEST_S)
    except subprocess.TimeoutExpired:
        return None, f"no answer in {LONGEST_S} s", LONGEST_S
    seconds = time.monotonic() - began
    if done.returncode != 0:
        return None, done.stderr.strip().splitlines()[-1].split(": ", 2)[-1], seconds
    return json.loads(done.stdout), "", seconds


def machine():
    """The processor's name and the number of its cores."""
    names = [line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")]
    return f"{names[0] if names else 'unknown processor'}, {os.cpu_count()} cores"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--organza", required=True)
    parser.add_argument("--out", required=True, type=pathlib.Path)
    parser.add_argument("--weaves", default=",".join(WEAVES), help="some of them")
    parser.add_argument("--publish", action="store_true", help="write the table into docs/photographs.md")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    program = str(pathlib.Path(arguments.organza).resolve())
    results = []
    kept = arguments.out / "results.csv"
    done = {}
    if kept.exists():
        with open(kept, newline="") as file:
            done = {tuple(row[:3]): row for row in csv.reader(file) if len(row) == 9}
    with open(kept, "w", newline="") as file:
        table = csv.writer(file)
        table.writerow("weave,pixels,taken,spacing_off,draft,confidence,is_right,seconds,refusal".split(","))
        for weave in arguments.weaves.split(","):
            for pixels, source in PIXELS.items():
                for number, (name, taken) in enumerate(TAKEN.items()):
                    row = done.get((weave, f"{pixels}", name))
                    if row:
                        table.writerow(row)
                        results.append((pixels, name, float(row[3]), row[6] == "True", bool(row[4]), float(row[7])))
                        continue
                    image, width_mm, own = render(program, arguments.out, weave, source)
                    rng = np.random.default_rng([list(WEAVES).index(weave), int(10 * pixels), number])
                    picture = arguments.out / f"{weave}-{pixels}-{number}.jpg"
                    scale = own / pixels
                    photograph(rng, image, scale, own, taken).save(picture, quality=taken[0])
                    # The picture ends with a whole pixel.
                    shown_mm = width_mm * int(image.shape[1] / scale) * scale / image.shape[1]
                    found, refusal, seconds = fit(program, arguments.out, picture, shown_mm)
                    off = max(abs(s * n / 10 - 1) for s, n in zip(found["spacing_mm"], WEAVES[weave][0])) if found else math.nan
                    draft = found["draft"] if found else ""
                    row = [weave, pixels, name, f"{off:.4f}", draft, found["confidence"] if found else "", draft == weave, f"{seconds:.1f}", refusal]
                    table.writerow(row)
                    file.flush()
                    print(*row, sep=", ", flush=True)
                    results.append((pixels, name, off, draft == weave, bool(found), seconds))
    lines = [
        f"{len(results)} photographs of {', '.join(arguments.weaves.split(','))}; {machine()}; fits took "
        f"{sum(r[5] for r in results) / 60:.0f} min.",
        "Drafts right, spacings within 3 %, no answer; median time:",
        "",
        f"| taken | {' | '.join(f'{pixels:g}' for pixels in PIXELS).replace(' |', ' pixels a thread |', 1)} |",
        "|---" * (len(PIXELS) + 1) + "|",
    ]
    for name in TAKEN:
        cells = []
        for pixels in PIXELS:
            of = [r for r in results if r[0] == pixels and r[1] == name]
            near = sum(r[2] < 0.03 for r in of)
            seconds = sorted(r[5] for r in of)[len(of) // 2]
            cells.append(f"{sum(r[3] for r in of)}, {near}, {sum(not r[4] for r in of)}; {seconds:.0f} s")
        lines.append(f"| {name} | {' | '.join(cells)} |")
    text = "\n".join(lines)
    print(text)
    if arguments.publish:
        page = PAGE.read_text()
        before, rest = page.split(MARK)
        PAGE.write_text(before + MARK + "\n\n" + text + "\n\n" + END + rest.split(END)[1])


if __name__ == "__main__":
    main()
