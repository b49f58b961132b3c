"""Drapes sheets of cloth by gravity, and writes the meshes where they rest: over the corner of a table,
between two gathered edges above it, and between a rail and a weighted hem.

The fall is Blender's: masses and springs with air, friction and collisions, from `bpy` (pip install
bpy). Weights are within a tenth of those that `organza info` prints; Blender's stiffnesses have no unit, and were
chosen by eye. Gathered edges are curves that keep the cloth's length (sheets.py). Lengths in Blender
are decimetres. The same machine gives the same mesh; another one, rounding otherwise, may fold the cloth elsewhere.

    python3 drape.py [NAME ...]
"""
import sys
from dataclasses import dataclass
from math import cos, pi, sin
from pathlib import Path

import bpy

from sheets import even, row

HERE = Path(__file__).parent
DM = 100.0
FRAMES = 120
# Frames in which held edges are gathered.
GATHER = 70


@dataclass
class Sheet:
    """A sheet along x (weft) and y (warp), lengths in millimetres."""
    name: str
    size_mm: tuple
    cells: tuple
    mass_g_per_m2: float
    # Blender's, without a unit.
    bending: float
    tension: float = 60.0
    shear: float = 4.0
    smooth: int = 6
    # Slopes of the held edges, nearest and farthest in y, along the weft; None: this one is free.
    near: object = None
    far: object = None
    # How far the near edge is moved along x and y once it is gathered.
    moved_mm: tuple = (0.0, 0.0)
    # Turned about z and moved, before the fall.
    turn_deg: float = 0.0
    at_mm: tuple = (0.0, 0.0, 0.0)
    hangs: bool = False
    table_mm: float = 400.0


def table(size_mm):
    """A slab whose corner lies at the origin, its top at height zero, with rounded edges."""
    size = size_mm / DM
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(-size / 2, size / 2, -size / 2))
    slab = bpy.context.object
    slab.scale = (size, size, size)
    bpy.ops.object.transform_apply(location=True, scale=True)
    bevel = slab.modifiers.new("round", "BEVEL")
    bevel.width, bevel.segments = 8.0 / DM, 4
    bpy.ops.object.modifier_apply(modifier="round")
    slab.modifiers.new("table", "COLLISION")
    slab.collision.thickness_outer = 0.012
    slab.collision.cloth_friction = 12.0


def rest(sheet):
    """Where its vertices lie, flat, from the middle: rows along the weft."""
    (width, length), (columns, rows) = sheet.size_mm, sheet.cells
    return [(s, t) for t in even((-length / 2, length / 2), rows) for s in even((-width / 2, width / 2), columns)]


def place(sheet, x, y, z):
    """From the frame of the sheet to Blender's, in decimetres: a sheet that hangs stands upright."""
    x, y, z = (x, -z, y) if sheet.hangs else (x, y, z)
    a = sheet.turn_deg * pi / 180.0
    x, y = x * cos(a) - y * sin(a), x * sin(a) + y * cos(a)
    return tuple((c + d) / DM for c, d in zip((x, y, z), sheet.at_mm))


def cloth(sheet):
    (columns, rows), flat = sheet.cells, rest(sheet)
    across = columns + 1
    corners = [j * across + i for j in range(rows) for i in range(columns)]
    mesh = bpy.data.meshes.new(sheet.name)
    mesh.from_pydata([place(sheet, s, t, 0.0) for s, t in flat], [],
                     [(a, a + 1, a + across + 1, a + across) for a in corners])
    cloth = bpy.data.objects.new(sheet.name, mesh)
    bpy.context.collection.objects.link(cloth)
    modifier = cloth.modifiers.new("cloth", "CLOTH")
    settings = modifier.settings
    settings.quality = 10
    # Of a vertex that stands for a cell of the sheet, as in a world of metres.
    cell = sheet.size_mm[0] / columns * sheet.size_mm[1] / rows / DM**2
    settings.mass = sheet.mass_g_per_m2 * 1e-3 * 100.0 * cell
    settings.tension_stiffness = settings.compression_stiffness = sheet.tension
    settings.shear_stiffness = sheet.shear
    settings.bending_model = "ANGULAR"
    settings.bending_stiffness = sheet.bending
    settings.bending_damping = 2.0
    settings.air_damping = 1.5
    held = {j: slope for j, slope in ((0, sheet.near), (rows, sheet.far)) if slope}
    if held:
        pins = cloth.vertex_groups.new(name="held")
        cloth.shape_key_add(name="flat")
        gathered = cloth.shape_key_add(name="gathered")
        for j, slope in held.items():
            dx, dy = sheet.moved_mm if j == 0 else (0.0, 0.0)
            edge = row([s for s, _ in flat[:across]], lambda s, _: slope(s), 0.0)
            # From end to end around the middle, at the height of the lowest place.
            middle, low = (edge[0][0] + edge[-1][0]) / 2, min(z for _, z in edge)
            for i, (x, z) in enumerate(edge):
                n = j * across + i
                pins.add([n], 1.0, "REPLACE")
                gathered.data[n].co = place(sheet, x - middle + dx, flat[n][1] + dy, z - low)
        settings.vertex_group_mass = "held"
        for frame, value in ((1, 0.0), (GATHER, 1.0)):
            gathered.value = value
            gathered.keyframe_insert("value", frame=frame)
    collisions = modifier.collision_settings
    collisions.distance_min = 0.012
    collisions.use_self_collision = False
    collisions.collision_quality = 3
    modifier.point_cache.frame_end = FRAMES
    # Wrinkles as narrow as the springs are none of the cloth's.
    smooth = cloth.modifiers.new("smooth", "SMOOTH")
    smooth.factor, smooth.iterations = 0.5, sheet.smooth
    return cloth


