"""Writes ../fabrics/lace.txt: the threads of a lace of 40 mm, in millimetres: a net of
hexagons, flowers of cloth work within thick outlines, and stems. One line `x y z radius` per
point, an empty line between threads. Needs Python only.

    python3 lace.py
"""
from math import atan2, cos, hypot, pi, sin
from pathlib import Path
from random import Random

SIDE, CELL, RISE = 40.0, 1.7, 2.0  # millimetres: sides, width and height of a mesh of the net
NET, FILL, OUTLINE = 0.075, 0.085, 0.13  # radii of threads
ASIDE = (-0.24, 0.0, 0.24)  # an outline is three threads beside each other
# Place, radius, number of petals, turn.
FLOWERS = [
    (11.0, 12.5, 6.6, 5, 0.3),
    (29.0, 27.0, 7.4, 6, 0.0),
    (29.5, 8.0, 4.6, 5, 1.0),
    (9.0, 31.5, 4.8, 6, 0.5),
]
noise = Random(7)


def edge(flower, angle):
    """Radius of the outline of a flower."""
    _, _, radius, petals, turn = flower
    return radius * (0.70 + 0.30 * abs(cos(petals / 2 * (angle + turn))) ** 0.7)


def is_inside(flower, x, y):
    dx, dy = x - flower[0], y - flower[1]
    distance = hypot(dx, dy)
    return 0.16 * flower[2] < distance < edge(flower, atan2(dy, dx))


def in_any(x, y):
    return any(hypot(x - f[0], y - f[1]) < edge(f, atan2(y - f[1], x - f[0])) for f in FLOWERS)


def net():
    """Zigzags that meet their neighbours in the upright sides of the meshes."""
    for k in range(int(SIDE / CELL) + 2):
        side = 1 if k % 2 else -1
        points, y = [], 0.0
        while y <= SIDE:
            phase = (y / RISE) % 1.0
            # Joined to the left, crossing, joined to the right, crossing back.
            bend = min(max((abs(phase - 0.5) - 0.25) / 0.14, -1.0), 1.0)
            x = (k - 0.5) * CELL + side * bend * (CELL / 2 - NET) + noise.gauss(0, 0.012)
            z = NET * sin(6 * pi * y / RISE) * 0.9
            if in_any(x, y) or not 0.0 <= x <= SIDE:
                yield points
                points = []
            else:
                points.append((x, y, z, NET))
            y += RISE / 10
        yield points


def fill(flower):
    """Cloth work: rows across a flower, which waver, over and under one another in turn."""
    for direction in (0, 1):
        place = -flower[2]
        row = 0
        while place < flower[2]:
            points, along = [], -flower[2]
            while along < flower[2]:
                u = place + 0.03 * sin(1.7 * along + row)
                dx, dy = (along, u) if direction == 0 else (u, along)
                x, y = flower[0] + dx, flower[1] + dy
                if is_inside(flower, x, y) and 0.0 <= x <= SIDE and 0.0 <= y <= SIDE:
                    z = FILL * (1 if direction else -1) * cos(pi * (along / 0.34 + row))
                    points.append((x, y, z, FILL))
                else:
                    yield points
                    points = []
                along += 0.17
            yield points
            place += 0.34 + noise.gauss(0, 0.012)
            row += 1


def ring(flower, share):
    """The outline of a flower, or of its eye."""
    for aside in ASIDE:
        points = []
        for k in range(91):
            angle = 2 * pi * k / 90
            radius = (edge(flower, angle) if share == 1.0 else share * flower[2]) + aside
            place = (flower[0] + radius * cos(angle), flower[1] + radius * sin(angle))
            points.append((*place, 0.14, OUTLINE))
        yield points


def stem(a, b, bend):
    """A curve from one flower to another."""
    for aside in ASIDE:
        points = []
        for k in range(41):
            t = k / 40
            x = a[0] + (b[0] - a[0]) * t + bend * sin(pi * t) + aside
            y = a[1] + (b[1] - a[1]) * t + 0.6 * bend * sin(2 * pi * t)
            if not in_any(x, y):
                points.append((x, y, 0.14, OUTLINE))
            elif points:
                yield points
                points = []
        yield points


def main():
    threads = list(net())
    for flower in FLOWERS:
        threads += [*fill(flower), *ring(flower, 1.0), *ring(flower, 0.16)]
    for a, b, bend in ((0, 1, 4.0), (0, 2, -3.0), (3, 1, 3.0), (0, 3, -3.5)):
        threads += stem(FLOWERS[a], FLOWERS[b], bend)
    lines = []
    for points in threads:
        if len(points) > 2:
            lines += [f"{x:.2f} {y:.2f} {z:.2f} {r:.3g}" for x, y, z, r in points] + [""]
    (Path(__file__).parent / "../fabrics/lace.txt").write_text("\n".join(lines))


main()
