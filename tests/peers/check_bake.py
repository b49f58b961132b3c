"""Checks the materials of `organza bake` with programs of other people.

Needs MaterialX, usd-core, pygltflib, trimesh, bpy and numpy for Python 3.11, and node with
gltf-validator below the folder --node. tests/peers/run bake installs them.
"""

import argparse
import json
import math
import pathlib
import subprocess
import sys

FABRICS = ("denim", "organza")
# The render is at most this far from the values that organza expects of the glTF material,
# as root mean square over pairs and channels, as a share. Cycles has the same lobes but the
# layers and the sheen of its own material.
BLENDER_LIMIT = 0.35


def bake(organza, fabric, folder):
    subprocess.run(
        [organza, "bake", f"scenes/fabrics/{fabric}.toml", "-o", folder, "--quiet"], check=True)
    return json.loads((folder / "bake.json").read_text())


def check_materialx(folder, count=2):
    import MaterialX as mx
    from MaterialX import PyMaterialXGenGlsl, PyMaterialXGenMdl, PyMaterialXGenOsl
    from MaterialX import PyMaterialXGenShader as gen

    libraries = mx.createDocument()
    path = mx.getDefaultDataSearchPath()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), path, libraries)
    document = mx.createDocument()
    mx.readFromXmlFile(document, str(folder / "material.mtlx"))
    document.setDataLibrary(libraries)
    valid, why = document.validate()
    assert valid, why
    materials = document.getMaterialNodes()
    assert len(materials) == count, [m.getName() for m in materials]
    for name, generator in (
        ("GLSL", PyMaterialXGenGlsl.GlslShaderGenerator.create()),
        ("OSL", PyMaterialXGenOsl.OslShaderGenerator.create()),
        ("MDL", PyMaterialXGenMdl.MdlShaderGenerator.create()),
    ):
        context = gen.GenContext(generator)
        context.registerSourceCodeSearchPath(path)
        for material in materials:
            (shader,) = mx.getShaderNodes(material)
            made = generator.generate(material.getName(), shader, context)
            code = made.getSourceCode("pixel")
            assert len(code) > 1000, (name, material.getName())
    files = [e for e in document.traverseTree() if e.isA(mx.Input) and e.getType() == "filename"]
    for one in files:
        assert (folder / one.getValueString()).is_file(), one.getValueString()
    print(f"  MaterialX {mx.getVersionString()}: valid, GLSL, OSL and MDL of both materials, "
          f"{len(files)} files there")


def check_usd(folder):
    from pxr import Usd, UsdShade, UsdUtils

    path = str(folder / "material.usda")
    stage = Usd.Stage.Open(path)
    layers, assets, missing = UsdUtils.ComputeAllDependencies(path)
    assert not missing, missing
    assert len(assets) == 5, assets
    material = next(UsdShade.Material(p) for p in stage.Traverse() if p.IsA(UsdShade.Material))
    shader = material.ComputeSurfaceSource()[0]
    assert shader.GetIdAttr().Get() == "UsdPreviewSurface"
    for name in ("diffuseColor", "roughness", "opacity", "normal", "displacement"):
        source = shader.GetInput(name).GetConnectedSources()[0]
        assert source and source[0].source.GetPrim().IsValid(), name
    from pxr import UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    faults = UsdValidation.ValidationContext(validators).Validate(stage)
    assert not faults, [f.GetMessage() for f in faults]
    # The twin: a texture that is not there is found.
    twin = folder / "twin.usda"
    twin.write_text((folder / "material.usda").read_text().replace("base_color", "colour"))
    _, _, missing = UsdUtils.ComputeAllDependencies(str(twin))
    twin.unlink()
    assert len(missing) == 1, missing
    print(f"  usd-core {'.'.join(map(str, Usd.GetVersion()))}: {len(assets)} assets, "
          f"{len(validators)} validators find no fault")


