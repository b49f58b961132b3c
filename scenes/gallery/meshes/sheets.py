"""Writes the meshes of the gallery: sheets of cloth in folds and creases, in millimetres,
with texture coordinates in centimetres of cloth. Needs Python only.

Every row of a sheet is a curve whose slope is a function of the length along the weft, so
the weft keeps its length; the warp stretches little, where slopes change from row to row.

    python3 sheets.py
"""
from math import cos, exp, pi, sin
from pathlib import Path

HERE = Path(__file__).parent


def smooth(a, b, x):
    t = min(max((x - a) / (b - a), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


def row(places, slope, t):
    """Points (x, z) of a row at the places s along the weft; (0, 0) at s = 0."""
    found = {}
    for side in (1, -1):
        s, x, z = 0.0, 0.0, 0.0
        for place in sorted((p for p in places if p * side >= 0.0), key=abs):
            count = max(1, round(abs(place - s) / 0.3))
            step = (place - s) / count
            for _ in range(count):
                angle = slope(s + step / 2, t)
                s, x, z = s + step, x + step * cos(angle), z + step * sin(angle)
            s = place
            found[place] = (x, z)
    return [found[place] for place in places]


def even(span, count):
    return [span[0] + (span[1] - span[0]) * i / count for i in range(count + 1)]


def write(name, places, reach, count, slope, lift=lambda s, t: 0.0, origin=100):
    """A sheet with vertices at `places` along the weft, whose warp spans `reach`; the cloth begins
    `origin` before the middle."""
    columns = len(places) - 1
    lines = ["# Written by sheets.py, millimetres; texture coordinates in centimetres."]
    lines.append(f"o {name}")
    warp = even(reach, count)
    for t in warp:
        points = zip(places, row(places, slope, t))
        lines += [f"v {x:.2f} {t:.2f} {z + lift(s, t):.3f}" for s, (x, z) in points]
    lines += [f"vt {(s + origin) / 10:.3f} {(t + origin) / 10:.3f}" for t in warp for s in places]
    for j in range(count):
        for i in range(columns):
            a = j * (columns + 1) + i + 1
            b, c, d = a + 1, a + columns + 2, a + columns + 1
            lines.append(f"f {a}/{a} {b}/{b} {c}/{c} {d}/{d}")
    (HERE / f"{name}.obj").write_text("\n".join(lines) + "\n")


def swell(s, t):
    """Soft waves, for cloth that lies on a table."""
    return 0.26 * sin(2 * pi * (s + 0.45 * t) / 34.0) + 0.12 * sin(2 * pi * (s - 0.8 * t) / 23.0 + 1.0)


def hanging(s, t):
    """Folds of a light curtain, which widen downwards."""
    phase = 2 * pi * (s + 0.9 * sin(t / 17.0)) / (15.0 - 0.03 * t)
    return (0.5 + 0.2 * sin(s / 9.0 + 0.6)) * sin(phase + 0.8 * sin(s / 7.0))


def billow(s, t):
    """A sail in the wind: one wide curve and faint wrinkles that lead to a corner."""
    return -0.006 * s + 0.30 * sin(2 * pi * (s + 0.8 * t) / 31.0) * smooth(60.0, -60.0, t)


def pucker(s, t):
    """What a seam along the warp draws up, more of it at some places."""
    waves = sin(2 * pi * t / 9.3 + 0.8 * sin(t / 6.0)) + 0.6 * sin(2 * pi * t / 5.1 + 0.5)
    return 0.13 * waves * exp(-((s / 8.0) ** 2))


def shirt(s, t):
    """Soft folds that fall from the shoulder and die out at the placket."""
    away = smooth(14.0, 40.0, abs(s))
    fall = sin(2 * pi * (s + 0.45 * t * (1 if s < 0 else -1)) / 33.0 + 1.1 * sin(t / 40.0))
    small = 0.16 * sin(2 * pi * (s + 1.4 * t) / 29.0 + sin(t / 13.0))
    return 0.85 * away * fall * smooth(-110.0, 50.0, t) + small * (0.3 + 0.7 * away)


# Where the cloth of the placket is folded under, and the length of the turn.
EDGE, TURN = 14.0, 1.0


def placket(s, t):
    """The shirt's folds, and both edges folded under."""
    under = pi * min(max((abs(s) - EDGE) / TURN, 0.0), 1.0)
    return shirt(s, t) + (under if s < 0.0 else -under)


def pressed(s, t):
    """One side of a crease along the warp: the cloth rises to it like a low roof."""
    return -0.42 * (2.0 * smooth(-1.1, 1.1, s) - 1.0) * exp(-abs(s) / 16.0) + 0.5 * swell(s, t)


def crosswise(s, t):
    """The crease along the weft, sunk where the other one is raised."""
    return -2.6 * exp(-((t - 4.0) ** 2 + 0.6) ** 0.5 / 9.0) + 0.4 * sin(s / 13.0)


def main():
    write("swell", even((-40.0, 40.0), 48), (-40.0, 40.0), 48, swell)
    write("lace", even((-20.0, 20.0), 100), (-20.0, 20.0), 16, hanging, origin=20)
    write("sail", even((-36.0, 6.0), 42), (-34.0, 34.0), 68, billow, pucker)
    write("sail_lap", even((-6.0, 36.0), 42), (-34.0, 34.0), 68, billow, lambda s, t: pucker(s, t) - 0.24)
    write("shirt", even((-95.0, 95.0), 120), (-75.0, 75.0), 88, shirt)
    right = even((0.0, EDGE), 10)[:-1] + even((EDGE, EDGE + TURN), 8) + [EDGE + TURN + 1.5, EDGE + TURN + 3.0]
    places = [-s for s in right[:0:-1]] + right
    write("placket", places, (-75.0, 75.0), 88, placket, lambda s, t: 1.3 - 0.003 * min(abs(s), EDGE) ** 2)
    write("napkin", even((-40.0, 40.0), 112), (-40.0, 40.0), 96, pressed, crosswise)


if __name__ == "__main__":
    main()
