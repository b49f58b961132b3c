#!/usr/bin/env python3
"""Checks `organza denoise` with Open Image Denoise of two wheels: the result is what the library
gives when Python calls it, does not depend on the number of threads, and is nearer to a converged
render than the noisy picture is.

    check_denoise.py --organza FILE --wheels FOLDER --out FOLDER

FOLDER of the wheels holds an environment for each, `pyoidn` and `oidn`. numpy and OpenEXR are
needed. ctypes calls the library here, without the packages of the wheels.
"""

import argparse
import ctypes
import os
import subprocess
from pathlib import Path

import numpy as np
import OpenEXR

ROOT = Path(__file__).resolve().parent.parent.parent
RENDER = ["scenes/backlit_organza.toml", "--set", "camera.resolution=[128,96]", "--quiet"]


def picture(path):
    """All channels of a picture by name."""
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    return {name: np.asarray(channel.pixels) for name, channel in channels.items()}


def stacked(channels, names):
    return np.ascontiguousarray(np.stack([channels[n] for n in names], -1), dtype=np.float32)


class Oidn:
    """The library, called by its C interface."""

    def __init__(self, path):
        for needed in sorted(path.parent.glob("libtbb.so.12*"))[:1]:
            ctypes.CDLL(str(needed), mode=ctypes.RTLD_GLOBAL)
        self.lib = lib = ctypes.CDLL(str(path))
        handle, text = ctypes.c_void_p, ctypes.c_char_p
        lib.oidnNewDevice.restype = lib.oidnNewFilter.restype = handle
        lib.oidnNewFilter.argtypes = [handle, text]
        for name in ["CommitDevice", "CommitFilter", "ExecuteFilter", "ReleaseFilter"]:
            getattr(lib, "oidn" + name).argtypes = [handle]
        sizes = [ctypes.c_size_t] * 5
        lib.oidnSetSharedFilterImage.argtypes = [handle, text, handle, ctypes.c_int, *sizes]
        self.set_bool = getattr(lib, "oidnSetFilterBool", None) or lib.oidnSetFilter1b
        self.set_bool.argtypes = [handle, text, ctypes.c_bool]
        lib.oidnGetDeviceError.argtypes = [handle, handle]
        self.device = lib.oidnNewDevice(1)
        if not hasattr(lib, "oidnSetDeviceInt"):
            # Version 1, whose picture depends on the number of threads: organza uses one.
            lib.oidnSetDevice1i.argtypes = [handle, ctypes.c_char_p, ctypes.c_int]
            lib.oidnSetDevice1i(self.device, b"numThreads", 1)
        lib.oidnCommitDevice(self.device)

    def filtered(self, flags, **images):
        lib = self.lib
        filter = lib.oidnNewFilter(self.device, b"RT")
        height, width, _ = next(iter(images.values())).shape
        output = np.zeros((height, width, 3), np.float32)
        for name, image in [*images.items(), ("output", output)]:
            start = image.ctypes.data
            lib.oidnSetSharedFilterImage(filter, name.encode(), start, 3, width, height, 0, 0, 0)
        for flag in flags:
            self.set_bool(filter, flag.encode(), True)
        lib.oidnCommitFilter(filter)
        lib.oidnExecuteFilter(filter)
        error = lib.oidnGetDeviceError(self.device, None)
        assert error == 0, f"error {error}"
        lib.oidnReleaseFilter(filter)
        return output


def expected(oidn, noisy, with_guides):
    colour = stacked(noisy, "RGB")
    if not with_guides:
        return oidn.filtered(["hdr"], color=colour)
    events = noisy["bounces"]
    albedo = stacked({"n": events / (1 + events)}, "nnn")
    tangent = stacked(noisy, ["tangent.X", "tangent.Y", "tangent.Z"])
    normal = np.ascontiguousarray(tangent * (1 - noisy["through"])[..., None])
    albedo = oidn.filtered([], albedo=albedo)
    normal = oidn.filtered([], normal=normal)
    return oidn.filtered(["hdr", "cleanAux"], color=colour, albedo=albedo, normal=normal)


def relative_error(picture, reference):
    a, b = stacked(picture, "RGB"), stacked(reference, "RGB")
    return float(np.mean((a - b) ** 2 / (b * b + 0.01)))


def main():
    parser = argparse.ArgumentParser()
    for flag in ["--organza", "--wheels", "--out"]:
        parser.add_argument(flag, required=True, type=Path)
    args = parser.parse_args()
    out, organza = args.out.resolve(), args.organza.resolve()
    out.mkdir(parents=True, exist_ok=True)

    def run(environment, *arguments):
        variables = {k: v for k, v in os.environ.items() if not k.startswith("ORGANZA_")}
        variables["VIRTUAL_ENV"] = str(environment)
        command = [str(organza), *map(str, arguments)]
        subprocess.run(command, check=True, cwd=ROOT, env=variables)

    for name, samples, seed in [("noisy", 8, 1), ("reference", 2048, 2)]:
        run("", "render", *RENDER, "-o", out / f"{name}.exr", "--spp", samples, "--seed", seed)
    noisy, reference = picture(out / "noisy.exr"), picture(out / "reference.exr")
    before = relative_error(noisy, reference)
    for wheel in ["pyoidn", "oidn"]:
        environment = args.wheels.resolve() / wheel
        found = sorted(environment.glob("lib/python*/site-packages/*/**/libOpenImageDenoise.so*"))
        oidn = Oidn(found[0])
        for with_guides in [False, True]:
            flags = ["--guides"] if with_guides else []
            for threads in [1, 2]:
                clean = out / f"{wheel}_{threads}.exr"
                run(environment, "denoise", out / "noisy.exr", "-o", clean, "--threads", threads, *flags)
            same = (out / f"{wheel}_1.exr").read_bytes() == clean.read_bytes()
            assert same, f"{wheel}: 1 and 2 threads differ"
            result = picture(clean)
            difference = np.abs(stacked(result, "RGB") - expected(oidn, noisy, with_guides)).max()
            assert difference == 0, f"{wheel}: differs from the library's own result by {difference}"
            after = relative_error(result, reference)
            print(f"{wheel}, guides {with_guides}: relative MSE {before:.5f} -> {after:.5f}")
            assert after < before / 2, f"{wheel}: {after} of {before}"
            # Known bad: the noisy picture itself is not nearer.
            assert not relative_error(noisy, reference) < before / 2
        run(environment, "render", *RENDER, "-o", out / "direct.exr", "--spp", 8, "--seed", 1, "--denoise")
        run(environment, "denoise", out / "noisy.exr", "-o", out / "after.exr")
        assert (out / "direct.exr").read_bytes() == (out / "after.exr").read_bytes()
    print("denoise: all checks passed")


main()
