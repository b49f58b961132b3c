"""An independent reader of polynomial texture maps opens what `organza measure --layout ptm`
writes, lights it, and finds the values that organza measures for the same directions.

    python tests/peers/check_ptm.py --organza target/release/organza

The reader follows the published description of the format [Malzbender2001] and shares no code
with organza; it needs Python alone. Prints the difference over eight lamps of the mean over the
texels, and exits with 1 if it is too large.
Twins with a reader's usual mistakes must be refused.
"""
import argparse
import csv
import math
import pathlib
import subprocess
import sys
import tempfile

FABRIC = """[draft]
weave = "twill-3-1"
[warp]
yarn = "cotton"
per_cm = 24.0
colours = [[0.7, 0.2, 0.1]]
[weft]
yarn = "cotton"
per_cm = 22.0
colours = [[0.2, 0.3, 0.7]]
[yarn.cotton]
preset = "cotton"
tex = 30.0
[voxel]
size_um = 60.0
"""
# Polar angle and azimuth of lamps in degrees. At grazing angles a polynomial of second degree
# is a poor fit.
LAMPS = [(0, 0), (30, 0), (30, 90), (30, 225), (50, 45), (50, 160), (60, 0), (60, 90)]
SEED = 7
# In shares of white. A polynomial of second degree misses the brightest reflections, back to a
# lamp along the normal: seeds 7 and 8 both differ by 0.016. Noise is a tenth of that.
LIMIT = 0.03


class Map:
    """A file of format `PTM_FORMAT_RGB`, version 1.2."""

    def __init__(self, data):
        lines, at = [], 0
        while len(" ".join(lines[2:]).split()) < 14:
            end = data.index(b"\n", at)
            lines.append(data[at:end].decode("ascii"))
            at = end + 1
        if lines[:2] != ["PTM_1.2", "PTM_FORMAT_RGB"]:
            raise ValueError(f"not a map of format RGB: {lines[:2]}")
        words = " ".join(lines[2:]).split()
        self.width, self.height = int(words[0]), int(words[1])
        self.scale = [float(w) for w in words[2:8]]
        self.bias = [int(w) for w in words[8:14]]
        self.bytes = data[at:]
        if len(self.bytes) != 18 * self.width * self.height:
            raise ValueError(f"{len(self.bytes)} bytes of coefficients")

    def display_value(self, channel, texel, u, v, swaps_axes, adds_bias):
        """What a viewer shows of a texel under a lamp, 0 to 255, not clamped."""
        if swaps_axes:
            u, v = v, u
        first = 6 * (channel * self.width * self.height + texel)
        raw = self.bytes[first:first + 6]
        sign = 1 if adds_bias else -1
        a = [(raw[k] + sign * self.bias[k]) * self.scale[k] for k in range(6)]
        return a[0] * u * u + a[1] * v * v + a[2] * u * v + a[3] * u + a[4] * v + a[5]

    def mean_linear(self, theta_deg, phi_deg, swaps_axes=False, adds_bias=False):
        """Mean linear values over all texels under a lamp; 1 is a white sheet."""
        ring = math.sin(math.radians(theta_deg))
        u, v = (ring * f(math.radians(phi_deg)) for f in (math.cos, math.sin))
        texels = self.width * self.height
        return [
            sum(linear(self.display_value(c, t, u, v, swaps_axes, adds_bias))
                for t in range(texels)) / texels
            for c in range(3)
        ]


def linear(display):
    """Of a display value of sRGB from 0 to 255, which may be out of range."""
    s = display / 255.0
    return s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4


def measured(organza, folder):
    """Pi times BSDF times cosine per lamp, seen along the normal, and its standard errors."""
    rows = "".join(f"{t},{p},0,0\n" for t, p in LAMPS)
    (folder / "pairs.csv").write_text("theta_i,phi_i,theta_o,phi_o\n" + rows)
    subprocess.run([organza, "measure", "cloth.toml", "--pairs", "pairs.csv", "-o", "values.csv",
                    "--spp", "100000", "--seed", str(SEED), "--quiet"], cwd=folder, check=True)
    with open(folder / "values.csv", encoding="ascii") as file:
        values = []
        for row in csv.DictReader(file):
            share = math.pi * math.cos(math.radians(float(row["theta_i"])))
            values.append([[share * float(row[p + c]) for c in "rgb"] for p in ("", "se_")])
    return values


def difference(relit, values):
    """Root of the mean squared difference over lamps and channels."""
    squares = [(a - b) ** 2 for at, (truth, _) in zip(relit, values) for a, b in zip(at, truth)]
    return math.sqrt(sum(squares) / len(squares))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--organza", required=True)
    organza = str(pathlib.Path(parser.parse_args().organza).resolve())
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "cloth.toml").write_text(FABRIC)
        subprocess.run([organza, "measure", "cloth.toml", "--layout", "ptm", "--texels", "12",
                        "--spp", "400", "--seed", str(SEED), "-o", "cloth.ptm", "--quiet"],
                       cwd=folder, check=True)
        ptm = Map((folder / "cloth.ptm").read_bytes())
        values = measured(organza, folder)
    failed = False
    for name, flags, is_good in [("the map", {}, True),
                                 ("twin: u and v swapped", {"swaps_axes": True}, False),
                                 ("twin: bias added", {"adds_bias": True}, False)]:
        relit = [ptm.mean_linear(t, p, **flags) for t, p in LAMPS]
        found = difference(relit, values)
        print(f"{name}: root mean square difference {found:.4f} of white, limit {LIMIT} "
              f"(seed {SEED})")
        failed |= (found < LIMIT) != is_good
    noise = max(max(se) for _, se in values)
    print(f"largest standard error of a measured value {noise:.5f}")
    if failed:
        sys.exit("ptm: a difference lies on the wrong side of the limit")


if __name__ == "__main__":
    main()
