"""Efficiency of organza and of Mitsuba 3 on one woven tile of micro-flakes.

    python benches/peers/mitsuba_speed.py --organza target/release/organza [--tiles base,dense,varied,fine]
        [--scenes sun,sky,panel,endless] [--wall]

Makes the tile as .vol grids, which both programs read, and renders it with both in turn: the same camera, lights and
unlimited bounces. Scenes are lit by two suns, a uniform sky or one panel beside the tile; `endless` is organza's tile
repeated without end under the suns, against Mitsuba's tile alone, which is less work.

Efficiency = 1 / (variance of the mean pixel x seconds), where the variance is half the mean squared difference of two
pictures of different seeds, over pixels and channels, and seconds are those of organza's whole process (reading, tables,
writing) but of Mitsuba's render call alone, after a first one has compiled its kernels. Without --wall, for busy
machines, seconds are CPU seconds over two cores, which takes both to share work perfectly.

Needs mitsuba 3.9.1 and numpy; LLVM 16 or newer named by DRJIT_LIBLLVM_PATH for llvm_ad_rgb. Mitsuba's stock sggx
sampler is wrong (its issue 1728), which makes its picture wrong by some percent but not its speed.
"""
import argparse, os, resource, struct, subprocess, sys, tempfile, time
import numpy as np

SIZE, HEIGHT = 0.96, 0.40  # mm
PIXELS = 128
ALBEDO = [0.9, 0.7, 0.5]
LIGHTS = [[0.4, 0.3, -0.8660254], [-0.3, 0.2, 0.9327379]]
# Extinction across fibres in 1/mm, voxels along the 0.96 mm, relative deviation of the density from voxel to voxel.
TILES = {'base': (70, 96, 0), 'dense': (200, 96, 0), 'varied': (40, 96, 0.5), 'fine': (70, 192, 0)}
END_ON = 0.25
PANEL = [1.0, 0.0, 0.8], [0.0, 0.96, 0.0], [0.4, 0.0, -0.4]  # corner and edges, mm; shines along u x v, at the tile
PANEL_RADIANCE = 4.0


def plain_weave(sigma, voxels, deviation):
    """Extinction and axis on a grid: two warp and two weft yarns with elliptic sections on cosine paths."""
    n = (voxels, voxels, round(voxels * HEIGHT / SIZE))
    x, y, z = np.meshgrid(*[(np.arange(k) + 0.5) / k for k in n], indexing='ij')
    x, y, z = x * SIZE, y * SIZE, (z - 0.5) * HEIGHT
    density, axis = np.zeros(n), np.zeros(n + (3,))
    axis[..., 2] = 1
    amplitude, half_width, half_height = 0.085, 0.20, 0.085
    for family, (along, across) in enumerate([(x, y), (y, x)]):
        for k in (0, 1):
            up = (1 - 2 * k) * (1 - 2 * family)
            phase = 2 * np.pi * (along - SIZE / 4) / SIZE
            middle = up * amplitude * np.cos(phase)
            slope = -up * amplitude * np.sin(phase) * 2 * np.pi / SIZE
            beside = np.abs(across - (k + 0.5) * SIZE / 2)
            beside = np.minimum(beside, SIZE - beside)
            inside = ((beside / half_width)**2 + ((z - middle) / half_height)**2 < 1) & (density == 0)
            tangent = np.zeros(n + (3,))
            tangent[..., family], tangent[..., 2] = 1, slope
            tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
            density[inside], axis[inside] = 1, tangent[inside]
    if deviation:
        density *= np.random.default_rng(1).gamma(deviation**-2, deviation**2, density.shape)
    s = np.eye(3) - (1 - END_ON**2) * axis[..., :, None] * axis[..., None, :]
    s = np.stack([s[..., i, j] for i, j in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]], -1)
    return density[..., None] * sigma, s


def write_vol(path, data):
    """Mitsuba's grid format, x fastest."""
    box = (0, 0, -HEIGHT / 2, SIZE, SIZE, HEIGHT / 2)
    with open(path, 'wb') as f:
        f.write(b'VOL\x03' + struct.pack('<5i6f', 1, *data.shape, *box))
        f.write(np.ascontiguousarray(data.transpose(2, 1, 0, 3), '<f4').tobytes())


