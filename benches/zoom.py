"""Renders a zoom from 3 m to 1 mm and plots how the picture changes from frame to frame.

    python3 benches/zoom.py DIR towel|denim [FRAMES]

Explicit fibres give way to the far-field table of their fabric (docs/far_field.md). In frames
where both are seen, the picture is rendered with fibres alone as well, and the means are compared.
Files that are there already are not made again. ORGANZA names the program, THREADS the number of
threads, PATHS those from each node of the table, SPP the samples of a pixel (half of them from each
of two seeds, so that the change from frame to frame is free of noise). Needs numpy, OpenEXR and
pillow.
"""

import json
import math
import os
import pathlib
import shutil
import subprocess
import sys

import numpy
import OpenEXR
from PIL import Image, ImageDraw

FAR_MM, NEAR_MM = 3000.0, 1.0
FOV_DEG = 15.0
PIXELS = 512
# Lights of the daylight scenes; denim lies flat, the towel over its rail.
SCENE = """[render]
spp = {spp}
seed = {seed}

[camera]
kind = "perspective"
origin_mm = {origin}
target_mm = {target}
up = [0.0, 0.0, 1.0]
fov_deg = {fov}
resolution = [{pixels}, {pixels}]

[[light]]
kind = "directional"
direction = [0.55, -0.55, -0.63]
irradiance = [2.2, 2.15, 2.0]

[[light]]
kind = "environment"
radiance = [0.35, 0.38, 0.42]

[[object]]
kind = "cloth"
fabric = "fabrics/{fabric}.toml"
model = "fibres"
lod = "{lod}"
{mesh}
"""
MESH = 'mesh = "meshes/draped_towel.obj"\nmm_per_uv = 100.0\n'
# The cloth, what it lies over, the direction to the camera, and a point of or near the cloth.
ZOOMS = {
    "towel": ("towel", MESH, (-0.31, 0.85, 0.43), (0.0, 10.0, -90.0)),
    "denim": ("denim", "", (0.2, -0.5, 0.84), (0.0, 0.0, 0.0)),
}


def organza(*arguments):
    """Runs the program and returns what it prints."""
    program = os.environ.get("ORGANZA", "target/release/organza")
    command = [program, *map(str, arguments), "--threads", os.environ.get("THREADS", "2")]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def radiance(path):
    """Height, width and colour of a picture."""
    return OpenEXR.File(str(path)).channels()["RGB"].pixels.astype(float)


