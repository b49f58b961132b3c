"""Blender imports an organza .vdb by the steps of docs/volumes.md and renders it with Cycles.

    organza voxelize scenes/fabrics/denim.toml -o denim.vdb --voxel-um 20 --set tile.repeats=[3,2]
    python tests/peers/check_blender.py denim.vdb --picture denim_cycles.png

Needs `pip install bpy==4.5.15 numpy`. Checks that the grids arrive, that light through a black
cloth falls as the densities of the file say, and that the scale of the object does not change
the picture. Exits with 1 at the first difference.
"""
import argparse
import math
import pathlib
import tempfile

import sys

import bpy
import numpy as np

# The module brings its own OpenVDB, where Blender's interpreter would look for it.
own = pathlib.Path(bpy.utils.resource_path("LOCAL"))
sys.path += [str(folder) for folder in own.glob("python/lib/python3*/site-packages")]
import openvdb  # noqa: E402

THINNED = 0.1
GRIDS = {"density", "orientation", "spread", "sggx_diag", "sggx_offdiag", "albedo", "yarn"}


def empty_scene(width, height, samples):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = samples
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = 64
    scene.cycles.volume_bounces = 64
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Standard"
    scene.world = bpy.data.worlds.new("sky")
    scene.world.use_nodes = True
    return scene


def sky(scene, radiance):
    background = scene.world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*radiance, 1.0)


def import_tile(path):
    """Add > Volume > Import OpenVDB."""
    bpy.ops.object.volume_import(filepath=str(path))
    return bpy.context.object


def cloth_material(density=1.0, black=False):
    """A Principled Volume that reads the grids."""
    material = bpy.data.materials.new("cloth")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    volume = tree.nodes.new("ShaderNodeVolumePrincipled")
    volume.inputs["Density Attribute"].default_value = "density"
    volume.inputs["Density"].default_value = density
    volume.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0) if black else (1.0, 1.0, 1.0, 1.0)
    volume.inputs["Color Attribute"].default_value = "" if black else "albedo"
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(volume.outputs["Volume"], output.inputs["Volume"])
    return material


def camera(scene, centre, distance, width, tilt_deg=0.0):
    data = bpy.data.cameras.new("eye")
    data.type, data.ortho_scale = "ORTHO", width
    data.clip_start, data.clip_end = distance / 1000, distance * 10
    eye = bpy.data.objects.new("eye", data)
    tilt = math.radians(tilt_deg)
    eye.location = (centre[0], centre[1] - distance * math.sin(tilt), centre[2] + distance * math.cos(tilt))
    eye.rotation_euler = (tilt, 0.0, 0.0)
    scene.collection.objects.link(eye)
    scene.camera = eye


def rendered(scene, picture=None):
    """Linear values, bottom row first; a PNG too if a path is given."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "picture.exr"
        settings = scene.render.image_settings
        settings.file_format, settings.color_depth = "OPEN_EXR", "32"
        scene.render.filepath = str(path)
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(str(path))
        values = np.array(image.pixels[:], dtype=np.float32).reshape(image.size[1], image.size[0], 4)
        if picture:
            settings.file_format, settings.color_mode, settings.color_depth = "PNG", "RGB", "8"
            bpy.data.images["Render Result"].save_render(str(picture), scene=scene)
        return values[..., :3]


def densities(path):
    """Density per voxel and the size of a voxel in millimetres, read by OpenVDB."""
    grid = openvdb.read(str(path), "density")
    low, high = grid.evalActiveVoxelBoundingBox()
    array = np.zeros(np.subtract(high, low) + 1, dtype=np.float32)
    grid.copyToArray(array, ijk=low)
    first, second = (grid.transform.indexToWorld(c) for c in (low, tuple(x + 1 for x in low)))
    return array, np.subtract(second, first), np.array(first)


def black_cloth(path, scale):
    """The share of a white sky that a black cloth lets through from above, a pixel a voxel."""
    array, voxel, first = densities(path)
    size = voxel * array.shape
    scene = empty_scene(array.shape[0], array.shape[1], 256)
    sky(scene, (1.0, 1.0, 1.0))
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = np.array(voxel[:2]) / min(voxel[:2])
    tile = import_tile(path)
    tile.scale = (scale,) * 3
    # Thinned, so that dense yarns let some light through, too.
    tile.data.materials.append(cloth_material(density=THINNED, black=True))
    centre = (first - 0.5 * voxel + 0.5 * size) * scale
    camera(scene, centre, 3.0 * scale, max(size[:2]) * scale)
    return rendered(scene)[..., 1], np.exp(-THINNED * np.sum(array, axis=2) * voxel[2]).T


def check_transmittance(path):
    seen, expected = black_cloth(path, 1.0)
    print(f"black cloth: Cycles lets {seen.mean():.4f} of the light through, the densities {expected.mean():.4f}")
    assert abs(seen.mean() - expected.mean()) < 0.01
    likeness = lambda other: np.corrcoef(seen.ravel(), other.ravel())[0, 1]
    # The twin: the same cloth, a quarter of the tile further.
    twin = np.roll(expected, [n // 4 for n in expected.shape], axis=(0, 1))
    print(f"    correlation of the pixels {likeness(expected):.3f}, with a tile out of place {likeness(twin):.3f}")
    assert likeness(expected) > 0.9 > 0.7 > likeness(twin)
    small, _ = black_cloth(path, 0.001)
    print(f"    scaled to metres: {small.mean():.4f}")
    assert abs(small.mean() - seen.mean()) < 0.005, "the scale of the object changes its density"


def picture(path, target, samples, width, height):
    """The cloth in sunlight."""
    array, voxel, first = densities(path)
    scene = empty_scene(width, height, samples)
    sky(scene, (0.5, 0.55, 0.6))
    tile = import_tile(path)
    tile.data.materials.append(cloth_material())
    size = voxel * array.shape
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.data.angle = 4.0, math.radians(1.0)
    sun.rotation_euler = (math.radians(35.0), math.radians(30.0), 0.0)
    scene.collection.objects.link(sun)
    # The whole tile, with a tenth around it.
    camera(scene, first + 0.5 * size, 10.0, 1.1 * max(size[0], size[1] * width / height), tilt_deg=30.0)
    values = rendered(scene, target)
    print(f"picture: mean {values.mean(axis=(0, 1))}")
    assert np.isfinite(values).all() and values.mean() > 0.01


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("vdb", type=pathlib.Path)
    parser.add_argument("--picture", type=pathlib.Path)
    parser.add_argument("--samples", type=int, default=64)
    arguments = parser.parse_args()
    path = arguments.vdb.resolve()
    print(f"Blender {bpy.app.version_string}")
    empty_scene(8, 8, 1)
    tile = import_tile(path)
    tile.data.grids.load()
    found = {grid.name for grid in tile.data.grids}
    assert found == GRIDS, found
    array, voxel, _ = densities(path)
    size = np.array(tile.dimensions)
    print(f"{len(found)} grids, {array.shape} voxels, {size.round(3)} units")
    assert np.allclose(size[:2], (voxel * array.shape)[:2], atol=2.1 * voxel.max()), (size, voxel * array.shape)
    check_transmittance(path)
    if arguments.picture:
        picture(path, arguments.picture.resolve(), arguments.samples, 420, 380)


if __name__ == "__main__":
    main()