def scene_text(name, kind):
    lights = ''.join(f'[[light]]\nkind = "directional"\ndirection = {d}\nirradiance = [1.0, 1.0, 1.0]\n' for d in LIGHTS)
    if kind == 'panel':
        corner, u, v = PANEL
        lights = f'''[[light]]
kind = "rectangle"
corner_mm = {corner}
edge_u_mm = {u}
edge_v_mm = {v}
radiance = {[PANEL_RADIANCE] * 3}
'''
    if kind == 'sky':
        lights = '[[light]]\nkind = "environment"\nradiance = [1.0, 1.0, 1.0]\n'
    return f'''[camera]
kind = "orthographic"
origin_mm = [{SIZE / 2}, {SIZE / 2}, 3.0]
target_mm = [{SIZE / 2}, {SIZE / 2}, 0.0]
width_mm = {SIZE}
resolution = [{PIXELS}, {PIXELS}]
{lights}[[object]]
kind = "grid"
extinction = "{name}.sigma_t.vol"
sggx = "{name}.sggx.vol"
albedo = {ALBEDO}
repeat_xy = {str(kind == 'endless').lower()}
'''


def efficiency(a, b, seconds):
    variance = np.mean((a - b)**2) / 2
    return 1 / (variance * seconds)


class Clock:
    """Wall seconds, or CPU seconds of this process or of its children over two cores."""

    def __init__(self, wall, children):
        self.wall, self.who = wall, resource.RUSAGE_CHILDREN if children else resource.RUSAGE_SELF

    def now(self):
        if self.wall:
            return time.perf_counter()
        used = resource.getrusage(self.who)
        return (used.ru_utime + used.ru_stime) / 2


def mitsuba_worker(folder, name, kind, variant, integrator, rr_depth, spp, wall):
    """Prints efficiency, seconds a picture and the mean colour."""
    import mitsuba as mi
    mi.set_variant(variant)
    T = mi.ScalarTransform4f
    grid = lambda kind: {'type': 'gridvolume', 'filename': f'{folder}/{name}.{kind}.vol', 'filter_type': 'nearest',
                         'raw': True, 'to_world': T().translate([0, 0, -HEIGHT / 2]).scale([SIZE, SIZE, HEIGHT])}
    scene = {
        'type': 'scene',
        'integrator': {'type': integrator, 'max_depth': -1, 'rr_depth': rr_depth},
        'sensor': {'type': 'orthographic',
                   'to_world': T().look_at([SIZE / 2, SIZE / 2, 3], [SIZE / 2, SIZE / 2, 0], [0, 1, 0])
                   .scale([SIZE / 2, SIZE / 2, 1]),
                   'film': {'type': 'hdrfilm', 'width': PIXELS, 'height': PIXELS, 'rfilter': {'type': 'box'},
                            'pixel_format': 'rgb'}, 'sampler': {'type': 'independent'}},
        'box': {'type': 'cube', 'to_world': T().translate([SIZE / 2, SIZE / 2, 0])
                .scale([SIZE / 2, SIZE / 2, HEIGHT / 2]), 'bsdf': {'type': 'null'},
                'interior': {'type': 'heterogeneous', 'sigma_t': grid('sigma_t'),
                             'albedo': {'type': 'rgb', 'value': ALBEDO},
                             'phase_function': {'type': 'sggx', 'S': grid('sggx')}}}}
    if kind == 'panel':
        # Mitsuba's rectangle spans (-1, -1) to (1, 1) in x and y and shines to +z.
        corner, u, v = (np.array(x) for x in PANEL)
        to_world = np.eye(4)
        to_world[:3, 0], to_world[:3, 1] = u / 2, v / 2
        to_world[:3, 2] = np.cross(to_world[:3, 0], to_world[:3, 1])
        to_world[:3, 3] = corner + (u + v) / 2
        scene['panel'] = {'type': 'rectangle', 'to_world': mi.ScalarTransform4f(to_world), 'emitter': {
            'type': 'area', 'radiance': {'type': 'rgb', 'value': [PANEL_RADIANCE] * 3}}}
    if kind == 'sky':
        scene['sky'] = {'type': 'constant', 'radiance': {'type': 'rgb', 'value': [1, 1, 1]}}
    for i, d in enumerate(LIGHTS if kind in ('sun', 'endless') else []):
        scene[f'light{i}'] = {'type': 'directional', 'direction': d, 'irradiance': {'type': 'rgb', 'value': [1, 1, 1]}}
    scene = mi.load_dict(scene)
    np.array(mi.render(scene, spp=spp if variant.startswith('llvm') else 1, seed=99))
    clock, pictures = Clock(wall, False), []
    start = clock.now()
    for seed in (1, 2):
        pictures.append(np.array(mi.render(scene, spp=spp, seed=seed)))
    seconds = (clock.now() - start) / 2
    print(efficiency(*pictures, seconds), seconds, *np.mean(pictures, (0, 1, 2)))


