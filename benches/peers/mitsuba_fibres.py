"""Speed of organza and of Mitsuba 3 (Embree curves) on the same explicit fibres.

    python benches/peers/mitsuba_fibres.py --organza target/release/organza [--old PROGRAM] [--spp 64] [--rounds 3] [--cuda]

Makes a plain weave of four yarns of 189 straight-laid dielectric fibres each (756 curves) as cubic B-splines. Mitsuba
reads their control points; organza reads points of the same splines, two a span, joined by straight pieces. Both trace
one tile, not repeated, from the same orthographic camera under the same two parallel lights, with Russian roulette and
without a limit on the events of a path.

Prints paths a second of whole processes: CPU seconds of a run with all samples less those of a run with one sample, so
that start-up, compiling and reading cancel. The mean colours show how far the pictures agree:

- Mitsuba's `hair` works in the frame of `bsplinecurve`, whose second axis lies along the fibre. `linearcurve` has its
  first axis there, so `hair` on it scatters about the wrong axis. Mitsuba warns of it ("Attaching this material to any
  other shape might produce unexpected results"). --linear renders that too.
- `hair` draws other distributions around the same lobes (von Mises-Fisher and logistic instead of Gaussian ones), and its
  absorption is per radius. `--rough` sets its two roughnesses; colours agree to some percent at best, so the comparison
  is one of speed.

--cuda compares the engine `gpu` and cuda_ad_rgb on one card instead, by seconds of tracing on the clock: paths a second, and
one over the variance of the mean pixel and those seconds.

Needs mitsuba 3.9.1 and numpy; LLVM 16 or newer named by DRJIT_LIBLLVM_PATH for llvm_ad_rgb.
"""
import argparse, json, os, resource, subprocess, sys, tempfile, time
import numpy as np

SIZE, HEIGHT, PIXELS = 0.96, 0.40, 128  # mm, mm
FIBRES, RADIUS = 189, 0.0073  # a yarn; mm
LIGHTS = [[0.4, 0.3, -0.8660254], [-0.3, 0.2, 0.9327379]]
IOR, ABSORPTION = 1.55, [1.0, 6.25, 50.0]  # 1/mm
LONGITUDINAL_DEG, AZIMUTHAL_DEG = 5.0, 10.0
SPANS, PIECES = 24, 2  # of a fibre; straight pieces a span


def control_points():
    """Of every fibre, with a span more at both ends, so that the splines fill the tile."""
    half_width, half_height, amplitude = 0.20, 0.085, 0.085
    # A spiral of the golden angle fills each section evenly and keeps fibres apart.
    k = np.arange(FIBRES) + 0.5
    r, phi = np.sqrt(k / FIBRES) * 0.96, k * np.pi * (3 - np.sqrt(5))
    aside, above = half_width * r * np.cos(phi), half_height * r * np.sin(phi)
    along = (np.arange(SPANS + 3) - 1) / SPANS * SIZE
    fibres = []
    for family in (0, 1):
        for yarn in (0, 1):
            up = (1 - 2 * yarn) * (1 - 2 * family)
            middle = up * amplitude * np.cos(2 * np.pi * (along - SIZE / 4) / SIZE)
            for a, b in zip(aside, above):
                across = np.full_like(along, (yarn + 0.5) * SIZE / 2 + a)
                xy = (along, across) if family == 0 else (across, along)
                fibres.append(np.stack([*xy, middle + b], -1))
    return fibres


def spline(points):
    """Points of the uniform cubic B-spline."""
    t = np.arange(PIECES)[:, None] / PIECES
    weights = [(1 - t)**3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3]
    spans = [sum(w * points[i + j] for j, w in enumerate(weights)) / 6 for i in range(len(points) - 3)]
    last = (points[-3] + 4 * points[-2] + points[-1]) / 6
    return np.concatenate(spans + [last[None]])


def write_curves(path, curves):
    with open(path, 'w') as f:
        f.write('\n\n'.join('\n'.join(f'{x:.7f} {y:.7f} {z:.7f} {RADIUS}' for x, y, z in c) for c in curves) + '\n')