def check_curves(organza, out):
    """Fibres that `organza export usd` writes."""
    import MaterialX as mx
    from pxr import Usd, UsdGeom, UsdShade, UsdValidation

    path = out / "organza.usda"
    command = [organza, "export", "usd", "scenes/fabrics/organza.toml", "-o", path, "--quiet"]
    subprocess.run([*command, "--repeats", "3,2"], check=True)
    stage = Usd.Stage.Open(str(path))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    faults = UsdValidation.ValidationContext(validators).Validate(stage)
    # usd-core comes without MaterialX, whose own library knows the nodes.
    faults = [f.GetMessage() for f in faults if "'ND_" not in f.GetMessage()]
    assert not faults, faults
    library = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), library)
    node = library.getNodeDef("ND_chiang_hair_bsdf")
    tiles = next(UsdGeom.PointInstancer(p) for p in stage.Traverse() if p.IsA(UsdGeom.PointInstancer))
    assert len(tiles.GetPositionsAttr().Get()) == 6
    fibres = 0
    for prim in stage.Traverse():
        if not prim.IsA(UsdGeom.BasisCurves):
            continue
        curves = UsdGeom.BasisCurves(prim)
        counts, points = curves.GetCurveVertexCountsAttr().Get(), curves.GetPointsAttr().Get()
        assert sum(counts) == len(points) and min(counts) >= 2
        widths = curves.GetWidthsAttr().Get()
        assert 0.005 < min(widths) <= max(widths) < 0.05, (min(widths), max(widths))
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        hair = material.ComputeSurfaceSource("mtlx")[0]
        assert hair.GetIdAttr().Get() == "ND_surface"
        fibre = hair.GetInput("bsdf").GetConnectedSources()[0][0].source.GetPrim()
        shader = UsdShade.Shader(fibre)
        assert shader.GetIdAttr().Get() == node.getName()
        for given in shader.GetInputs():
            kind = node.getActiveInput(given.GetBaseName()).getType()
            kind = {"vector2": "float2", "vector3": "float3"}.get(kind, kind)
            assert given.GetTypeName() == kind, (given.GetBaseName(), kind)
        fibres += len(counts)
    print(f"curves: {fibres} fibres, {len(validators)} validators find no fault")


VALIDATE = """
const fs = require('fs');
const validator = require('gltf-validator');
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1])), {maxIssues: 100})
  .then(report => console.log(JSON.stringify(report)));
"""


def check_gltf(folder, node, count=1):
    import pygltflib
    import trimesh

    path = folder / "material.glb"
    found = subprocess.run(["node", "-e", VALIDATE, str(path.resolve())], cwd=node, check=True,
                           capture_output=True, text=True)
    report = json.loads(found.stdout)
    issues = report["issues"]
    assert issues["numErrors"] == 0 and issues["numWarnings"] == 0, issues["messages"]
    read = pygltflib.GLTF2().load(str(path))
    # What is the same in all texels is no picture.
    assert len(read.materials) == count and 2 * count <= len(read.images) <= 7 * count
    scene = trimesh.load(path)
    (mesh,) = scene.geometry.values()
    assert abs(mesh.extents[0] - 0.1) < 1e-6, mesh.extents
    hints = sorted({m["code"] for m in issues["messages"]})
    print(f"  gltf-validator {report['validatorVersion']}: no error, no warning, hints {hints}; "
          f"pygltflib and trimesh {trimesh.__version__} read it")


def check_colourways(organza, out, node):
    """Two colours of one silk, by the variants of each format."""
    from pxr import Usd, UsdShade, UsdValidation

    silk = pathlib.Path("scenes/fabrics/organza.toml").read_text()
    fabrics = []
    for name, colour in (("ivory", "[[0.83, 0.76, 0.60]]"), ("wine", "[[0.30, 0.02, 0.04]]")):
        path = out / f"{name}.toml"
        path.write_text(silk.replace("silk organza", name).replace("[[0.83, 0.76, 0.60]]", colour))
        fabrics.append(path)
    folder = out / "colourways"
    quick = ["--resolution", "64", "--texel-spp", "8", "--pairs", "64", "--spp", "256"]
    subprocess.run([organza, "bake", *fabrics, "-o", folder, "--quiet", *quick], check=True)
    print("colourways")
    check_materialx(folder, 4)
    check_gltf(folder, node, 2)
    stage = Usd.Stage.Open(str(folder / "material.usda"))
    root = stage.GetDefaultPrim()
    chosen = root.GetVariantSet("colourway")
    bound = set()
    for name in chosen.GetVariantNames():
        chosen.SetVariantSelection(name)
        patch = stage.GetPrimAtPath(root.GetPath().AppendChild("Patch"))
        material, _ = UsdShade.MaterialBindingAPI(patch).ComputeBoundMaterial()
        bound.add(str(material.GetPath()))
    assert len(bound) == 2, bound
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    faults = UsdValidation.ValidationContext(validators).Validate(stage)
    assert not faults, [f.GetMessage() for f in faults]
    print(f"  usd-core: {sorted(bound)}, no fault")


def direction(angles):
    theta, phi = math.radians(angles["theta_deg"]), math.radians(angles["phi_deg"])
    return (math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta))