def organza(arguments, folder, name, spp, backend, read):
    clock, pictures = Clock(arguments.wall, True), []
    start = clock.now()
    for seed in (1, 2):
        subprocess.run([arguments.organza, 'render', f'{folder}/{name}.toml', '-o', f'{folder}/{name}.{seed}.exr', '--spp',
                        str(spp), '--seed', str(seed), '--backend', backend, '--quiet', '--threads', '2'], check=True)
    seconds = (clock.now() - start) / 2
    pictures = [read(f'{folder}/{name}.{seed}.exr') for seed in (1, 2)]
    return efficiency(*pictures, seconds), seconds, *np.mean(pictures, (0, 1, 2))


def reader():
    import mitsuba as mi
    mi.set_variant('scalar_rgb')

    def read(path):
        bitmap = mi.Bitmap(path)
        names = [field.name for field in bitmap.struct_()]
        pixels = np.array(bitmap)
        return np.stack([pixels[..., [i for i, n in enumerate(names) if n.split('.')[-1] == c and 'variance' not in n][0]]
                         for c in 'RGB'], -1)
    return read


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument('--organza', required=True)
    parser.add_argument('--tiles', default='base')
    parser.add_argument('--wall', action='store_true')
    parser.add_argument('--spp', type=int, default=16, help="Mitsuba's samples per pixel")
    parser.add_argument('--organza-spp', default='64,256,1024')
    parser.add_argument('--backends', default='auto')
    parser.add_argument('--rounds', type=int, default=2)
    parser.add_argument('--scenes', default='sun', help='sun, sky, panel, endless')
    parser.add_argument('--worker', nargs='*')
    arguments = parser.parse_args([a for a in sys.argv[1:]])
    variants = [('scalar_rgb', 'volpath', 5), ('llvm_ad_rgb', 'volpath', 5), ('llvm_ad_rgb', 'volpath', 20),
                ('llvm_ad_rgb', 'volpathmis', 5)]
    if not os.environ.get('DRJIT_LIBLLVM_PATH'):
        variants = [('scalar_rgb', 'volpath', 5), ('scalar_rgb', 'volpath', 20), ('scalar_rgb', 'volpathmis', 5)]
    read = reader()
    with tempfile.TemporaryDirectory() as folder:
        for tile in arguments.tiles.split(','):
            extinction, s = plain_weave(*TILES[tile])
            for kind in arguments.scenes.split(','):
                name = f'{tile}-{kind}'
                write_vol(f'{folder}/{name}.sigma_t.vol', extinction)
                write_vol(f'{folder}/{name}.sggx.vol', s)
                with open(f'{folder}/{name}.toml', 'w') as f:
                    f.write(scene_text(name, kind))
                best, ours = 0, {}
                for _ in range(arguments.rounds):
                    for variant, integrator, rr in variants:
                        code = f'from mitsuba_speed import *; mitsuba_worker({folder!r}, {name!r}, {kind!r}, ' \
                               f'{variant!r}, {integrator!r}, {rr}, {arguments.spp}, {arguments.wall})'
                        done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                                              cwd=os.path.dirname(os.path.abspath(__file__)))
                        if done.returncode:
                            print(name, variant, integrator, 'failed:', done.stderr.strip().splitlines()[-1:])
                            continue
                        value = [float(v) for v in done.stdout.split()]
                        best = max(best, value[0])
                        print(f'{name} mitsuba {variant} {integrator} rr {rr}: efficiency {value[0]:.0f}, '
                              f'{value[1]:.2f} s, mean {value[2:]}', flush=True)
                    for backend in arguments.backends.split(','):
                        for spp in map(int, arguments.organza_spp.split(',')):
                            value = organza(arguments, folder, name, spp, backend, read)
                            ours.setdefault((backend, spp), []).append(value[0])
                            print(f'{name} organza {backend} {spp} spp: efficiency {value[0]:.0f}, {value[1]:.2f} s, '
                                  f'mean {[float(v) for v in value[2:]]}', flush=True)
                for (backend, spp), values in ours.items():
                    print(f'{name}: organza {backend} {spp} spp {max(values):.0f}, mitsuba {best:.0f}, '
                          f'ratio {max(values) / best:.0f}', flush=True)


if __name__ == '__main__':
    main()
