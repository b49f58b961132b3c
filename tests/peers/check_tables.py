"""Mitsuba's plugin `measured`, Radiance's BSDF library and pyWinCalc read the tables of
`organza measure` and find the values that organza measures at the same directions.

    python tests/peers/check_tables.py --organza target/release/organza

Needs `pip install mitsuba==3.9.1 pyradiance==1.3.1 pywincalc==3.3.1 numpy`. Prints the differences; exits with 1
at the first one that is too large. Every check has a twin, a damaged table or a reader with a
mistake, that it must refuse.
"""
import argparse
import pathlib
import subprocess
import tempfile

import mitsuba as mi
import numpy as np
import pywincalc
from pyradiance import bsdf as radiance

mi.set_variant("scalar_rgb")
FABRIC = "scenes/fabrics/denim.toml"

# Linear sRGB to XYZ over the XYZ of its white, as Radiance reports colours.
XYZ = np.array([
    [0.433887, 0.376224, 0.189889],
    [0.212639, 0.715169, 0.072192],
    [0.017750, 0.109448, 0.872802],
])


def directions(rng, count, least_cosine=0.2):
    """Random directions of the upper hemisphere, uniform over solid angle."""
    z = rng.uniform(least_cosine, 1.0, count)
    phi = rng.uniform(0.0, 2.0 * np.pi, count)
    ring = np.sqrt(1.0 - z * z)
    return np.stack([ring * np.cos(phi), ring * np.sin(phi), z], axis=1)


def angles(w):
    """Polar angle and azimuth in degrees."""
    return np.degrees(np.arccos(np.clip(w[:, 2], -1, 1))), np.degrees(np.arctan2(w[:, 1], w[:, 0]))


def show(name, difference, noise=None):
    share = np.sort(np.abs(difference), axis=None)
    text = f"{name}: median difference {np.median(share):.2%}, 99th of 100 {np.quantile(share, 0.99):.1%}, worst {share[-1]:.1%}"
    print(text + (f"; noise of the reference {noise:.2%}" if noise is not None else ""))
    return np.median(share)


class Organza:
    def __init__(self, program, folder):
        self.program, self.folder = program, pathlib.Path(folder)
        self.fabric = FABRIC

    def measure(self, *arguments):
        command = [self.program, "measure", self.fabric, "--quiet", *map(str, arguments)]
        subprocess.run(command, check=True)

    def table(self, name, *arguments):
        path = self.folder / name
        self.measure("-o", path, *arguments)
        return path

    def pairs(self, w_in, w_out, *arguments):
        """BSDF and standard errors at pairs of directions."""
        path = self.folder / "pairs.csv"
        table = np.stack([*angles(w_in), *angles(w_out)], axis=1)
        np.savetxt(path, table, "%.7f", ",", header="theta_i,phi_i,theta_o,phi_o", comments="")
        out = self.table("values.csv", "--pairs", path, *arguments)
        values = np.genfromtxt(out, delimiter=",", skip_header=1)
        return values[:, 4:7], values[:, 7:10]

    def reflectance(self, w_in, *arguments):
        """Share of the light that is reflected, and that passes scattered or straight."""
        path = self.folder / "incident.csv"
        np.savetxt(path, np.stack(angles(w_in), axis=1), "%.7f", ",", header="theta_i,phi_i", comments="")
        out = self.table("albedo.csv", "--pairs", path, "--albedo", *arguments)
        table = np.genfromtxt(out, delimiter=",", names=True)
        column = lambda part: np.stack([table[f"{part}_{c}"] for c in "rgb"], axis=1)
        return column("reflected"), column("transmitted") + column("direct")


class Measured:
    """Mitsuba's plugin with a file."""

    def __init__(self, path):
        self.bsdf = mi.load_dict({"type": "measured", "filename": str(path)})
        self.context = mi.BSDFContext()

    def at(self, w):
        si = mi.SurfaceInteraction3f()
        si.wi = mi.Vector3f(w)
        return si

    def brdf(self, w_in, w_out):
        pairs = zip(w_in, w_out)
        one = lambda a, b: np.array(self.bsdf.eval(self.context, self.at(a), mi.Vector3f(b))) / b[2]
        return np.array([one(a, b) for a, b in pairs])

    def reflectance(self, w_in, rng, count):
        """Mean weight of samples: what a white furnace sees of the cloth."""
        def one(w):
            si = self.at(w)
            weights = [np.array(self.bsdf.sample(self.context, si, 0.5, mi.Point2f(u))[1]) for u in rng.uniform(size=(count, 2))]
            return np.mean(weights, axis=0)
        return np.array([one(w) for w in w_in])


