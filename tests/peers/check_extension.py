"""The Blender extension, used without a window: a material, fibres and a volume of a draft, at true
scale, in scenes that count in metres and in millimetres.

    python tests/peers/check_extension.py --organza target/release/organza --picture blender.png

With --wheel, Blender installs it first from an archive with that wheel, without any program
`organza`. Needs `pip install bpy==4.5.15 numpy`. Exits with 1 at the first difference.
"""
import argparse
import importlib.util
import os
import pathlib
import sys
import tempfile
import traceback

import bpy
from mathutils import Vector

ROOT = pathlib.Path(__file__).resolve().parents[2]
PER_CM = (20.0, 16.0)


def installed(folder):
    """The extension as a package, registered as Blender does."""
    spec = importlib.util.spec_from_file_location(
        "organza_extension", folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    package = importlib.util.module_from_spec(spec)
    sys.modules["organza_extension"] = package
    spec.loader.exec_module(package)
    package.register()
    return package


def empty_scene(unit_m):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.unit_settings.scale_length = unit_m
    settings = scene.organza
    settings.source = "twill-2-2"
    settings.has_threads, (settings.warp_per_cm, settings.weft_per_cm) = True, PER_CM
    settings.has_colours = True
    settings.warp_colour, settings.weft_colour = (0.5, 0.05, 0.04), (0.7, 0.65, 0.5)
    return scene


def plane(size, uv_size):
    """A square of a size, whose texture coordinates run over another."""
    bpy.ops.mesh.primitive_plane_add(size=size)
    thing = bpy.context.object
    for corner in thing.data.uv_layers.active.data:
        corner.uv = [uv_size * x for x in corner.uv]
    return thing


def refused(settings, source):
    settings.source = source
    try:
        bpy.ops.organza.make()
    except RuntimeError as error:
        return str(error)
    raise AssertionError(f"{source} was taken")


def extent_mm(unit_m):
    """Of all curves that are shown, along x and y."""
    shown = bpy.context.evaluated_depsgraph_get().object_instances
    shown = [(i.matrix_world.copy(), i.object.original) for i in shown if i.object.type == "CURVES"]
    corners = [matrix @ Vector(c) for matrix, thing in shown for c in thing.bound_box]
    return [1000 * unit_m * (max(c[i] for c in corners) - min(c[i] for c in corners)) for i in (0, 1)]


def check_material(package, picture):
    scene = empty_scene(0.001)
    first, second = plane(20.0, 1.0), plane(5.0, 3.0)
    for thing in (first, second):
        thing.select_set(True)
    scene.organza.resolution = 1024 if picture else 64
    assert bpy.ops.organza.make() == {"FINISHED"}
    assert first.active_material == second.active_material
    scales = [thing[package.shown.SCALE] for thing in (first, second)]
    print(f"material: {scales[0]:.3f} and {scales[1]:.4f} mm a unit of texture coordinates")
    assert abs(scales[0] - 20.0) < 1e-3 and abs(scales[1] - 5.0 / 3.0) < 1e-3
    # A repeat of four threads, each way.
    tile = next(
        n.inputs[1].default_value
        for n in first.active_material.node_tree.nodes
        if n.bl_idname == "ShaderNodeVectorMath" and n.operation == "DIVIDE"
    )
    repeats = [tile[i] * PER_CM[i] / 10.0 / 4.0 for i in (0, 1)]
    print(f"    tile of {tile[0]:.2f} x {tile[1]:.2f} mm: {repeats[0]:.2f} x {repeats[1]:.2f} repeats")
    assert all(abs(r - round(r)) < 0.01 and r > 0.5 for r in repeats)
    bpy.data.objects.remove(second)
    rendered(scene, first.location, 16.0, picture)


def check_fibres():
    for unit_m in (1.0, 0.001):
        scene = empty_scene(unit_m)
        scene.organza.kind, scene.organza.repeats = "FIBRES", (2, 1)
        assert bpy.ops.organza.make() == {"FINISHED"}
        bpy.context.view_layer.update()
        curves = [o for o in scene.objects if o.type == "CURVES"]
        size = extent_mm(unit_m)
        print(f"fibres in units of {unit_m} m: {len(curves)} yarns, {size[0]:.2f} x {size[1]:.2f} mm")
        # Two tiles side by side of 20 threads each way, and hairs that stand out.
        for length, per_cm, tiles in zip(size, PER_CM, (2, 1)):
            assert 9.0 < length * per_cm / 20.0 / tiles < 14.0, length
        for one in curves:
            fibre = one.data.materials[0].node_tree.nodes["Principled Hair BSDF"]
            along = fibre.inputs["Roughness"].default_value
            assert fibre.parametrization == "ABSORPTION" and 0.05 < along < 0.5, along


def check_volume():
    scene = empty_scene(1.0)
    scene.organza.kind, scene.organza.voxel_um = "VOLUME", 50.0
    assert bpy.ops.organza.make() == {"FINISHED"}
    tile = next(o for o in scene.objects if o.type == "VOLUME")
    size = [1000 * d for d in tile.dimensions]
    print(f"volume: {size[0]:.2f} x {size[1]:.2f} x {size[2]:.2f} mm")
    assert all(9.0 < d * n / 20.0 < 15.0 for d, n in zip(size, PER_CM))


def check_refusals():
    scene = empty_scene(1.0)
    scene.organza.kind = "VOLUME"
    said = refused(scene.organza, "twil-2-2")
    print(f"refused: {said.strip()}")
    assert "twill-2-2" in said
    scene.organza.kind = "MATERIAL"
    assert "select a mesh" in refused(scene.organza, "plain")


def rendered(scene, middle, width, picture):
    if not picture:
        return
    scene.render.engine, scene.cycles.device = "CYCLES", "CPU"
    scene.cycles.samples, scene.cycles.use_denoising = 64, False
    scene.render.resolution_x, scene.render.resolution_y = 640, 400
    scene.view_settings.view_transform = "Standard"
    scene.world = bpy.data.worlds.new("sky")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.3, 0.32, 0.35, 1.0)
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.data.angle, sun.rotation_euler = 3.0, 0.2, (0.9, 0.4, 0.0)
    eye = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
    eye.data.angle, eye.data.clip_start, eye.data.clip_end = 0.4, 0.01 * width, 100 * width
    eye.location = Vector(middle) + width * Vector((0.0, -1.6, 1.9))
    eye.rotation_euler = (Vector(middle) - eye.location).to_track_quat("-Z", "Y").to_euler()
    for one in (sun, eye):
        scene.collection.objects.link(one)
    scene.camera = eye
    scene.render.filepath = str(picture)
    bpy.ops.render.render(write_still=True)


