"""Scenes, fabrics, drafts and volumes as Python objects."""

import copy
import pickle
import pydoc
import warnings

import numpy as np
import pytest

import organza
from organza import _toml

from conftest import ROOT


def test_a_loaded_file_keeps_every_number(tmp_path):
    for path in sorted((ROOT / "scenes").rglob("*.toml")):
        table = organza.load(path)
        table.save(tmp_path / path.name)
        again = organza.load(tmp_path / path.name)
        assert again == table, path
        assert type(again) is type(table)


def test_numbers_survive_toml(tmp_path):
    rng = np.random.default_rng(7)
    numbers = rng.random(200) * 10.0 ** rng.integers(-12, 12, 200)
    text = _toml.text({"a": numbers, "b": {"c": np.float32(0.1), "d e": True, "f": 2**62}})
    lines = text.splitlines()
    assert eval(lines[0].partition("= ")[2]) == numbers.tolist()
    assert float(lines[2].partition("= ")[2]) == np.float32(0.1)
    assert lines[3:] == ['"d e" = true', f"f = {2**62}"]
    assert _toml.value('"\\\n\x00', "k") == '"\\"\\\\\\n\\u0000"'
    with pytest.raises(organza.InputError, match=r"a\.b\[1\]: expected a text, .* found object"):
        _toml.text({"a": {"b": [1, object()]}})


def test_names_in_a_loaded_fabric_begin_at_its_folder(scene):
    loaded = organza.load(ROOT / "scenes" / "fabrics" / "towel.toml")
    scene["object"][0]["fabric"] = loaded
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        organza.render(scene, spp=1, set={"object.0.voxel_um": 80.0, "render.max_bounces": 4})


def test_two_fabrics_in_memory(scene, fabric):
    one = organza.render(scene, spp=2)["rgb"]
    other = copy.deepcopy(fabric)
    other["warp"]["per_cm"] = 20
    scene["object"].append({"kind": "cloth", "fabric": other})
    both = organza.render(scene, spp=2)["rgb"]
    assert not np.array_equal(one, both)


def test_drafts(fabric):
    twill = organza.Draft.named("twill-3-1-s")
    assert (twill.ends, twill.picks) == twill.warp_up.shape[::-1] == (4, 4)
    assert twill.warp_up.mean() == 0.75
    assert np.array_equal(organza.Draft(twill.warp_up).warp_up, twill.warp_up)
    rows = organza.Draft(["X...", ".X..", "..X.", "...X"])
    # As seen on the face: the last row is the first pick.
    assert np.array_equal(rows.warp_up, np.eye(4, dtype=bool)[::-1])
    wif = next((ROOT / "scenes" / "drafts").glob("*.wif"))
    for draft in [twill, rows, organza.load(wif), organza.Draft.from_wif(wif.read_bytes())]:
        assert draft.picture().shape == (draft.picks, draft.ends, 3)
    fabric["draft"] = rows
    by_rows = organza.measure(fabric, [[20, 0, 30, 180]], spp=64)
    fabric["draft"] = {"drawdown": ["X...", ".X..", "..X.", "...X"]}
    by_table = organza.measure(fabric, [[20, 0, 30, 180]], spp=64)
    assert np.array_equal(by_rows["rgb"], by_table["rgb"])
    with pytest.raises(organza.InputError, match="twil"):
        organza.Draft.named("twil-3-1-s")


def test_a_draft_with_colours_in_memory(fabric):
    wif = next((ROOT / "scenes" / "drafts").glob("*.wif"))
    fabric["voxel"]["size_um"] = 100.0
    pairs = [[20, 0, 30, 180]]
    fabric["draft"] = {"wif": str(wif)}
    on_disk = organza.measure(fabric, pairs, spp=16)
    fabric["draft"] = organza.Draft.from_wif(wif.read_bytes())
    in_memory = organza.measure(fabric, pairs, spp=16)
    assert np.array_equal(on_disk["rgb"], in_memory["rgb"])


def test_voxelized_volume(fabric, scene):
    volume = organza.voxelize(fabric, voxel_um=40)
    cells = volume.density.shape
    assert volume.axis.shape == (*cells, 3) and volume.spread.shape == cells
    assert volume.repeats and volume.level_count >= 1
    there = volume.density > 0
    assert there.any() and (volume.materials >= 0)[there].all()
    assert (volume.materials[~there] == -1).all()
    lengths = np.linalg.norm(volume.axis[there], axis=-1)
    # Axes are stored in 16 bits.
    assert np.allclose(lengths, 1, atol=1e-3)
    with pytest.raises(ValueError, match="read-only"):
        volume.density[:] = 0
    for level in (-1, volume.level_count, 300):
        with pytest.raises(organza.InputError, match="level"):
            volume.level(level)
    # Shown in a scene, it is its fabric's picture.
    cloth = organza.render(scene, spp=2, set={"object.0.voxel_um": 40.0})["rgb"]
    scene["object"] = [{"kind": "volume", "file": volume}]
    assert np.array_equal(organza.render(scene, spp=2)["rgb"], cloth)


def test_volume_of_arrays(scene):
    rng = np.random.default_rng(3)
    density = rng.random((4, 5, 6), dtype=np.float32)
    axis = rng.normal(size=(4, 5, 6, 3)).astype(np.float32)
    volume = organza.Volume(
        density=density, axis=axis, spread=0.2, albedo=(0.9, 0.5, 0.2),
        bounds_mm=((0, 0, 0), (0.6, 0.5, 0.4)),
    )  # fmt: skip
    assert np.array_equal(volume.density, density)
    assert np.array_equal(volume.axis, axis)
    assert np.array_equal(volume.spread, np.full_like(density, 0.2))
    assert volume.level(0)["albedo"].shape == (4, 5, 6, 3)
    assert np.allclose(volume.bounds_mm, [[0, 0, 0], [0.6, 0.5, 0.4]], atol=1e-6)
    scene["object"] = [{"kind": "volume", "file": volume}]
    light = organza.render(scene, spp=4)
    assert np.isfinite(light["rgb"]).all() and (light["through"] < 1).any()
    # The known-bad twin: a denser volume lets less through.
    dense = organza.Volume(density=50 * density, albedo=(0.9, 0.5, 0.2), bounds_mm=volume.bounds_mm)
    scene["object"][0]["file"] = dense
    assert organza.render(scene, spp=4)["through"].mean() < light["through"].mean()
    with pytest.raises(organza.InputError, match=r"axis: expected the shape \(4, 5, 6, 3\)"):
        organza.Volume(density=density, axis=axis[0], bounds_mm=volume.bounds_mm)


def test_everything_is_described():
    for name in organza.__all__:
        thing = getattr(organza, name)
        text = pydoc.render_doc(thing) if name != "__version__" else "x" * 100
        assert len(text) > 90, name
        members = vars(thing).items() if isinstance(thing, type) else []
        for member, value in members:
            if not member.startswith("_") and (callable(value) or isinstance(value, property)):
                assert value.__doc__, f"{name}.{member}"


def test_exceptions_can_be_sent_to_other_processes():
    error = organza.InputError("a: b: c", "a", 1, 2, "b", "c")
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), vars(again)) == (str(error), vars(error))