class Blender:
    """Renders a patch of 20 mm of an imported material."""

    def __init__(self, path, scratch):
        import bpy

        sys.path.insert(0, "crates/python/blender")
        import material

        bpy.ops.wm.read_factory_settings(use_empty=True)
        if path.suffix == ".glb":
            material.load(path.parent)
        else:
            bpy.ops.wm.usd_import(filepath=str(path), import_usd_preview=True)
        self.bpy, self.scratch, self.is_gltf = bpy, scratch, path.suffix == ".glb"
        scene = bpy.context.scene
        meshes = [o for o in scene.objects if o.type == "MESH"]
        assert len(meshes) == 1 and len(meshes[0].data.materials) == 1, meshes
        self.material = meshes[0].data.materials[0]
        bpy.context.view_layer.update()
        self.turn = meshes[0].matrix_world.to_3x3().normalized()
        size = max(meshes[0].dimensions)
        assert abs(size - 0.1) < 1e-4, size
        scene.render.engine = "CYCLES"
        scene.cycles.device = "CPU"
        scene.cycles.samples = 64
        scene.cycles.use_denoising = False
        scene.cycles.seed = 1
        scene.cycles.transparent_max_bounces = 8
        scene.render.resolution_x = scene.render.resolution_y = 48
        scene.view_settings.view_transform = "Raw"
        scene.render.image_settings.file_format = "OPEN_EXR"
        scene.render.image_settings.color_depth = "32"
        world = bpy.data.worlds.new("dark")
        world.use_nodes = True
        world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
        scene.world = world
        self.sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
        self.sun.data.energy = 1.0
        self.sun.data.angle = 0.0
        self.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        self.camera.data.type = "ORTHO"
        self.camera.data.clip_start = 0.001
        scene.collection.objects.link(self.sun)
        scene.collection.objects.link(self.camera)
        scene.camera = self.camera

    def axis(self, way):
        from mathutils import Vector

        x, y, z = way
        # glTF has y up: its importer turns vertices to Blender's axes, z up.
        return self.turn @ (Vector((x, -z, y)) if self.is_gltf else Vector(way))

    def place(self, thing, way):
        """Puts a thing that looks along its -z a metre away, with the warp upwards."""
        from mathutils import Matrix

        back = self.axis(way)
        right = self.axis((0.0, 1.0, 0.0)).cross(back).normalized()
        columns = Matrix((right, back.cross(right), back)).transposed()
        thing.matrix_world = Matrix.Translation(back) @ columns.to_4x4()

    def render(self, incident, exitant, width_m=0.02, pixels=48, samples=64):
        import numpy

        scene = self.bpy.context.scene
        scene.render.resolution_x = scene.render.resolution_y = pixels
        scene.cycles.samples = samples
        self.camera.data.ortho_scale = width_m
        self.place(self.sun, direction(incident))
        self.place(self.camera, direction(exitant))
        scene.render.filepath = str(self.scratch / "patch.exr")
        self.bpy.ops.render.render(write_still=True)
        image = self.bpy.data.images.load(str(self.scratch / "patch.exr"), check_existing=False)
        values = numpy.array(image.pixels[:]).reshape(pixels, pixels, 4)[:, :, :3]
        self.bpy.data.images.remove(image)
        return values

    def bsdf(self, pair):
        cosine = abs(math.cos(math.radians(pair["incident"]["theta_deg"])))
        return self.render(pair["incident"], pair["exitant"]).mean(axis=(0, 1)) / cosine


def rms(values, references, cosines):
    import numpy

    values, references = numpy.array(values), numpy.array(references)
    weights = numpy.array(cosines)[:, None]
    error = (((values - references) * weights) ** 2).sum()
    return math.sqrt(error / ((references * weights) ** 2).sum())


def check_blender(folder, baked, name):
    import bpy
    import numpy

    is_shown = lambda p: (p["side"] == "face" and p["incident"]["theta_deg"] < 65
                          and p["exitant"]["theta_deg"] < 65)
    pairs = [p for p in baked["pairs"] if is_shown(p)][:24]
    through = [p for p in baked["pairs"] if p["side"] == "through"
               and abs(math.cos(math.radians(p["exitant"]["theta_deg"]))) > 0.5][:4]
    cosines = [math.cos(math.radians(p["exitant"]["theta_deg"])) for p in pairs]
    for file, model in (("material.glb", "glTF 2.0"), ("material.usda", "USD Preview Surface")):
        blender = Blender(folder / file, folder)
        found = [blender.bsdf(p) for p in pairs]
        expected = [p["materials"][model] for p in pairs]
        measured = [p["measured"] for p in pairs]
        own = rms(found, expected, cosines)
        against = rms(found, measured, cosines)
        formula = rms(expected, measured, cosines)
        bias = numpy.mean(numpy.array(found) * numpy.array(cosines)[:, None]) / numpy.mean(
            numpy.array(measured) * numpy.array(cosines)[:, None]) - 1
        behind = [blender.bsdf(p).mean() / max(numpy.mean(p["measured"]), 1e-9) for p in through]
        shown = [numpy.mean(p["materials"][model]) / numpy.mean(p["measured"]) for p in through]
        print(f"  Blender {bpy.app.version_string}, {file}, {len(pairs)} pairs: from the formulas "
              f"rms {100 * own:.1f} %; from organza's far field rms {100 * against:.1f} % (the "
              f"formulas {100 * formula:.1f} %), total {100 * bias:+.1f} %; scattered through: "
              f"{100 * numpy.mean(behind):.0f} % of the measurement (the formulas "
              f"{100 * numpy.mean(shown):.0f} %)")
        assert own < BLENDER_LIMIT, (name, file, own)
        # The twin: twice the light.
        assert rms([2 * f for f in found], expected, cosines) > BLENDER_LIMIT