FABRIC = f'''[draft]
curves = "spline.txt"
curves_are = "fibres"
[weft]
yarn = "tile"
[yarn.tile]
preset = "polyester"
fibre_radius_um = {1e3 * RADIUS}
[optics.tile]
ior = {IOR}
absorption_per_mm = {ABSORPTION}
longitudinal_deg = {LONGITUDINAL_DEG}
azimuthal_deg = {AZIMUTHAL_DEG}
'''

SCENE = f'''[render]
integrator = "fibres"
seed = 1
[camera]
kind = "orthographic"
origin_mm = [{SIZE / 2}, {SIZE / 2}, 3.0]
target_mm = [{SIZE / 2}, {SIZE / 2}, 0.0]
up = [0.0, 1.0, 0.0]
width_mm = {SIZE}
resolution = [{PIXELS}, {PIXELS}]
filter = "box"
''' + ''.join(f'[[light]]\nkind = "directional"\ndirection = {d}\nirradiance = [1.0, 1.0, 1.0]\n' for d in LIGHTS) + '''
[[object]]
kind = "cloth"
fabric = "tile.toml"
model = "fibres"
'''


def mitsuba_worker(folder, variant, shape, rough, spp):
    """Prints CPU seconds of the second picture and its mean colour."""
    import mitsuba as mi
    mi.set_variant(variant)
    T = mi.ScalarTransform4f
    bsdf = {'type': 'hair', 'int_ior': IOR, 'ext_ior': 1.0, 'scale_tilt': 0.0,
            'longitudinal_roughness': rough[0], 'azimuthal_roughness': rough[1],
            'sigma_a': {'type': 'rgb', 'value': [a * RADIUS for a in ABSORPTION]}}
    name = 'control' if shape == 'bsplinecurve' else 'spline'
    scene = {
        'type': 'scene', 'integrator': {'type': 'path', 'max_depth': -1, 'rr_depth': 5},
        'sensor': {'type': 'orthographic',
                   'to_world': T().look_at([SIZE / 2, SIZE / 2, 3], [SIZE / 2, SIZE / 2, 0], [0, 1, 0])
                   .scale([SIZE / 2, SIZE / 2, 1]),
                   'film': {'type': 'hdrfilm', 'width': PIXELS, 'height': PIXELS, 'rfilter': {'type': 'box'},
                            'pixel_format': 'rgb'}, 'sampler': {'type': 'independent'}},
        'fibres': {'type': shape, 'filename': f'{folder}/{name}.txt', 'bsdf': bsdf}}
    for i, d in enumerate(LIGHTS):
        scene[f'light{i}'] = {'type': 'directional', 'direction': d, 'irradiance': {'type': 'rgb', 'value': [1, 1, 1]}}
    scene = mi.load_dict(scene)
    if variant.startswith('cuda'):
        np.array(mi.render(scene, spp=1, seed=99))
        start = time.perf_counter()
        pictures = [np.array(mi.render(scene, spp=spp, seed=seed)) for seed in (1, 2)]
        seconds = (time.perf_counter() - start) / 2
        variance = np.nanmean((pictures[0] - pictures[1])**2) / 2
        print(seconds, 1 / (variance * seconds), *np.nanmean(pictures, (0, 1, 2)))
        return
    np.array(mi.render(scene, spp=spp if variant.startswith('llvm') else 1, seed=99))
    start = resource.getrusage(resource.RUSAGE_SELF)
    picture = np.array(mi.render(scene, spp=spp, seed=1))
    end = resource.getrusage(resource.RUSAGE_SELF)
    print(end.ru_utime + end.ru_stime - start.ru_utime - start.ru_stime, *np.nanmean(picture, (0, 1)))


def organza(program, folder, spp):
    """CPU seconds of the process, and what it says of the mean colour."""
    start = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([program, 'render', f'{folder}/scene.toml', '-o', f'{folder}/out.exr', '--spp', str(spp),
                           '--stats'], check=True, capture_output=True, text=True)
    end = resource.getrusage(resource.RUSAGE_CHILDREN)
    words = (done.stdout + done.stderr).splitlines()
    mean = [float(line.split()[2]) for line in words if line.startswith('mean ')]
    return end.ru_utime + end.ru_stime - start.ru_utime - start.ru_stime, mean


