"""Time of a path and efficiency of packed and hybrid fibres against explicit ones, by fabric.

    python3 benches/packed_fibres.py DIR [FABRIC ...] [--runs N] [--models MODEL,...]

Renders an orthographic view of 4 mm of cloth from above, 48 x 48 pixels, lit by two parallel
lights of which one is behind the cloth, with 100 samples (the general walk: 10). Prints the
median CPU time of a path without setting up, events and tentative steps of a path (of explicit
fibres: pieces tested), the error of a sample over the picture's mean and the efficiency, which
is one over the time of a path and the square of the pixels' standard error for equal samples, over
that of explicit fibres. ORGANZA names the program.
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess

FABRICS = ["denim", "organza", "charmeuse", "jersey"]
# Keys of the cloth, flags, samples.
MODELS = {
    "fibres": ('model = "fibres"', [], 100),
    "packed": ('model = "packed"\nlod = 0', [], 100),
    "hybrid 1": ('model = "packed"\nlod = 0\nfirst_events = 1', [], 100),
    "hybrid 3": ('model = "packed"\nlod = 0\nfirst_events = 3', [], 100),
    "weight 0.4": ('model = "packed"\nlod = 0\nwhile_weight = 0.4', [], 100),
    "walk": ('model = "packed"\nlod = 0', ["--engine", "walk"], 10),
}
SCENE = """[camera]
origin_mm = [0.0, 0.0, 20.0]
target_mm = [0.0, 0.0, 0.0]
width_mm = 4.0
resolution = [48, 48]
[[light]]
kind = "directional"
direction = [0.5, 0.3, -0.81]
irradiance = [1.0, 1.0, 1.0]
[[light]]
kind = "directional"
direction = [-0.3, 0.2, 0.93]
irradiance = [1.0, 1.0, 1.0]
[[object]]
kind = "cloth"
fabric = "{fabric}"
{keys}
"""


def render(scene, picture, samples, flags):
    """What the program tells of a render."""
    program = os.environ.get("ORGANZA", "target/release/organza")
    told = subprocess.run(
        [program, "render", scene, "-o", picture, "--spp", str(samples), "--json", *flags],
        check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    return json.loads(told.stdout)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("fabrics", nargs="*", default=FABRICS)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--models", default=",".join(MODELS))
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    for fabric in given.fabrics:
        seconds, errors, told = {}, {}, {}
        models = given.models.split(",")
        for _ in range(given.runs):
            for model in models:
                keys, flags, samples = MODELS[model]
                scene = given.folder / f"{fabric}.{model.replace(' ', '_')}.toml"
                path = pathlib.Path("scenes/fabrics", f"{fabric}.toml").resolve()
                scene.write_text(SCENE.format(fabric=path, keys=keys))
                told[model] = render(scene, scene.with_suffix(".exr"), samples, flags)
                per_path = told[model]["render_cpu_s"] / (48 * 48 * samples)
                seconds.setdefault(model, []).append(1e6 * per_path)
                errors[model] = told[model]["relative_error"] * samples**0.5
        truth = statistics.median(seconds["fibres"]) * errors["fibres"] ** 2
        for model in models:
            time = statistics.median(seconds[model])
            paths = 48 * 48 * MODELS[model][2]
            counts = [told[model][key] / paths for key in ("collisions", "tentative", "shadow_rays")]
            print(
                f"{fabric}, {model}: {time:.2f} us a path, "
                "{:.2f} events, {:.1f} tentative, {:.2f} shadow rays, ".format(*counts)
                + f"error {errors[model]:.2f}, efficiency "
                f"{truth / (time * errors[model] ** 2):.2f}, "
                f"{told[model]['peak_memory_bytes'] >> 20} MiB",
                flush=True,
            )


if __name__ == "__main__":
    main()
