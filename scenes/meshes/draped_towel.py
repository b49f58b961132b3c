"""Writes draped_towel.obj: a towel of 300 x 420 mm over a rail.

Over the rail the cloth is a half cylinder; below it hangs in folds. Across the
folds its slope is a sine of the distance along the weft, of an amplitude that
grows with the depth below the rail, so that the weft keeps its length; the warp
is straight but for the folds. One unit of texture coordinate is 100 mm.

    python3 draped_towel.py > draped_towel.obj
"""
from math import cos, pi, sin

WIDTH, LENGTH, RAIL, FOLD = 300.0, 420.0, 18.0, 60.0
STEEPEST = 0.75  # slope of the deepest folds, radians
COLUMNS, ROWS, FINE = 60, 48, 20


def across(depth, phase):
    """Places along and off the rail of every column at a depth below it."""
    x, y, points = -WIDTH / 2, 0.0, []
    share = min(depth / 150.0, 1.0)
    steepest = STEEPEST * share * share * (3 - 2 * share)
    step = WIDTH / COLUMNS / FINE
    for k in range(COLUMNS * FINE + 1):
        if k % FINE == 0:
            points.append((x, y))
        slope = steepest * sin(2 * pi * k * step / FOLD + phase)
        x, y = x + step * cos(slope), y + step * sin(slope)
    middle = points[COLUMNS // 2][0]
    offset = sum(p[1] for p in points) / len(points)
    return [(x - middle, y - offset) for x, y in points]


print("# A towel over a rail; written by draped_towel.py, millimetres.")
print("o towel")
for j in range(ROWS + 1):
    s = LENGTH * (j / ROWS - 0.5)
    bend = min(max(s / RAIL, -pi / 2), pi / 2)
    depth = max(abs(s) - RAIL * pi / 2, 0.0)
    side = 1 if s > 0 else -1
    for i, (x, off) in enumerate(across(depth, 0.0 if s > 0 else 1.3)):
        y = RAIL * sin(bend) + side * off
        z = RAIL * cos(bend) - depth
        print(f"v {x:.3f} {y:.3f} {z:.3f}")
for j in range(ROWS + 1):
    for i in range(COLUMNS + 1):
        print(f"vt {WIDTH * i / COLUMNS / 100:.4f} {LENGTH * j / ROWS / 100:.4f}")
for j in range(ROWS):
    for i in range(COLUMNS):
        a = j * (COLUMNS + 1) + i + 1
        b, c, d = a + 1, a + COLUMNS + 2, a + COLUMNS + 1
        print(f"f {a}/{a} {b}/{b} {c}/{c} {d}/{d}")
