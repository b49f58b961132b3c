"""Speed of the engine `gpu` beside the engine for processors, and beside Mitsuba 3 on the same card.

    python3 benches/gpu.py --organza target/release/organza [--spp 1024] [--rounds 3]
        [--peak-gflops 60000 --peak-gbytes 1000] [--mitsuba] [--scenes sun,sky]
    python3 benches/gpu.py --organza target/release/organza --gallery [--only seam,denim]

The program must be built with `--features gpu`. The tile is that of benches/peers/mitsuba_speed.py, for which numpy is
needed; --mitsuba needs mitsuba 3.9.1 and a card with CUDA.

Printed for every engine, the best of some rounds:
- Mpaths/s: samples per second of tracing, without reading, laying out and writing;
- efficiency: 1 / (variance of the mean pixel x seconds of tracing), by the standard error of the picture's mean that
  organza states, and for Mitsuba by half the mean squared difference of two pictures, which is the same on average;
- with the card's peaks, an estimate of the share of them that is used. A tentative collision reads 12 bytes that are
  near nothing read before, and takes 160 operations; a step of a shadow ray 4 bytes and 30; a collision 700 operations.
  These numbers were counted in the shaders. What caches serve is counted as if memory did.

An adapter of the kind `software` is measured too, which says nothing about a card.

--gallery renders all scenes of the gallery at 24 x 24 by both engines, without a cache of radiance, and prints how far the
means of the three channels are apart, in standard errors and as a share.
"""
import argparse, glob, json, os, subprocess, sys, tempfile, time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), 'peers'))

GALLERY = os.path.join(os.path.dirname(os.path.abspath(__file__)), '../scenes/gallery')
BYTES = {'tentative': 12, 'shadow_steps': 4}
OPERATIONS = {'tentative': 160, 'shadow_steps': 30, 'collisions': 700}


def render(arguments, scene, engine, seed, out, more=()):
    done = subprocess.run([arguments.organza, 'render', scene, '-o', out, '--spp', str(arguments.spp), '--seed', str(seed),
                           '--engine', engine, '--quiet', '--json', *more], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f'{engine}: {done.stderr.strip()}')
    return json.loads(done.stdout)


def measure(arguments, scene, engine, folder):
    """Best Mpaths/s, efficiency by the errors that pictures state, and figures of the best round."""
    best = None
    for seed in range(1, arguments.rounds + 1):
        figures = render(arguments, scene, engine, seed, f'{folder}/{engine}.exr')
        pixels = figures['resolution'][0] * figures['resolution'][1]
        tracing_s = figures['render_s'] - figures['prepare_s']
        rate = figures['samples'] * pixels / tracing_s / 1e6
        # Standard errors are of the picture's mean: variances of pixels are as many times larger.
        variance = sum(e * e for e in figures['standard_error']) / 3 * pixels
        efficiency = 1 / (variance * tracing_s)
        if best is None or rate > best[0]:
            best = rate, efficiency, figures
    return best


def shares(arguments, figures):
    """Shares of the card's peaks, as text."""
    if not arguments.peak_gflops or not arguments.peak_gbytes:
        return ''
    of = lambda costs: sum(cost * figures[work] for work, cost in costs.items()) / (figures['render_s'] - figures['prepare_s']) / 1e9
    arithmetic, memory = of(OPERATIONS) / arguments.peak_gflops, of(BYTES) / arguments.peak_gbytes
    bound = 'arithmetic' if arithmetic > memory else 'memory'
    return f', {arithmetic:.1%} of arithmetic, {memory:.1%} of memory: bound by {bound} before anything else'