def write(sheet, resting):
    lines = ["# Written by drape.py, millimetres; texture coordinates in centimetres.", f"o {sheet.name}"]
    for vertex in resting.vertices:
        x, y, z = (DM * c for c in vertex.co)
        lines.append("v {:.2f} {:.2f} {:.2f}".format(*((x, z, -y) if sheet.hangs else (x, y, z))))
    s0, t0 = rest(sheet)[0]
    lines += [f"vt {(s - s0) / 10.0:.3f} {(t - t0) / 10.0:.3f}" for s, t in rest(sheet)]
    for face in resting.polygons:
        lines.append("f " + " ".join(f"{n + 1}/{n + 1}" for n in face.vertices))
    (HERE / f"{sheet.name}.obj").write_text("\n".join(lines) + "\n")


def pleats(count, length_mm, depth, sway, phase):
    """Slopes of an edge with so many pleats, of uneven widths and depths."""
    def slope(s):
        a = 2 * pi * s / length_mm
        turn = count * a + phase + sway * (sin(1.7 * a + 2.1 * phase) + 0.6 * sin(3.1 * a + phase))
        return depth * (1.0 + 0.25 * sin(2.3 * a + 1.3 * phase)) * sin(turn)
    return slope


SHEETS = [
    Sheet("drape", (330.0, 330.0), (88, 88), 290.0, bending=6.0, turn_deg=-12.0, at_mm=(-55.0, 50.0, 4.0),
          table_mm=300.0),
    Sheet("folds", (200.0, 170.0), (100, 84), 90.0, bending=0.3, near=pleats(3.3, 200.0, 1.2, 0.7, 0.4),
          far=pleats(6.0, 200.0, 1.25, 0.9, 1.7), moved_mm=(28.0, 16.0), at_mm=(0.0, 0.0, 2.0)),
    Sheet("velvet", (220.0, 170.0), (100, 78), 250.0, bending=6.0, near=pleats(2.2, 220.0, 1.1, 0.6, 2.0),
          far=pleats(3.6, 220.0, 1.15, 0.8, 0.3), moved_mm=(-25.0, 14.0), at_mm=(0.0, 0.0, 2.0)),
    Sheet("pleats", (180.0, 140.0), (120, 94), 65.0, bending=1.0, smooth=2, near=pleats(4.0, 180.0, 0.9, 0.8, 0.9),
          far=pleats(5.4, 180.0, 0.95, 1.1, 2.6), moved_mm=(22.0, 14.0), at_mm=(0.0, 0.0, 2.0)),
    Sheet("curtain", (150.0, 110.0), (120, 88), 37.0, bending=0.6, smooth=3, near=pleats(7.0, 150.0, 1.2, 1.1, 2.2),
          far=pleats(9.0, 150.0, 1.25, 1.0, 0.6), hangs=True),
]


def main():
    wanted = sys.argv[1:]
    for sheet in SHEETS:
        if wanted and sheet.name not in wanted:
            continue
        bpy.ops.wm.read_factory_settings(use_empty=True)
        if not sheet.hangs:
            table(sheet.table_mm)
        fallen = cloth(sheet)
        scene = bpy.context.scene
        scene.frame_end = FRAMES
        for frame in range(1, FRAMES + 1):
            scene.frame_set(frame)
        resting = fallen.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
        write(sheet, resting)


if __name__ == "__main__":
    main()