def on_a_card(arguments, folder):
    scene = f'{folder}/scene.toml'
    done = subprocess.run([arguments.organza, 'render', scene, '-o', f'{folder}/out.exr', '--spp', str(arguments.spp),
                           '--engine', 'gpu', '--json', '--quiet'], check=True, capture_output=True, text=True)
    figures = json.loads(done.stdout)
    seconds = figures['render_s'] - figures['prepare_s']
    variance = sum(e * e for e in figures['standard_error']) / 3 * PIXELS**2
    code = f"from mitsuba_fibres import *; mitsuba_worker({folder!r}, 'cuda_ad_rgb', 'bsplinecurve', " \
           f'{arguments.rough}, {arguments.spp})'
    done = subprocess.run([sys.executable, '-c', code], check=True, capture_output=True, text=True,
                          cwd=os.path.dirname(os.path.abspath(__file__)))
    peer, efficiency, *mean = [float(v) for v in done.stdout.split()]
    paths = PIXELS**2 * arguments.spp / 1e6
    print(f'organza gpu: {paths / seconds:.2f} M paths a second, efficiency {1 / (variance * seconds):.0f}, '
          f'mean {figures["mean"]}')
    print(f'mitsuba cuda_ad_rgb: {paths / peer:.2f} M paths a second, efficiency {efficiency:.0f}, mean {mean}')


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--organza', required=True)
    parser.add_argument('--old', help='an earlier organza to compare with')
    parser.add_argument('--spp', type=int, default=64)
    parser.add_argument('--rounds', type=int, default=3)
    parser.add_argument('--linear', action='store_true', help="also Mitsuba's linearcurve, on which hair is wrong")
    parser.add_argument('--cuda', action='store_true', help='compare on a card')
    parser.add_argument('--rough', type=float, nargs=2, default=[0.1, 0.1], help="hair's roughnesses")
    arguments = parser.parse_args()
    variants = ['scalar_rgb'] + (['llvm_ad_rgb'] if os.environ.get('DRJIT_LIBLLVM_PATH') else [])
    shapes = ['bsplinecurve'] + (['linearcurve'] if arguments.linear else [])
    with tempfile.TemporaryDirectory() as folder:
        fibres = control_points()
        write_curves(f'{folder}/control.txt', fibres)
        write_curves(f'{folder}/spline.txt', [spline(f) for f in fibres])
        for name, text in (('tile', FABRIC), ('scene', SCENE)):
            with open(f'{folder}/{name}.toml', 'w') as f:
                f.write(text)
        if arguments.cuda:
            on_a_card(arguments, folder)
            return
        paths = PIXELS**2 * arguments.spp
        speeds = {}

        def told(name, paths, seconds, mean):
            speeds.setdefault(name, []).append(paths / seconds)
            print(f'{name}: {paths / seconds / 1e6:.4f} M paths a CPU second, mean {[round(m, 5) for m in mean]}', flush=True)

        for _ in range(arguments.rounds):
            for name, program in (('organza', arguments.organza), ('old organza', arguments.old)):
                if program:
                    seconds, mean = organza(program, folder, arguments.spp + 1)
                    told(name, paths, seconds - organza(program, folder, 1)[0], mean)
            for variant in variants:
                for shape in shapes:
                    code = f'from mitsuba_fibres import *; mitsuba_worker({folder!r}, {variant!r}, {shape!r}, ' \
                           f'{arguments.rough}, {arguments.spp})'
                    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                                          cwd=os.path.dirname(os.path.abspath(__file__)))
                    if done.returncode:
                        print(variant, shape, 'failed:', done.stderr.strip().splitlines()[-1:])
                        continue
                    seconds, *mean = [float(v) for v in done.stdout.split()]
                    told(f'mitsuba {variant} {shape}', paths, seconds, mean)
        middle = {name: float(np.median(values)) for name, values in speeds.items()}
        for name, value in middle.items():
            print(f'{name}: median {value / 1e6:.4f} M paths a CPU second; organza is {middle["organza"] / value:.2f} times as fast')


if __name__ == '__main__':
    main()