def compare_gallery(arguments):
    """Prints how far both engines are apart in every scene; the greatest distance in standard errors."""
    scenes = sorted(glob.glob(f'{GALLERY}/*.toml'))
    names = [os.path.splitext(os.path.basename(scene))[0] for scene in scenes]
    names = arguments.only.split(',') if arguments.only else names
    more = ['--set', 'camera.resolution=[24,24]', '--set', 'render.cache="off"']
    farthest = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            begun = time.time()
            cpu, gpu = (render(arguments, f'{GALLERY}/{name}.toml', engine, seed, f'{folder}/{engine}.exr', more)
                        for seed, engine in enumerate(('cpu', 'gpu'), 1))
            words = []
            for channel in range(3):
                a, b = (figures['mean'][channel] for figures in (cpu, gpu))
                error = sum(figures['standard_error'][channel] ** 2 for figures in (cpu, gpu)) ** 0.5
                farthest = max(farthest, abs(b - a) / error)
                words.append(f'{(b - a) / error:+.2f} ({b / a - 1:+.1%} +- {error / a:.1%})')
            print(f'{name}: {", ".join(words)}; {time.time() - begun:.0f} s', flush=True)
    return farthest


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument('--organza', required=True)
    parser.add_argument('--spp', type=int, help='samples a pixel (1024, 64 with --gallery)')
    parser.add_argument('--rounds', type=int, default=3)
    parser.add_argument('--scenes', default='sun', help='sun, sky, panel, endless')
    parser.add_argument('--tile', default='base')
    parser.add_argument('--peak-gflops', type=float, help="the card's rate in single precision")
    parser.add_argument('--peak-gbytes', type=float, help="the card's memory bandwidth")
    parser.add_argument('--mitsuba', action='store_true', help='measure cuda_ad_rgb too')
    parser.add_argument('--gallery', action='store_true', help='compare both engines in the scenes of the gallery')
    parser.add_argument('--only', help='names of its scenes, with commas')
    arguments = parser.parse_args()
    arguments.spp = arguments.spp or (64 if arguments.gallery else 1024)
    if arguments.gallery:
        sys.exit(compare_gallery(arguments) > 4.0)
    import mitsuba_speed
    print(subprocess.run([arguments.organza, 'info', '--devices'], capture_output=True, text=True).stdout)
    with tempfile.TemporaryDirectory() as folder:
        extinction, s = mitsuba_speed.plain_weave(*mitsuba_speed.TILES[arguments.tile])
        for kind in arguments.scenes.split(','):
            name = f'{arguments.tile}-{kind}'
            mitsuba_speed.write_vol(f'{folder}/{name}.sigma_t.vol', extinction)
            mitsuba_speed.write_vol(f'{folder}/{name}.sggx.vol', s)
            scene = f'{folder}/{name}.toml'
            with open(scene, 'w') as f:
                f.write(mitsuba_speed.scene_text(name, kind))
            found = {}
            for engine in ('cpu', 'gpu'):
                rate, efficiency, figures = measure(arguments, scene, engine, folder)
                found[engine] = rate, efficiency
                print(f'{name} {figures["backend"]}: {rate:.2f} Mpaths/s, efficiency {efficiency:.0f}'
                      + (shares(arguments, figures) if engine == 'gpu' else ''), flush=True)
            ratios = [g / c for g, c in zip(found['gpu'], found['cpu'])]
            print(f'{name}: gpu over cpu {ratios[0]:.2f} times the paths, {ratios[1]:.2f} times the efficiency')
            if arguments.mitsuba:
                code = f'from mitsuba_speed import *; mitsuba_worker({folder!r}, {name!r}, {kind!r}, ' \
                       f"'cuda_ad_rgb', 'volpath', 5, {arguments.spp}, True)"
                done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                                      cwd=os.path.dirname(mitsuba_speed.__file__))
                if done.returncode:
                    print('mitsuba cuda_ad_rgb failed:', done.stderr.strip().splitlines()[-1:])
                    continue
                own, seconds, *_ = map(float, done.stdout.split())
                print(f'{name} mitsuba cuda_ad_rgb: efficiency {own:.0f}, {seconds:.2f} s; '
                      f'gpu over it {found["gpu"][1] / own:.2f}')


if __name__ == '__main__':
    main()
