"""Writes the mesh of a lapped seam of heavy cloth: a panel whose edge is folded under lies on another
one. Millimetres, with texture coordinates in centimetres of cloth. Needs Python only.

    python3 seam.py
"""
from math import cos, pi, sin
from pathlib import Path

HERE = Path(__file__).parent
# Distance of the middles of layers, and how far they lap.
LAYER_MM, LAP_MM = 1.0, 7.0
# Where the upper panel comes down to the ground again.
DOWN_MM = (7.4, 11.5)
HALF_MM, STEP_MM = 16.0, 1.0


def smooth(a, b, x):
    t = min(max((x - a) / (b - a), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


def steps(a, b):
    count = max(1, round(abs(b - a) / STEP_MM))
    return [a + (b - a) * i / count for i in range(count + 1)]


def lower():
    """Points of the lower panel: place along the weft, x, height."""
    return [(x + 50.0, x, 0.0) for x in steps(-HALF_MM, LAP_MM - 0.2)]


def upper():
    """Points of the upper panel, from its folded edge on."""
    line = [(x, LAYER_MM) for x in steps(LAP_MM, 0.0)]
    turn = [pi * (0.5 + i / 6) for i in range(1, 6)]
    line += [(0.5 * LAYER_MM * cos(a), 1.5 * LAYER_MM - 0.5 * LAYER_MM * sin(a)) for a in turn]
    line += [(x, 2.0 * LAYER_MM * (1.0 - smooth(*DOWN_MM, x))) for x in steps(0.0, HALF_MM)]
    out, s = [], 0.0
    for i, (x, z) in enumerate(line):
        if i:
            s += ((x - line[i - 1][0]) ** 2 + (z - line[i - 1][1]) ** 2) ** 0.5
        out.append((s, x, z))
    return out


def sewn(x, y, z):
    """Cloth shrinks in the wash, and thread does not: the seam puckers, and its edge wavers."""
    near = smooth(-5.0, 0.0, x) * smooth(13.0, 8.0, x)
    high = z / (2.0 * LAYER_MM)
    pucker = 0.16 * sin(2 * pi * (y + 0.5 * x) / 6.3 + 0.6) + 0.10 * sin(2 * pi * (y - 0.7 * x) / 4.1)
    waver = 0.10 * sin(2 * pi * y / 9.0) + 0.05 * sin(2 * pi * y / 3.7 + 1.0)
    return x + waver * high * smooth(4.0, 0.0, x), y, z + near * high * pucker


def main():
    rows = steps(-HALF_MM, HALF_MM)
    lines = ["# Written by seam.py, millimetres; texture coordinates in centimetres.", "o seam"]
    faces, first = [], 1
    for panel in (lower(), upper()):
        for y in rows:
            lines += ["v %.3f %.3f %.3f" % sewn(x, y, z) for _, x, z in panel]
            lines += [f"vt {s / 10:.4f} {(y + 50) / 10:.4f}" for s, _, _ in panel]
        n = len(panel)
        for j in range(len(rows) - 1):
            for i in range(n - 1):
                a = first + j * n + i
                b, c, d = a + 1, a + n + 1, a + n
                faces.append(f"f {a}/{a} {b}/{b} {c}/{c} {d}/{d}")
        first += n * len(rows)
    (HERE / "seam.obj").write_text("\n".join(lines + faces) + "\n")


main()