class Zoom:
    """The pictures of one zoom in a folder."""

    def __init__(self, folder, name):
        self.folder = folder / name
        self.fabric, self.mesh, toward, self.target = ZOOMS[name]
        length = math.hypot(*toward)
        self.toward = [x / length for x in toward]
        self.scenes = folder / "scenes"
        if not self.scenes.exists():
            shutil.copytree("scenes", self.scenes)
        self.folder.mkdir(parents=True, exist_ok=True)
        self.make_table()
        self.find_target()

    def make_table(self):
        path = self.scenes / "fabrics" / f"{self.fabric}.toml"
        table = path.with_suffix(".bsdf")
        if not table.exists():
            paths = os.environ.get("PATHS", "131072")
            organza("table", path, "-o", table, "--spp", paths, "--held-out", "0", "--quiet")
        figures = json.loads(organza("info", path, "--json"))
        self.tile_mm = max(figures["figures"]["tile_mm"])

    def render(self, name, distance_mm, lod="auto", pixels=PIXELS, fov_deg=FOV_DEG, seed=1):
        """The picture from that far away."""
        name = f"{name}.{seed}"
        path = self.folder / f"{name}.exr"
        if not path.exists():
            origin = [t + distance_mm * d for t, d in zip(self.target, self.toward)]
            scene = self.scenes / f"zoom.{self.fabric}.{name}.toml"
            scene.write_text(
                SCENE.format(
                    spp=max(int(os.environ.get("SPP", "16")) // 2, 1), seed=seed, origin=origin,
                    target=list(self.target), fov=fov_deg, pixels=pixels, fabric=self.fabric,
                    lod=lod, mesh=self.mesh,
                )
            )  # fmt: skip
            organza("render", scene, "-o", path, "--quiet")
        return path

    def pair(self, name, distance_mm, lod="auto"):
        """Two pictures from that far away whose noise is independent."""
        return [radiance(self.render(name, distance_mm, lod, seed=seed)) for seed in (1, 2)]

    def find_target(self):
        """Puts the target onto the nearest part of the cloth within 0.4 mm of it: a zoom into a gap
        would show none."""
        pixels, fov_deg = 9, 0.1
        for away_mm in (500.0, 10.0):
            path = self.render(f"target{away_mm:g}", away_mm, "volume", pixels, fov_deg)
            depth = OpenEXR.File(str(path)).channels()["depth_mm"].pixels.astype(float)
            depth[~numpy.isfinite(depth) | (depth <= 0.0)] = numpy.inf
            row, column = numpy.unravel_index(depth.argmin(), depth.shape)
            # Directions of the picture, as of a camera whose upper edge is toward +z.
            back = numpy.array(self.toward)
            right = numpy.cross((0.0, 0.0, 1.0), back)
            right /= numpy.linalg.norm(right)
            up = numpy.cross(back, right)
            step = 2 * math.tan(math.radians(fov_deg / 2)) / pixels
            middle = (pixels - 1) / 2
            ray = (column - middle) * step * right + (middle - row) * step * up - back
            ray /= numpy.linalg.norm(ray)
            origin = numpy.array(self.target) + away_mm * back
            self.target = tuple((origin + depth[row, column] * ray).tolist())
            fov_deg = 2.0

    def frames(self, count):
        """Each frame's distance, mean and change from the frame before, and the mean of fibres
        alone where both representations are seen."""
        ratio = (NEAR_MM / FAR_MM) ** (1 / (count - 1))
        rows, before = [], None
        for i in range(count):
            distance_mm = FAR_MM * ratio**i
            pair = self.pair(f"frame{i:03}", distance_mm)
            picture = (pair[0] + pair[1]) / 2
            pixel_mm = 2 * distance_mm * math.tan(math.radians(FOV_DEG / 2)) / PIXELS
            row = {"frame": i, "distance_mm": distance_mm, "pixel_mm": pixel_mm}
            row["mean"] = picture.mean(axis=(0, 1)).tolist()
            if before is not None:
                row["change"] = change(before, pair, ratio)
            if 0.3 * self.tile_mm < pixel_mm:
                fibres = self.pair(f"fibres{i:03}", distance_mm, "volume")
                row["fibres"] = numpy.mean(fibres, axis=(0, 1, 2)).tolist()
            rows.append(row)
            before = pair
        return rows


def blocks(picture, edge):
    """Means of square blocks of pixels, which have less noise."""
    height, width = (n // edge * edge for n in picture.shape[:2])
    cut = picture[:height, :width]
    return cut.reshape(height // edge, edge, width // edge, edge, 3).mean(axis=(1, 3))


def change(before, after, ratio):
    """Root mean square change of blocks of 16 pixels, as a share of the mean: the frame before
    against the same part of the cloth in the frame after. The product of two differences with
    independent noise has no share of the noise."""
    size = before[0].shape[0]
    # The frame after shows the middle `ratio` of the frame before.
    part = int(round(size * ratio)) // 2 * 2
    low = (size - part) // 2
    step = size / part
    grid = low + (numpy.arange(size) / step).astype(int).clip(0, part - 1)
    off = [blocks(b[grid][:, grid], 16) - blocks(a, 16) for b, a in zip(before, after)]
    square = max(float((off[0] * off[1]).mean()), 0.0)
    return math.sqrt(square) / float(numpy.mean(after))


def plot(rows, path):
    """Mean of the green channel, and the change from frame to frame, over the distance."""
    width, height, margin = 900, 300, 50
    sheet = Image.new("RGB", (width, 2 * height), "white")
    draw = ImageDraw.Draw(sheet)
    for k, (key, title) in enumerate((("mean", "mean radiance, green"), ("change", "change"))):
        values = [(r["frame"], r[key][1] if key == "mean" else r.get(key)) for r in rows]
        values = [(frame, v) for frame, v in values if v is not None]
        top = 1.1 * max(v for _, v in values)
        low = height * (k + 1) - margin

        def place(frame, value):
            x = margin + (width - 2 * margin) * frame / (len(rows) - 1)
            return x, low - (height - 2 * margin) * value / top

        draw.line([place(0, 0), place(len(rows) - 1, 0)], fill="black")
        draw.line([place(*v) for v in values], fill=(30, 90, 160), width=2)
        draw.text((margin, height * k + 10), f"{title}, 0 to {top:.3g}", fill="black")
        for r in rows[:: max(len(rows) // 6, 1)]:
            label = f"{r['distance_mm'] / 1000:.3g} m"
            draw.text((place(r["frame"], 0)[0] - 15, low + 8), label, fill="black")
        alone = [place(r["frame"], r["fibres"][1]) for r in rows if k == 0 and "fibres" in r]
        for x, y in alone:
            draw.ellipse([x - 3, y - 3, x + 3, y + 3], outline=(200, 60, 30))
    sheet.save(path)


def film(zoom, rows, path):
    """Twelve frames side by side, and all of them as a moving picture."""
    pictures = []
    for r in rows:
        pair = zoom.pair(f"frame{r['frame']:03}", r["distance_mm"])
        linear = ((pair[0] + pair[1]) / 2).clip(0, 1)
        curve = numpy.where(
            linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055
        )
        pictures.append(Image.fromarray((255 * curve + 0.5).astype("uint8")))
    pictures[0].save(
        path.with_suffix(".gif"), save_all=True, append_images=pictures[1:], duration=80, loop=0
    )
    edge = 256
    sheet = Image.new("RGB", (6 * edge, 2 * edge))
    for i in range(12):
        frame = pictures[round(i * (len(pictures) - 1) / 11)].resize((edge, edge))
        sheet.paste(frame, (i % 6 * edge, i // 6 * edge))
    sheet.save(path.with_suffix(".jpg"), quality=85)


def main():
    if len(sys.argv) not in (3, 4) or sys.argv[2] not in ZOOMS:
        sys.exit(__doc__)
    folder, name = pathlib.Path(sys.argv[1]), sys.argv[2]
    zoom = Zoom(folder, name)
    rows = zoom.frames(int(sys.argv[3]) if len(sys.argv) == 4 else 60)
    (folder / f"{name}.json").write_text(json.dumps(rows, indent=1))
    plot(rows, folder / f"{name}_plot.png")
    film(zoom, rows, folder / f"{name}_film.png")
    for r in rows:
        mean = " ".join(f"{v:.4f}" for v in r["mean"])
        shares = (100 * (a / b - 1) for a, b in zip(r["mean"], r.get("fibres", [])))
        off = " ".join(f"{s:+.2f} %" for s in shares)
        print(
            f"{r['frame']:3} {r['distance_mm']:8.1f} mm, pixel {r['pixel_mm']:.4f} mm: {mean}"
            f"{100 * r.get('change', 0):7.1f} %  {off}"
        )


if __name__ == "__main__":
    main()
