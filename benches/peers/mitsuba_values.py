"""Renders scenes by organza and, exported, by Mitsuba 3, and compares values.

    python benches/peers/mitsuba_values.py [--organza PATH] [--spp N] [SCENE.toml ...]

Without scenes it takes those beside it (values_*.toml). Needs `pip install
mitsuba==3.9.1 numpy`; runs the variant llvm_ad_rgb where DRJIT_LIBLLVM_PATH
names an LLVM of at least 16, as the mended phase function is slow otherwise.
Exits with 1 when a mean differs by more than 4 standard errors.

With --stock it renders what `organza export mitsuba` writes as the stock program
loads it, without the mended phase function, and asks only that every pixel is a
finite number and that the pictures show the same thing: stock sggx draws from
another distribution than it says.
"""

import argparse
import pathlib
import re
import subprocess
import sys
import tempfile
import time

import mitsuba as mi
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
RUNS = 8


def organza_means(organza, scene, spp, folder):
    picture = pathlib.Path(folder) / "organza.exr"
    command = [organza, "render", scene, "-o", picture, "--spp", str(spp), "--stats"]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stderr
    found = re.findall(r"^mean \w+ +(\S+) \+- (\S+)$", said, re.M)
    return np.array(found, dtype=float), picture


def mitsuba_means(xml, spp, **parameters):
    """Means of the channels with standard errors from separate runs."""
    scene = mi.load_file(str(xml), **parameters)
    pictures = [
        np.array(mi.render(scene, spp=max(1, spp // RUNS), seed=seed)) for seed in range(RUNS)
    ]
    means = np.array([p.reshape(-1, 3).mean(0) for p in pictures])
    se = means.std(0, ddof=1) / np.sqrt(RUNS)
    return np.stack([means.mean(0), se], 1), np.mean(pictures, 0)


def rows_and_columns(organza, mitsuba):
    """Correlation of the two pictures, and of one with the other mirrored:
    reveals a camera or an environment that is turned the wrong way."""
    bitmap = mi.Bitmap(str(organza))
    names = [field.name.split(".")[-1] for field in bitmap.struct_()]
    a = np.array(bitmap)[..., [names.index(c) for c in "RGB"]]
    r = lambda x, y: np.corrcoef(x.ravel(), y.ravel())[0, 1]
    return r(a, mitsuba), max(r(a, mitsuba[::-1]), r(a, mitsuba[:, ::-1]))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--organza", default=str(HERE.parents[1] / "target/release/organza"))
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--stock", action="store_true")
    parser.add_argument("scenes", nargs="*", default=sorted(HERE.glob("values_*.toml")))
    args = parser.parse_args()
    mi.set_variant(args.variant)
    parameters = {}
    if not args.stock:
        import sggx_mended

        sggx_mended.register()
        parameters["phase"] = "sggx_mended"
    print(f"Mitsuba {mi.__version__} {args.variant}, {args.spp} samples a pixel")
    worst = 0.0
    for scene in args.scenes:
        with tempfile.TemporaryDirectory() as folder:
            started = time.time()
            ours, picture = organza_means(args.organza, scene, args.spp, folder)
            export = [args.organza, "export", "mitsuba", scene, "-o", folder, "--quiet"]
            subprocess.run(export, check=True)
            theirs, image = mitsuba_means(pathlib.Path(folder) / "scene.xml", args.spp, **parameters)
            alike, mirrored = rows_and_columns(picture, image)
        off = (ours[:, 0] - theirs[:, 0]) / np.hypot(ours[:, 1], theirs[:, 1])
        if args.stock:
            worst = max(worst, 0.0 if np.isfinite(image).all() else np.inf)
        else:
            worst = max(worst, np.abs(off).max())
        print(f"{pathlib.Path(scene).stem} ({time.time() - started:.0f} s)")
        for name, (m, se), (n, se_n), z in zip(("red", "green", "blue"), ours, theirs, off):
            ratio = m / n
            print(
                f"  {name:5} organza {m:.6f} +- {se:.6f}  Mitsuba {n:.6f} +- {se_n:.6f}"
                f"  ratio {ratio:.4f}  {z:+.1f} standard errors"
            )
        print(f"  pixels correlate by {alike:.3f}, mirrored by {mirrored:.3f}")
        worst = max(worst, 0.0 if alike > mirrored else np.inf)
    if args.stock:
        print("loads and renders" if worst == 0.0 else "FAILS")
        sys.exit(int(worst > 0.0))
    print("agree" if worst <= 4.0 else "DIFFER", f"(worst {worst:.1f} standard errors)")
    sys.exit(int(worst > 4.0))


if __name__ == "__main__":
    main()
