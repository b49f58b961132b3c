"""Time of a path among explicit fibres, by fabric.

    python3 benches/explicit_fibres.py DIR [FABRIC ...]

Renders an orthographic view of 4 mm of cloth from above, 48 x 48 pixels, lit by two parallel
lights of which one is behind the cloth, with 4 and with 104 samples: the difference of the user
CPU seconds is that of 230,400 paths, without setting up. Prints the median of five runs.
ORGANZA names the program, or several, separated by commas, which then run in turn.
"""

import os
import pathlib
import resource
import statistics
import subprocess
import sys

PATHS = 48 * 48 * 100
RUNS = 5
SCENE = """[render]
integrator = "fibres"
[camera]
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
"""


def user_seconds(program, scene, picture, samples):
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    subprocess.run(
        [program, "render", scene, "-o", picture, "--spp", str(samples), "--quiet"], check=True
    )
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def main():
    folder, *fabrics = sys.argv[1:]
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    programs = os.environ.get("ORGANZA", "target/release/organza").split(",")
    for name in fabrics or ["denim", "organza", "charmeuse", "jersey"]:
        scene, picture = folder / f"{name}.toml", folder / f"{name}.exr"
        fabric = pathlib.Path("scenes/fabrics", f"{name}.toml").resolve()
        scene.write_text(SCENE.format(fabric=fabric))
        seconds = {program: [] for program in programs}
        for _ in range(RUNS):
            for program in programs:
                few, many = (user_seconds(program, scene, picture, n) for n in (4, 104))
                seconds[program].append(many - few)
        for program in programs:
            print(f"{name}: {1e6 * statistics.median(seconds[program]) / PATHS:.2f} us a path, {program}")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main()