def check_mitsuba(organza, rng):
    w_in, w_out = directions(rng, 1500), directions(rng, 1500)
    surface = ["--model", "surface"]
    path = organza.table("surface.bsdf", "--layout", "rgl", "--spp", 2, *surface)
    table = Measured(path)
    expected, _ = organza.pairs(w_in, w_out, *surface)
    found = table.brdf(w_in, w_out)
    median = show("measured, surface model (no noise)", found / expected - 1)
    assert median < 0.015 and abs(found.mean() / expected.mean() - 1) < 0.02
    back = table.brdf(w_out, w_in)
    median = show("measured, light and eye exchanged", back / found - 1)
    assert median < 0.03
    steep = directions(rng, 6, 0.4)
    seen = table.reflectance(steep, rng, 4000)
    reflected, _ = organza.reflectance(steep, "--spp", 100000, *surface)
    show("measured, white furnace", seen / reflected - 1)
    assert np.abs(seen / reflected - 1).max() < 0.06

    # The twin: exit directions along the wrong axis of the square.
    tensors = {name: np.array(value) for name, value in mi.tensor_io.read(str(path)).items()}
    tensors["rgb"] = np.ascontiguousarray(tensors["rgb"].swapaxes(3, 4))
    twin = organza.folder / "twin.bsdf"
    mi.tensor_io.write(str(twin), **tensors)
    twisted = Measured(twin).brdf(w_in, w_out)
    assert show("twin with exchanged axes", twisted / expected - 1) > 0.1

    path = organza.table("volume.bsdf", "--layout", "rgl", "--spp", 128, "--rgl-grid", "8,12,16")
    w_in, w_out = w_in[:200], w_out[:200]
    expected, error = organza.pairs(w_in, w_out, "--spp", 8192)
    found = Measured(path).brdf(w_in, w_out)
    noise = np.median(error / expected)
    median = show("measured, micro-flakes, 128 paths a pair", found / expected - 1, noise)
    print(f"    sum {found.sum() / expected.sum() - 1:+.1%}, noise of a pair of the table {8 * noise:.0%}")
    assert median < 8 * noise and abs(found.mean() / expected.mean() - 1) < 0.05
    try:
        mi.set_variant("scalar_spectral")
        Measured(path)
        print("measured reads the file in a spectral variant, too")
    except (RuntimeError, ImportError) as refusal:
        print("scalar_spectral:", str(refusal).split("] ")[-1])
    finally:
        mi.set_variant("scalar_rgb")


def material(w):
    """A direction of the cloth in the frame of Radiance's material: half a turn about the warp."""
    return np.array([-w[0], w[1], -w[2]])


class Radiance:
    """Radiance's library with a file."""

    def __init__(self, path):
        self.data = radiance.load_file(str(path))
        assert self.data is not None, path

    def luminance(self, w_in, w_out, frame=material):
        def one(a, b):
            polar = [float(x) for w in (a, b) for x in np.ravel(angles(frame(w)[None]))]
            return radiance.query(self.data, *polar)
        return np.array([one(a, b) for a, b in zip(w_in, w_out)])

    def hemisphere(self, w, kind):
        theta, phi = (float(x[0]) for x in angles(material(w)[None]))
        return radiance.direct_hemi(self.data, theta, phi, kind)


def on_square(disk):
    """Points of the unit disk on the unit square (Shirley and Chiu)."""
    x, y = disk.T
    radius, phi = np.hypot(x, y), np.arctan2(np.abs(y), np.abs(x)) / (np.pi / 4)
    near = np.where(phi < 1, radius, radius * (2 - phi))
    far = np.where(phi < 1, radius * phi, radius)
    return np.stack([0.5 + 0.5 * np.copysign(near, x), 0.5 + 0.5 * np.copysign(far, y)], axis=1)


