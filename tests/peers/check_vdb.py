"""OpenVDB's own library reads an organza .vdb file and finds the values of the
.vol grids made from the same octree level.

    organza voxelize fabrics/denim.toml -o /tmp/tile.vdb
    organza voxelize fabrics/denim.toml -o /tmp/tile.vol
    /usr/bin/python3 tests/peers/check_vdb.py /tmp/tile.vdb /tmp/tile.sigma_t.vol /tmp/tile.sggx.vol

Needs Debian's python3-openvdb (it imports under the system's Python only) and
libopenvdb-tools (vdb_print). Exits with 1 at the first difference.
"""
import array
import struct
import subprocess
import sys

import pyopenvdb as vdb


def read_vol(path):
    data = open(path, "rb").read()
    kind, version, number, x, y, z, channels = struct.unpack("<3sBiiiii", data[:24])
    assert (kind, version, number) == (b"VOL", 3, 1), path
    box = struct.unpack("<6f", data[24:48])
    values = array.array("f")
    values.frombytes(data[48:])
    assert len(values) == x * y * z * channels
    return (x, y, z), channels, box, values


def main(vdb_path, sigma_path, sggx_path):
    shown = subprocess.run(["vdb_print", vdb_path], check=True, capture_output=True, text=True).stdout
    assert "yarn" in shown, shown
    print(shown)
    # The Python module has no 32-bit integer grids; vdb_print has shown "yarn".
    names = ["density", "orientation", "spread", "sggx_diag", "sggx_offdiag"]
    grids = {name: vdb.read(vdb_path, name) for name in names}
    dims, _, box, sigma = read_vol(sigma_path)
    _, _, _, sggx = read_vol(sggx_path)
    edge = [(box[3 + k] - box[k]) / dims[k] for k in range(3)]
    access = {n: g.getConstAccessor() for n, g in grids.items()}
    relative = 1e-3 if grids["density"].saveFloatAsHalf else 1e-6
    active = 0
    for z in range(dims[2]):
        for y in range(dims[1]):
            for x in range(dims[0]):
                at = x + dims[0] * (y + dims[1] * z)
                value, on = access["density"].probeValue((x, y, z))
                assert abs(value - sigma[at]) <= relative * abs(sigma[at]), (x, y, z, value, sigma[at])
                assert on or sigma[at] == 0.0, (x, y, z)
                if not on:
                    continue
                active += 1
                got = list(access["sggx_diag"].getValue((x, y, z))) + list(access["sggx_offdiag"].getValue((x, y, z)))
                want = sggx[6 * at : 6 * at + 6]
                assert all(abs(a - b) <= relative for a, b in zip(got, want)), (x, y, z, got, list(want))
                axis = access["orientation"].getValue((x, y, z))
                assert abs(sum(c * c for c in axis) - 1.0) <= 4 * relative, (x, y, z, axis)
    for name, g in grids.items():
        assert g.activeVoxelCount() == active, (name, g.activeVoxelCount(), active)
        for corner in [(0, 0, 0), (dims[0] - 1, dims[1] - 1, dims[2] - 1)]:
            world = g.transform.indexToWorld(corner)
            for k in range(3):
                centre = box[k] + (corner[k] + 0.5) * edge[k]
                assert abs(world[k] - centre) < 1e-5 * (1 + abs(centre)), (name, corner, world, centre)
    print(f"{vdb_path}: {active} active voxels agree in all {len(grids)} grids")


if __name__ == "__main__":
    main(*sys.argv[1:4])
