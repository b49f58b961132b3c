"""Errors, warnings, progress, interrupts and threads."""

import copy
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest

import organza

from conftest import SCENE


def failure(action, *arguments, **options):
    with pytest.raises(organza.InputError) as caught:
        action(*arguments, **options)
    assert isinstance(caught.value, ValueError)
    assert "\n" not in str(caught.value)
    return caught.value


def test_wrong_keys_of_dictionaries(scene, fabric):
    scene["camera"]["widht_mm"] = scene["camera"].pop("width_mm")
    for action in (organza.load, organza.render):
        e = failure(action, scene)
        assert (e.file, e.line) == ("<scene>", None)
        assert e.key.startswith("camera") and "did you mean `width_mm`" in e.message
    fabric["yarn"]["silk"]["preset"] = "slik"
    e = failure(organza.voxelize, fabric)
    assert e.file == "<fabric>" and "`silk`" in e.message.replace('"', "`")


def test_wrong_files_have_places(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text("[camera]\nwidht_mm = 1\n")
    e = failure(organza.load, path)
    assert (e.file, e.line, e.column) == (str(path), 2, 1)
    assert e.key == "camera.widht_mm"
    for name in ["none.toml", "none.wif", "none.ovox"]:
        assert failure(organza.load, tmp_path / name).file == str(tmp_path / name)


def test_wrong_arguments(scene, fabric):
    assert failure(organza.render, scene, spp=0).key == "spp"
    assert failure(organza.voxelize, fabric, voxel_um=-1).key == "voxel_um"
    assert "frie" in str(failure(organza.measure, fabric, model="frie"))
    assert failure(organza.measure, fabric, [[1, 2, 3]]).key == "pairs"
    assert failure(organza.fit, fabric, data={"rgb": []}).key == "data"
    e = failure(organza.measure, fabric, [[95, 0, 200, 0]])
    assert (e.file, e.line, e.key) == ("<pairs>.csv", 2, "theta_o")
    with pytest.raises(TypeError):
        organza.render(scene, sspp=3)


def test_warnings_are_python_warnings(scene):
    del scene["light"]
    with pytest.warns(organza.OrganzaWarning, match="there is no"):
        organza.render(scene, spp=1)


def test_progress_is_reported_in_the_thread_of_the_caller(scene):
    seen = []

    def progress(task, share):
        assert threading.current_thread() is threading.main_thread()
        assert 0 <= share <= 1
        seen.append((task, share))

    organza.render(scene, spp=2000, progress=progress)
    assert "rendering" in {task for task, _ in seen}
    shares = [share for task, share in seen if task == "rendering"]
    assert shares == sorted(shares)


class Enough(Exception):
    pass


def test_what_progress_raises_stops_the_command(scene):
    def progress(task, share):
        raise Enough

    began = time.monotonic()
    with pytest.raises(Enough):
        organza.render(scene, spp=4_000_000, progress=progress)
    assert time.monotonic() - began < 20


@pytest.mark.skipif(os.name == "nt", reason="signals of Unix")
@pytest.mark.parametrize("action", ["render(scene, spp=4_000_000)", "measure(fabric)", "fit(fabric)"])
def test_ctrl_c_stops(action, scene, fabric, tmp_path):
    fabric.save(tmp_path / "plain.toml")
    program = textwrap.dedent(f"""
        import organza
        fabric = organza.load("plain.toml")
        fabric["voxel"]["size_um"] = 20.0
        scene = organza.Scene({SCENE!r})
        scene["object"] = [dict(kind="cloth", fabric=fabric)]
        print("begins", flush=True)
        try:
            organza.{action}
        except KeyboardInterrupt:
            print("interrupted", flush=True)
    """)
    child = subprocess.Popen(
        [sys.executable, "-c", program], cwd=tmp_path, stdout=subprocess.PIPE, text=True
    )
    assert child.stdout.readline() == "begins\n"
    time.sleep(1.0)
    child.send_signal(signal.SIGINT)
    out, _ = child.communicate(timeout=60)
    assert (out, child.returncode) == ("interrupted\n", 0)
    assert sorted(os.listdir(tmp_path)) == ["plain.toml"]


def test_other_threads_run_meanwhile(scene):
    count, done = 0, threading.Event()

    def work():
        nonlocal count
        while not done.is_set():
            count += 1
            time.sleep(0.001)

    thread = threading.Thread(target=work)
    thread.start()
    began = time.monotonic()
    organza.render(scene, spp=3000)
    seconds = time.monotonic() - began
    done.set()
    thread.join()
    # With the lock held the other thread would stand still; it wakes a thousand times a second
    # on an idle machine, and a hundredth of that shows that it runs.
    assert count > 10 * seconds


def test_several_renders_at_once(scene):
    alone = [organza.render(scene, spp=8, seed=s)["rgb"] for s in range(4)]
    found = [None] * 4

    def work(s):
        found[s] = organza.render(copy.deepcopy(scene), spp=8, seed=s)["rgb"]

    threads = [threading.Thread(target=work, args=(s,)) for s in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(a, b) for a, b in zip(alone, found))


def test_the_command(command):
    assert command("--version") == f"organza {organza.__version__}\n"
    assert "expected" in command("render", "none.toml", "-o", "x.gif", status=2)
    assert "X" in command("weave", "twill-3-1-s")