def on_disk(square):
    """The inverse of on_square."""
    a, b = (2 * square - 1).T
    wide = np.abs(a) > np.abs(b)
    radius = np.where(wide, np.abs(a), np.abs(b))
    phi = np.pi / 4 * np.where(wide, np.abs(b), 2 * radius - np.abs(a)) / np.maximum(radius, 1e-9)
    return np.stack([np.copysign(radius * np.cos(phi), a), np.copysign(radius * np.sin(phi), b)], axis=1)


def elsewhere_in_cell(rng, w, depth):
    """Random directions in the cells of a tensor tree that contain directions."""
    side = 2**depth
    cell = np.floor(on_square(w[:, :2] * [-1, 1]) * side)
    disk = on_disk((cell + rng.uniform(size=cell.shape)) / side) * [-1, 1]
    z = np.sqrt(np.maximum(1 - np.sum(disk**2, axis=1), 1e-6))
    return np.concatenate([disk, (z * np.sign(w[:, 2]))[:, None]], axis=1)


def check_radiance(organza, rng):
    surface, depth, within = ["--model", "surface"], 3, 16
    tree = ["--layout", "tensor-tree", "--tree-depth", depth, "--spp", 65536]
    kinds = {"reflected": (1, 1), "transmitted": (1, -1), "reflected at the back": (-1, -1)}
    for name, layout, limit in [
        ("tensor tree", tree, 0.12),
        ("tensor tree, pruned", [*tree, "--prune", 0.05], 0.15),
        ("klems", ["--layout", "klems", "--spp", 16384], 0.25),
    ]:
        file = Radiance(organza.table("table.xml", *layout, *surface))
        for kind, (light, eye) in kinds.items():
            w_in = directions(rng, 300, 0.35) * [1, 1, light]
            w_out = directions(rng, 300, 0.35) * [1, 1, eye]
            straight = np.sum(-w_in * w_out, axis=1) > 0.7
            w_in, w_out = w_in[~straight], w_out[~straight]
            if name == "klems":
                expected, _ = organza.pairs(w_in, w_out, *surface)
            else:
                # A tree holds means over its cells.
                cells = [elsewhere_in_cell(rng, np.repeat(w, within, axis=0), depth) for w in (w_in, w_out)]
                expected = organza.pairs(*cells, *surface)[0].reshape(-1, within, 3).mean(axis=1)
            xyz = expected @ XYZ.T
            found = file.luminance(w_in, w_out)
            median = show(f"Radiance, {name}, {kind}", found[:, 1] / xyz[:, 1] - 1)
            assert median < limit, (median, limit)
            total = found[:, 1].sum() / xyz[:, 1].sum() - 1
            hue = np.median(np.abs(found / found[:, 1:2] - xyz / xyz[:, 1:2]))
            print(f"    sum {total:+.1%}, colour {hue:.3f}")
            assert abs(total) < limit / 2 and hue < 0.01
            if name == "klems":
                continue
            # The twin: the cloth mirrored in place of turned over.
            mirrored = file.luminance(w_in, w_out, lambda w: w * [1, 1, -1])
            twisted = np.median(np.abs(mirrored[:, 1] / xyz[:, 1] - 1))
            assert kind == "transmitted" or twisted > 1.3 * median, (twisted, median)
        if name == "klems":
            continue
        w = directions(rng, 6, 0.5)
        cell = elsewhere_in_cell(rng, np.repeat(w, 32, axis=0), depth)
        shares = [share.reshape(6, -1, 3).mean(axis=1) for share in organza.reflectance(cell, "--spp", 16384, *surface)]
        for kind, share in zip((radiance.SAMPLE_R, radiance.SAMPLE_T), shares):
            kind = int(kind) | int(radiance.SAMPLE_DF) | int(radiance.SAMPLE_SP)
            seen = np.array([file.hemisphere(v, kind) for v in w])
            show(f"Radiance, {name}, share of light", seen / (share @ XYZ[1]) - 1)
            assert np.abs(seen / (share @ XYZ[1]) - 1).max() < 0.08


