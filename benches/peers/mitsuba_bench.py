"""Renders the scenes of an `organza bench` by Mitsuba 3, for the same report.

    organza bench -o DIR [...]                     # writes the scenes, and its report
    python benches/peers/mitsuba_bench.py DIR      # writes DIR/peer.json
    organza bench -o DIR [...] --peer DIR/peer.json    # the same flags: only the report is made anew

Exports each scene as micro-flakes of the fabric's own voxels, level 0, repeated as often as the picture is wide, and
renders it with the integrator of the export and the phase function mended (sggx_mended). Scenes that would need
more than --most-repeats are left out, with a message. Needs mitsuba 3.9.1 and numpy; LLVM 16 or newer named by
DRJIT_LIBLLVM_PATH for llvm_ad_rgb. Seconds are processor seconds; compiling is setup, as it is paid once a scene.
"""
import argparse, json, math, pathlib, resource, subprocess, sys, tempfile, tomllib
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
RUNS = 8  # the variance of a pixel is that between runs
BEYOND = 1.5  # cloth around what the picture shows, mm on each side, into which light may wander


def seconds():
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def repeats(organza, scene, most):
    """Periods of the tile that cover the picture, or None."""
    info = subprocess.run([organza, 'info', scene['object'][0]['fabric'], '--json'], check=True, capture_output=True,
                          text=True).stdout
    tile = json.loads(info)['tile']
    size = [b - a for a, b in zip(tile['min_mm'], tile['max_mm'])][:2]
    camera = scene['camera']
    origin, target = camera['origin_mm'], camera['target_mm']
    slant = math.dist(origin, target) / abs(origin[2] - target[2])
    shown = [camera['width_mm'], camera['width_mm'] * slant]
    # An odd number lies around the middle.
    counts = [2 * math.ceil((s / 2 + BEYOND) / t) + 1 for s, t in zip(shown, size)]
    return counts if max(counts) <= most else None


def render(mi, xml, spp):
    start = seconds()
    scene = mi.load_file(str(xml), phase='sggx_mended')
    np.array(mi.render(scene, spp=1, seed=1000))
    ready = seconds()
    pictures = [np.array(mi.render(scene, spp=max(1, spp // RUNS), seed=seed)) for seed in range(RUNS)]
    done = seconds()
    mean = np.mean(pictures, 0).reshape(-1, 3)
    variance = np.var(pictures, 0, ddof=1).reshape(-1, 3) / RUNS
    return ready - start, done - ready, mean, variance


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('folder', type=pathlib.Path)
    parser.add_argument('--organza', default=str(HERE.parents[1] / 'target/release/organza'))
    parser.add_argument('--spp', type=int, default=256)
    parser.add_argument('--variant', default='llvm_ad_rgb')
    parser.add_argument('--most-repeats', type=int, default=9)
    parser.add_argument('--threads', type=int, default=0, help='0: all cores')
    arguments = parser.parse_args()
    import mitsuba as mi
    mi.set_variant(arguments.variant)
    if arguments.threads:
        import drjit
        drjit.set_thread_count(arguments.threads)
    sys.path.insert(0, str(HERE))
    import sggx_mended
    sggx_mended.register()
    pictures = []
    for path in sorted((arguments.folder / 'scenes').glob('*mm-*.toml')):
        scene = tomllib.loads(path.read_text())
        counts = repeats(arguments.organza, scene, arguments.most_repeats)
        if counts is None:
            print(f'{path.stem}: left out, too wide to be written as one grid', flush=True)
            continue
        with tempfile.TemporaryDirectory() as folder:
            export = subprocess.run([arguments.organza, 'export', 'mitsuba', str(path), '-o', folder, '--quiet',
                                     '--repeats', ','.join(map(str, counts)), '--set', 'object.0.model=microflake',
                                     '--set', 'object.0.lod=0'], capture_output=True, text=True)
            if export.returncode:
                print(f'{path.stem}: left out, {export.stderr.strip()}', flush=True)
                continue
            setup, tracing, mean, variance = render(mi, pathlib.Path(folder) / 'scene.xml', arguments.spp)
        pictures.append({'program': f'Mitsuba {mi.__version__} {arguments.variant}, micro-flakes', 'scene': path.stem,
                         'setup_s': setup, 'render_s': tracing,
                         'memory_bytes': resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
                         'mean': mean.tolist(), 'variance': variance.tolist()})
        print(f'{path.stem}: {setup:.1f} s and {tracing:.1f} s, mean {mean.mean(0)}', flush=True)
    (arguments.folder / 'peer.json').write_text(json.dumps({'pictures': pictures}))


if __name__ == '__main__':
    main()