SCENE = """
[render]
spp = 64
exposure = 0.0
[camera]
kind = "orthographic"
origin_mm = {origin}
target_mm = [0.0, 0.0, 0.0]
up = [0.0, 1.0, 0.0]
width_mm = {width_mm}
resolution = [{pixels}, {pixels}]
[[light]]
kind = "directional"
direction = {travels}
irradiance = [{sun}, {sun}, {sun}]
[[light]]
kind = "environment"
radiance = [{sky}, {sky}, {sky}]
[[object]]
kind = "cloth"
fabric = "{fabric}"
model = "fibres"
"""

# The picture of docs/bake.md: a patch under a lamp and a dim sky, fibres beside materials.
LIGHT = {"theta_deg": 40.0, "phi_deg": 150.0}
EYE = {"theta_deg": 25.0, "phi_deg": -80.0}
WIDTH_MM = {"denim": 6.0, "organza": 3.0}
SUN, SKY, PIXELS = 2.4, 0.25, 200


def picture(organza, out, path):
    """Two rows, denim and organza: textures, organza's fibres, Blender's glTF and USD."""
    import numpy
    from PIL import Image

    def shown(values):
        values = numpy.clip(values, 0, 1)
        srgb = numpy.where(values <= 0.0031308, 12.92 * values,
                           1.055 * values ** (1 / 2.4) - 0.055)
        return Image.fromarray((255 * srgb + 0.5).astype("uint8"))

    rows = []
    for fabric in FABRICS:
        folder = out / fabric
        scene = folder / "scene.toml"
        scene.write_text(SCENE.format(
            origin=[20 * x for x in direction(EYE)], travels=[-x for x in direction(LIGHT)],
            width_mm=WIDTH_MM[fabric], pixels=PIXELS, sun=SUN, sky=SKY,
            fabric=pathlib.Path(f"scenes/fabrics/{fabric}.toml").resolve()))
        png = folder / "scene.png"
        subprocess.run([organza, "render", scene, "-o", png, "--quiet"], check=True)
        images = []
        for name in ("base_color", "normal"):
            texture = Image.open(folder / "textures" / f"{name}.png").convert("RGB")
            images.append(texture.resize((PIXELS, PIXELS)))
        values = []
        for file in ("material.glb", "material.usda"):
            blender = Blender(folder / file, folder)
            background = blender.bpy.context.scene.world.node_tree.nodes["Background"]
            background.inputs["Color"].default_value = (1, 1, 1, 1)
            background.inputs["Strength"].default_value = SKY
            blender.sun.data.energy = SUN
            values.append(blender.render(LIGHT, EYE, WIDTH_MM[fabric] / 1000, PIXELS, 48)[::-1])
        images.append(Image.open(png).convert("RGB"))
        images += [shown(v) for v in values]
        rows.append(images)
    sheet = Image.new("RGB", (5 * (PIXELS + 4) - 4, 2 * (PIXELS + 4) - 4), "white")
    for y, images in enumerate(rows):
        for x, image in enumerate(images):
            sheet.paste(image, (x * (PIXELS + 4), y * (PIXELS + 4)))
    sheet.quantize(256).save(path, optimize=True)


def main():
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("--organza", required=True)
    words.add_argument("--node", required=True, help="folder with node_modules/gltf-validator")
    words.add_argument("--out", default="target/peers/bake")
    words.add_argument("--picture", help="also make the picture of docs/bake.md (needs Pillow)")
    arguments = words.parse_args()
    out = pathlib.Path(arguments.out).resolve()
    for fabric in FABRICS:
        folder = out / fabric
        folder.parent.mkdir(parents=True, exist_ok=True)
        baked = bake(arguments.organza, fabric, folder)
        print(fabric)
        check_materialx(folder)
        check_usd(folder)
        check_gltf(folder, arguments.node)
        check_blender(folder, baked, fabric)
    check_colourways(arguments.organza, out, arguments.node)
    check_curves(arguments.organza, out)
    if arguments.picture:
        picture(arguments.organza, out, arguments.picture)
    print("bake: all checks passed")


if __name__ == "__main__":
    sys.exit(main())