def check_pywincalc(organza):
    """A shade in light and under the sun, by the program that computes glazings."""
    screen = ["--model", "fibres", "--bands", "visible,solar"]
    organza.fabric = "scenes/fabrics/screen.toml"
    file = organza.table("screen.xml", "--layout", "klems", "--spp", 4096, *screen)
    sheet = organza.table("screen.csv", "--layout", "en14501", "--spp", 65536, *screen)
    rows = [line.split(",") for line in sheet.read_text().splitlines() if "class" not in line]
    sheet = {tuple(row[:3]): float(row[3]) for row in rows[1:]}
    standards = pathlib.Path(pywincalc.__file__).parent / "standards"
    glazing = pywincalc.GlazingSystem(
        optical_standard=pywincalc.load_standard(str(standards / "W5_NFRC_2003.std")),
        solid_layers=[pywincalc.parse_bsdf_xml_file(str(file))],
        bsdf_hemisphere=pywincalc.BSDFHemisphere.create(pywincalc.BSDFBasisType.FULL),
    )
    # Shares of light: the diagonal of the file has 4096 paths, 0.5 % each of scattered light.
    limit = 0.02
    for band, method in (("visible", "PHOTOPIC"), ("solar", "SOLAR")):
        found = glazing.optical_method_results(method).system_results
        for side, found in (("face", found.front), ("back", found.back)):
            pairs = {
                "normal_hemispherical": found.transmittance.direct_hemispherical,
                "normal_reflectance": found.reflectance.direct_hemispherical,
                "diffuse_hemispherical": found.transmittance.diffuse_diffuse,
                "diffuse_reflectance": found.reflectance.diffuse_diffuse,
            }
            for name, value in pairs.items():
                expected = sheet[band, side, name]
                print(f"pyWinCalc, {band}, {side}, {name}: {value:.4f}, sheet {expected:.4f}")
                assert abs(value - expected) < limit
    # The twin: light in place of the sun.
    twin = sheet["visible", "face", "normal_reflectance"] - sheet["solar", "face", "normal_reflectance"]
    assert abs(twin) > 2 * limit, twin


def draw(organza, path):
    """The plane of the weft and that of the warp, as organza measures them and as the others
    read them from tables."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    surface = ["--model", "surface"]
    mitsuba = Measured(organza.table("denim.bsdf", "--layout", "rgl", "--spp", 2, *surface))
    tree = ["--layout", "tensor-tree", "--spp", 16384, "--prune", 0.05]
    tree = Radiance(organza.table("denim.xml", *tree, *surface))
    tilt = np.radians(np.linspace(-80, 80, 321))
    figure, axes = pyplot.subplots(1, 2, figsize=(8.4, 3.4), sharey=True, layout="constrained")
    for axis, name, turn in zip(axes, ("weft", "warp"), (np.eye(3), np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]))):
        plane = lambda t: np.stack([np.sin(t), np.zeros_like(t), np.cos(t)], axis=1) @ turn.T
        light = np.radians(45)
        few = tilt[::16]
        values, _ = organza.pairs(plane(np.full(len(few), light)), plane(few), *surface)
        w_in = plane(np.full(len(tilt), light))
        axis.plot(np.degrees(tilt), mitsuba.brdf(w_in, plane(tilt)) @ XYZ[1], color="#c1440e", label="Mitsuba, .bsdf")
        axis.plot(np.degrees(tilt), tree.luminance(w_in, plane(tilt))[:, 1], color="#2a6f97", label="Radiance, tensor tree")
        axis.plot(np.degrees(few), values @ XYZ[1], "k.", ms=5, label="organza")
        axis.axvline(45, color="0.8", zorder=0)
        axis.set_title(f"surface model of denim, light at 45 degrees along the {name}", fontsize=9)
        axis.set_xlabel("angle of the eye, degrees")
    axes[0].set_ylabel("BRDF (luminance), 1/sr")
    axes[0].set_ylim(bottom=0)
    axes[0].legend(fontsize=8, loc="upper right", bbox_to_anchor=(0.85, 1))
    figure.savefig(path, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--organza", required=True)
    parser.add_argument("--picture", help="draw the picture of docs/tables.md, in place of the checks")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        organza = Organza(arguments.organza, folder)
        if arguments.picture:
            return draw(organza, arguments.picture)
        rng = np.random.default_rng(23)
        print(f"Mitsuba {mi.__version__}")
        check_mitsuba(organza, rng)
        check_radiance(organza, rng)
        check_pywincalc(organza)


if __name__ == "__main__":
    main()
