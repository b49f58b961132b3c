"""The module's arrays equal what the command writes, bit for bit."""

import csv

import numpy as np
import OpenEXR
import pytest

import organza

CHANNELS = {
    "rgb": ["R", "G", "B"],
    "variance": ["variance.R", "variance.G", "variance.B"],
    "tangent": ["tangent.X", "tangent.Y", "tangent.Z"],
    "yarn": ["yarn"],
    "depth_mm": ["depth_mm"],
    "bounces": ["bounces"],
    "through": ["through"],
}


def exr(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels.copy() for name, channel in file.channels().items()}


def bits(array):
    return np.ascontiguousarray(array).view(f"u{array.dtype.itemsize}").tolist()


def table(path):
    with open(path, newline="") as file:
        header, *rows = csv.reader(file)
    columns = np.array(rows, dtype=float).T
    return dict(zip(header, columns))


@pytest.mark.parametrize("engine", ["cpu", "walk"])
@pytest.mark.parametrize("source", ["dictionary", "loaded", "path"])
def test_picture(files, scene, command, engine, source):
    flags = ["--spp", "5", "--seed", "3", "--engine", engine]
    command("render", "scene.toml", "-o", "out.exr", *flags)
    path = files / "scene.toml"
    given = {"dictionary": scene, "loaded": organza.load(path), "path": path}[source]
    found = organza.render(given, spp=5, seed=3, engine=engine)
    expected = exr(files / "out.exr")
    for name, channels in CHANNELS.items():
        assert found[name].dtype == np.float32
        for channel, own in zip(channels, np.atleast_3d(found[name]).transpose(2, 0, 1)):
            assert bits(own) == bits(expected[channel]), channel
    # The twin: another seed gives another picture.
    other = organza.render(given, spp=5, seed=4, engine=engine)
    assert bits(other["rgb"]) != bits(found["rgb"])


def test_threads_and_parts_change_nothing(scene):
    whole = organza.render(scene, spp=4, seed=1)
    one = organza.render(scene, spp=4, seed=1, threads=1)
    assert bits(one["rgb"]) == bits(whole["rgb"])
    part = organza.render(scene, spp=4, seed=1, crop=(2, 1, 7, 5))
    assert bits(part["rgb"]) == bits(whole["rgb"][1:5, 2:7])


def test_written_picture(scene, command, tmp_path):
    found = organza.render(scene, spp=2, outfile=tmp_path / "out.exr")
    assert bits(exr(tmp_path / "out.exr")["G"]) == bits(found["rgb"][..., 1])


def test_table_of_pairs(files, fabric, command):
    command("measure", "plain.toml", "--layout", "grid", "--grid", "2,3", "--spp", "64",
            "--seed", "5", "-o", "out.csv")  # fmt: skip
    expected = table(files / "out.csv")
    found = organza.measure(fabric, layout="grid", grid=(2, 3), spp=64, seed=5)
    for name in ["theta_i", "phi_i", "theta_o", "phi_o"]:
        assert bits(found[name]) == bits(expected[name])
    for c, channel in enumerate("rgb"):
        assert bits(found["rgb"][:, c]) == bits(expected[channel])
        assert bits(found["se_rgb"][:, c]) == bits(expected["se_" + channel])
    # The same directions as an array.
    angles = [found[name] for name in ["theta_i", "phi_i", "theta_o", "phi_o"]]
    again = organza.measure(fabric, np.stack(angles, axis=1), spp=64, seed=5)
    assert bits(again["rgb"]) == bits(found["rgb"])


def test_table_of_albedos(files, fabric, command):
    flags = ["--layout", "grid", "--grid", "2,2", "--albedo", "--spp", "64"]
    command("measure", "plain.toml", *flags, "-o", "out.csv")
    expected = table(files / "out.csv")
    found = organza.measure(fabric, layout="grid", grid=(2, 2), albedo=True, spp=64)
    for part in ["reflected", "transmitted", "direct", "absorbed"]:
        for c, channel in enumerate("rgb"):
            assert bits(found[part][:, c]) == bits(expected[f"{part}_{channel}"])
            assert bits(found[f"se_{part}"][:, c]) == bits(expected[f"se_{part}_{channel}"])
    assert 0 < found["openness"] < 1


def test_volume(files, fabric, command):
    command("voxelize", "plain.toml", "-o", "volume.ovox")
    volume = organza.voxelize(fabric)
    read = organza.load(files / "volume.ovox")
    for name, array in volume.level(0).items():
        assert bits(array) == bits(read.level(0)[name]), name


def test_comparison(files, fabric, command):
    flags = ["--spp", "8", "--texels", "8", "--texel-spp", "2"]
    command("compare", "plain.toml", "-o", "report", "--models", "microflake,packed", *flags)
    found = organza.compare(fabric, ["microflake", "packed"], spp=8, texels=8, texel_spp=2)
    with open(files / "report" / "pairs.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert set(found["values"]) == {"microflake", "packed"}
    for model, values in found["values"].items():
        # The pairs of the layout come first, then those in the plane of the light.
        own = [row for row in rows if row["model"] == model][: len(values["rgb"])]
        expected = np.array([[float(row[channel]) for channel in "rgb"] for row in own])
        assert bits(values["rgb"]) == bits(expected), model
    assert found["report"]["reference"] == "microflake"


def test_fit(files, fabric, command):
    data = organza.measure(fabric, layout="grid", grid=(2, 2), spp=256)
    command("measure", "plain.toml", "--layout", "grid", "--grid", "2,2", "--spp", "256",
            "-o", "data.csv")  # fmt: skip
    command("fit", "surface", "plain.toml", "--data", "data.csv", "--patience", "8,20", "-o", "fitted.toml")
    found = organza.fit(fabric, data=data, patience=(8, 20))
    expected = organza.load(files / "fitted.toml")
    assert found["fabric"] == expected
    assert {p["name"] for p in found["parameters"]} and "%" in found["words"]


def test_baked_files(files, fabric, command):
    few = {"resolution": 16, "texel_spp": 4, "pairs": 64, "spp": 8, "fit_texels": 16}
    flags = [f"--{name.replace('_', '-')}={value}" for name, value in few.items()]
    command("bake", "plain.toml", "-o", "material", "--model", "microflake", *flags)
    fabric["name"] = "plain"  # the command has it from the name of the file
    found = organza.bake(fabric, model="microflake", **few)
    assert "material.glb" in found["files"] and found["base_color"].shape[2] == 3
    for name, data in found["files"].items():
        if name != "bake.json":  # which names the fabric's file
            assert (files / "material" / name).read_bytes() == data, name
