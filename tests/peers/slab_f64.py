"""The slab of tests/data/slab_mitsuba.csv once more, in double precision.

A walk of its own, in 64 bits, through an endless homogeneous slab of SGGX fibres
[Heitz2015]: axis (1, 0, 0), end-on ratio 0.2, 20 per mm broadside, 0.3 mm thick,
albedo 0.95, 0.8, 0.5. Light is gathered at every collision in closed form, and
directions are drawn from visible normals.

    python3 tests/peers/slab_f64.py 4000000 > tests/data/slab_f64.csv   # needs NumPy
"""

import pathlib
import sys

import numpy as np

S = np.array([0.04, 1.0, 1.0])
SIGMA_T_PER_MM, THICKNESS_MM = 20.0, 0.3
ALBEDO = np.array([0.95, 0.8, 0.5])
BATCH = 200_000


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def extinction(w):
    """Extinction along w, 1/mm."""
    return SIGMA_T_PER_MM * np.sqrt((w * w * S).sum(-1))


def phase(w_out, w_in):
    """Specular SGGX phase function, 1/sr."""
    h = unit(w_out + w_in)
    normals = 1 / (np.pi * np.sqrt(S.prod()) * (h * h / S).sum(-1) ** 2)
    return normals * SIGMA_T_PER_MM / (4 * extinction(w_out))


def scatter(w_out, rng):
    """Mirrors w_out at a visible normal: a disk seen by a sphere, stretched."""
    seen = unit(np.sqrt(S) * w_out)
    helper = np.where(np.abs(seen[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    x = unit(np.cross(seen, helper))
    y = np.cross(seen, x)
    r2, phi = rng.random(len(seen)), 2 * np.pi * rng.random(len(seen))
    disk = (np.sqrt(r2) * [np.cos(phi), np.sin(phi)])[..., None]
    normal = unit(np.sqrt(S) * (disk[0] * x + disk[1] * y + np.sqrt(1 - r2)[:, None] * seen))
    return 2 * (w_out * normal).sum(-1, keepdims=True) * normal - w_out


def direction(theta_deg, phi_deg):
    theta, phi = np.radians(theta_deg), np.radians(phi_deg)
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def bsdf(pair, rng):
    """One batch of paths from the eye: mean and its variance per channel."""
    w_i, w_o = direction(*pair[:2]), direction(*pair[2:])
    value = np.zeros((BATCH, 3))
    path = np.arange(BATCH)
    z = np.full(BATCH, THICKNESS_MM if w_o[2] > 0 else 0.0)
    w = np.tile(-w_o, (BATCH, 1))
    weight = np.ones((BATCH, 3))
    while len(path):
        z = z - np.log1p(-rng.random(len(path))) / extinction(w) * w[:, 2]
        inside = (z > 0) & (z < THICKNESS_MM)
        path, z, w, weight = path[inside], z[inside], w[inside], weight[inside] * ALBEDO
        to_light = ((THICKNESS_MM if w_i[2] > 0 else 0.0) - z) / w_i[2]
        seen = phase(-w, w_i[None]) * np.exp(-extinction(w_i) * to_light)
        value[path] += weight * seen[:, None]
        w = scatter(-w, rng)
        chance = np.minimum(1, 4 * weight.max(1, initial=0))
        lives = rng.random(len(path)) < chance
        path, z, w, weight = path[lives], z[lives], w[lives], (weight / chance[:, None])[lives]
    value /= abs(w_i[2])
    return value.mean(0), value.var(0) / BATCH


def main():
    batches = max(1, int(sys.argv[1]) // BATCH)
    rng = np.random.default_rng(20261121)
    table = pathlib.Path(__file__).parents[1] / "data/slab_mitsuba.csv"
    header, *rows = (line for line in table.read_text().split("\n") if line[:1] not in ("#", ""))
    print("# BSDF of the slab of slab_mitsuba.csv, computed in double precision by tests/peers/slab_f64.py. Degrees; 1/sr.")
    print(header)
    for row in rows:
        pair = row.split(",")[:4]
        samples = [bsdf([float(x) for x in pair], rng) for _ in range(batches)]
        mean, variance = np.array(samples).mean(0)
        figures = [*mean, *np.sqrt(variance / batches)]
        print(",".join([*pair, *(f"{x:.6g}" for x in figures)]), flush=True)


if __name__ == "__main__":
    main()
