"""Lets a square of cloth fall over the corner of a table, and writes the mesh where it rests.

The fall is Blender's: a sheet of masses and springs with air and friction, from `bpy` (pip install
bpy). Weight is that of the plaid by `organza info`; Blender's stiffnesses have no unit, and were chosen
by eye. Lengths in Blender are decimetres.

    python3 drape.py [FOLDER]
"""
import sys
from math import pi
from pathlib import Path

import bpy

HERE = Path(__file__).parent
EDGE_MM = 330.0
CELLS = 88
FRAMES = 120
# Length of the table's edges, and the radius of their rounding.
TABLE_MM, ROUND_MM = 300.0, 8.0
MASS_G_PER_M2 = 290.0
DM = 100.0


def table():
    """A slab whose corner lies at the origin, its top at height zero."""
    size = TABLE_MM / DM
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(-size / 2, size / 2, -size / 2))
    slab = bpy.context.object
    slab.scale = (size, size, size)
    bpy.ops.object.transform_apply(location=True, scale=True)
    bevel = slab.modifiers.new("round", "BEVEL")
    bevel.width, bevel.segments = ROUND_MM / DM, 4
    bpy.ops.object.modifier_apply(modifier="round")
    slab.modifiers.new("table", "COLLISION")
    slab.collision.thickness_outer = 0.012
    slab.collision.cloth_friction = 12.0


def sheet():
    """The cloth, just above the table, half of it beyond the edges."""
    size = EDGE_MM / DM
    bpy.ops.mesh.primitive_grid_add(
        x_subdivisions=CELLS, y_subdivisions=CELLS, size=size, location=(-0.55, 0.5, 0.04),
        rotation=(0.0, 0.0, -12.0 * pi / 180.0),
    )
    cloth = bpy.context.object
    bpy.ops.object.transform_apply(rotation=True, location=True)
    modifier = cloth.modifiers.new("cloth", "CLOTH")
    settings = modifier.settings
    settings.quality = 10
    # Of a vertex that stands for a cell of the sheet, as in a world of metres.
    settings.mass = MASS_G_PER_M2 * 1e-3 * 100.0 * (size / CELLS) ** 2
    settings.tension_stiffness = settings.compression_stiffness = 60.0
    settings.shear_stiffness = 4.0
    settings.bending_model = "ANGULAR"
    settings.bending_stiffness = 6.0
    settings.bending_damping = 2.0
    settings.air_damping = 1.5
    collisions = modifier.collision_settings
    collisions.distance_min = 0.012
    collisions.use_self_collision = False
    collisions.collision_quality = 3
    modifier.point_cache.frame_end = FRAMES
    # Wrinkles as narrow as the springs are none of the cloth's.
    smooth = cloth.modifiers.new("smooth", "SMOOTH")
    smooth.factor, smooth.iterations = 0.5, 6
    return cloth


def main():
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE
    bpy.ops.wm.read_factory_settings(use_empty=True)
    table()
    cloth = sheet()
    scene = bpy.context.scene
    scene.frame_end = FRAMES
    for frame in range(1, FRAMES + 1):
        scene.frame_set(frame)
    resting = cloth.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    lines = ["# Written by drape.py, millimetres; texture coordinates in centimetres.", "o drape"]
    lines += ["v {:.2f} {:.2f} {:.2f}".format(*(DM * c for c in v.co)) for v in resting.vertices]
    # Rows of vertices run along x.
    step, count = EDGE_MM / CELLS / 10.0, CELLS + 1
    lines += [f"vt {step * (n % count):.3f} {step * (n // count):.3f}" for n in range(count * count)]
    for face in resting.polygons:
        lines.append("f " + " ".join(f"{n + 1}/{n + 1}" for n in face.vertices))
    (folder / "drape.obj").write_text("\n".join(lines) + "\n")


main()