def check_wheel(wheel):
    """Blender's own installation of the extension, which brings the program along."""
    sys.path.insert(0, str(ROOT / "crates/python"))
    import pack_blender

    with tempfile.TemporaryDirectory() as folder:
        archive = pathlib.Path(folder) / "organza_blender.zip"
        pack_blender.pack(archive, [wheel])
        bpy.ops.wm.read_factory_settings(use_empty=True)
        done = bpy.ops.extensions.package_install_files(
            filepath=str(archive), repo="user_default", enable_on_install=True
        )
    assert done == {"FINISHED"}
    assert importlib.util.find_spec("organza"), "the wheel was not installed"
    settings = bpy.context.scene.organza
    settings.source, settings.kind, settings.voxel_um = "twill-2-2", "VOLUME", 50.0
    path = os.environ["PATH"]
    os.environ["PATH"] = "/usr/bin:/bin"
    assert bpy.ops.organza.make() == {"FINISHED"}
    os.environ["PATH"] = path
    assert any(o.type == "VOLUME" for o in bpy.context.scene.objects)
    print("installed by Blender with a wheel: makes a volume")
    bpy.ops.preferences.addon_disable(module="bl_ext.user_default.organza")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--organza", type=pathlib.Path, default=ROOT / "target/release/organza")
    parser.add_argument("--picture", type=pathlib.Path, help="of the material")
    parser.add_argument("--wheel", type=pathlib.Path, help="of the Python package")
    given = parser.parse_args()
    if given.wheel:
        check_wheel(given.wheel)
    os.environ["PATH"] = os.pathsep.join([str(given.organza.resolve().parent), os.environ["PATH"]])
    package = installed(ROOT / "crates/python/blender")
    check_refusals()
    check_fibres()
    check_volume()
    check_material(package, given.picture and given.picture.resolve())


if __name__ == "__main__":
    try:
        main()
    except BaseException:
        traceback.print_exc()
        sys.stdout.flush()
        # bpy may wait for ever at the end of the interpreter.
        os._exit(1)
    sys.stdout.flush()
    os._exit(0)
