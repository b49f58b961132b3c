"""Small inputs that the tests share."""

import copy
import os
import subprocess
import sys
from pathlib import Path

import pytest

import organza

ROOT = Path(__file__).resolve().parents[3]

FABRIC = {
    "draft": {"weave": "plain"},
    "warp": {"yarn": "silk", "per_cm": 40},
    "weft": {"yarn": "silk", "per_cm": 40},
    "yarn": {"silk": {"preset": "silk", "tex": 4.6}},
    "tile": {"repeats": [1, 1]},
    "voxel": {"size_um": 40.0},
}

SCENE = {
    "render": {"spp": 4},
    "camera": {
        "origin_mm": [0.2, 0.2, 3.0],
        "target_mm": [0.2, 0.2, 0.0],
        "width_mm": 1.0,
        "resolution": [12, 8],
    },
    "light": [{"kind": "environment", "radiance": [1.0, 0.9, 0.8]}],
}


@pytest.fixture
def fabric():
    return organza.Fabric(copy.deepcopy(FABRIC))


@pytest.fixture
def scene(fabric):
    scene = organza.Scene(copy.deepcopy(SCENE))
    scene["object"] = [{"kind": "cloth", "fabric": fabric}]
    return scene


@pytest.fixture
def command(tmp_path):
    """Runs the installed command in a folder of its own; returns what it printed."""

    def run(*arguments, status=0):
        program = Path(sys.executable).with_name("organza")
        words = [program, *map(os.fspath, arguments)]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == status, done.stderr
        return done.stdout + done.stderr

    return run


@pytest.fixture
def files(fabric, scene, tmp_path):
    """The fabric and the scene as files."""
    fabric.save(tmp_path / "plain.toml")
    scene = copy.deepcopy(scene)
    scene["object"][0]["fabric"] = "plain.toml"
    scene.save(tmp_path / "scene.toml")
    return tmp_path
