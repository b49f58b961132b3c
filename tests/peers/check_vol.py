"""Stock Mitsuba 3 loads organza's .vol grids, finds the same values in them, and
renders the medium that they describe.

    organza voxelize fabrics/denim.toml -o /tmp/tile.vol
    python tests/peers/check_vol.py /tmp/tile.sigma_t.vol /tmp/tile.sggx.vol /tmp/tile.albedo.vol

Needs `pip install mitsuba==3.9.1 numpy`. The picture must let through what
Beer-Lambert's law says: one column of voxels is integrated by hand. Exits with
1 at the first difference.
"""
import struct
import sys

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")


def read_vol(path):
    data = open(path, "rb").read()
    kind, version, number, x, y, z, channels = struct.unpack("<3sBiiiii", data[:24])
    assert (kind, version, number) == (b"VOL", 3, 1), path
    box = np.array(struct.unpack("<6f", data[24:48]))
    return box, np.frombuffer(data, "<f4", offset=48).reshape(z, y, x, channels)


def main(sigma_path, sggx_path, albedo_path):
    box, sigma = read_vol(sigma_path)
    for path, channels in [(sigma_path, 1), (sggx_path, 6), (albedo_path, 3)]:
        mine = read_vol(path)[1]
        theirs = np.array(mi.VolumeGrid(path)).reshape(mine.shape)
        assert mine.shape[3] == channels and np.array_equal(mine, theirs), path
    sggx = read_vol(sggx_path)[1]
    s = np.zeros(sggx.shape[:3] + (3, 3))
    for k, (i, j) in enumerate([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]):
        s[..., i, j] = s[..., j, i] = sggx[..., k]
    eigenvalues = np.linalg.eigvalsh(s)
    assert eigenvalues.min() > 0 and eigenvalues.max() <= 1 + 1e-5, (eigenvalues.min(), eigenvalues.max())
    # Transmittance straight down each column: exp(-sum sigma sqrt(S_zz) dz).
    dz = (box[5] - box[2]) / sigma.shape[0]
    depth = (sigma[..., 0] * np.sqrt(sggx[..., 2])).sum(0) * dz
    want = np.exp(-depth).mean()

    size, middle = box[3:] - box[:3], 0.5 * (box[3:] + box[:3])
    T = mi.ScalarTransform4f
    world = T().translate(list(box[:3])).scale(list(size))
    grid = lambda path: {"type": "gridvolume", "filename": path, "to_world": world, "filter_type": "nearest", "raw": True}
    n = 64
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": "volpath", "max_depth": 2},
        "sensor": {
            "type": "orthographic",
            "to_world": T().look_at(list(middle + [0, 0, size[2] + 1]), list(middle), [0, 1, 0]).scale([size[0] / 2, size[1] / 2, 1]),
            "film": {"type": "hdrfilm", "width": n, "height": n, "rfilter": {"type": "box"}, "pixel_format": "luminance"},
            "sampler": {"type": "independent", "sample_count": 64},
        },
        "medium": {
            "type": "cube",
            "to_world": T().translate(list(middle)).scale(list(size / 2)),
            "bsdf": {"type": "null"},
            "interior": {
                "type": "heterogeneous",
                "sigma_t": grid(sigma_path),
                "albedo": grid(albedo_path),
                "phase_function": {"type": "sggx", "S": grid(sggx_path)},
            },
        },
        "light": {"type": "rectangle", "to_world": T().translate([middle[0], middle[1], box[2] - 1]).scale([size[0], size[1], 1]),
                  "emitter": {"type": "area", "radiance": 1.0}},
    })
    # Straight through only: light that scattered comes at depth 3 and later.
    picture = np.array(mi.render(scene, seed=1))
    got = picture.mean()
    error = picture.std() / n
    assert abs(got - want) < 4 * error + 1e-3, (got, want, error)
    print(f"grids equal, S within (0, 1]; seen straight through: {got:.4f} +- {error:.4f}, by hand {want:.4f}")


if __name__ == "__main__":
    main(*sys.argv[1:4])
