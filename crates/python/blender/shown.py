"""Brings what organza made into the scene, at true scale."""

import math
import re

import bpy
from mathutils import Vector

from . import material

# How many millimetres of cloth a unit of an object's texture coordinates takes.
SCALE = "organza_mm_per_uv"


def unit_mm():
    """Millimetres of a unit of length of the scene."""
    return 1000.0 * bpy.context.scene.unit_settings.scale_length


def mm_per_uv(thing):
    """Millimetres that a unit of texture coordinates takes on a mesh, in the mean by area; 0
    without such coordinates."""
    mesh = thing.data
    layer = mesh.uv_layers.active
    if layer is None:
        return 0.0
    mesh.calc_loop_triangles()
    world, area, area_uv = thing.matrix_world, 0.0, 0.0
    for triangle in mesh.loop_triangles:
        a, b, c = (world @ mesh.vertices[v].co for v in triangle.vertices)
        area += 0.5 * (b - a).cross(c - a).length
        p, q, r = (Vector(layer.data[loop].uv) for loop in triangle.loops)
        area_uv += 0.5 * abs((q - p).cross(r - p))
    return math.sqrt(area / area_uv) * unit_mm() if area_uv > 0.0 else 0.0


def baked(folder, things):
    """The material of a folder of `organza bake`, given to meshes."""
    made = material.load(folder)
    # The importer adds a mesh to show it.
    for shown in [o for o in bpy.data.objects if o.type == "MESH" and o not in things]:
        if any(slot.material == made for slot in shown.material_slots):
            bpy.data.objects.remove(shown)
    at_true_scale(made, material.read(folder)["tile_mm"])
    for thing in things:
        thing[SCALE] = mm_per_uv(thing)
        thing.data.materials.clear()
        thing.data.materials.append(made)
    return made


def at_true_scale(made, tile_mm):
    """Lets the textures repeat after a tile, whatever the coordinates of an object."""
    nodes, links = made.node_tree.nodes, made.node_tree.links
    place = nodes.new("ShaderNodeUVMap")
    scale = nodes.new("ShaderNodeAttribute")
    scale.attribute_type, scale.attribute_name = "OBJECT", SCALE
    mm = nodes.new("ShaderNodeVectorMath")
    mm.operation = "SCALE"
    links.new(place.outputs["UV"], mm.inputs[0])
    links.new(scale.outputs["Fac"], mm.inputs["Scale"])
    tiles = nodes.new("ShaderNodeVectorMath")
    tiles.operation = "DIVIDE"
    links.new(mm.outputs[0], tiles.inputs[0])
    tiles.inputs[1].default_value = (*tile_mm, 1.0)
    for node in nodes:
        if node.bl_idname == "ShaderNodeTexImage":
            links.new(tiles.outputs[0], node.inputs["Vector"])


def beta_of(value, form):
    """The roughness from 0 to 1 at which a growing function takes a value."""
    low, high = 0.0, 1.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if form(middle) < value else (low, middle)
    return 0.5 * (low + high)


def hair(name, text):
    """A Principled Hair with the parameters of a `chiang_hair_bsdf`: both are the model of
    [Chiang2016], with absorption in radii of the fibre. Without one, a plain surface."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links

    def vector(key):
        match = re.search(rf"inputs:{key} = \(?([^)\n]+)\)?", text)
        return [float(x) for x in match[1].split(",")] if match else None

    absorption = vector("absorption_coefficient")
    if absorption is None:
        surface = nodes["Principled BSDF"]
        surface.inputs["Base Color"].default_value = (*(vector("diffuseColor") or [0.5] * 3), 1.0)
        return made
    variance, logistic = vector("roughness_R")
    along = beta_of(variance, lambda b: (0.726 * b + 0.812 * b**2 + 3.7 * b**20) ** 2)
    root = math.sqrt(math.pi / 8)
    around = beta_of(logistic, lambda b: root * (0.265 * b + 1.194 * b**2 + 5.372 * b**22))
    nodes.remove(nodes["Principled BSDF"])
    fibre = nodes.new("ShaderNodeBsdfHairPrincipled")
    fibre.model, fibre.parametrization = "CHIANG", "ABSORPTION"
    for key, value in {
        "Absorption Coefficient": absorption,
        "Roughness": along,
        "Radial Roughness": around,
        "Coat": 0.0,
        "IOR": vector("ior")[0],
        "Offset": (vector("cuticle_angle")[0] - 0.5) * math.pi,
        "Random Color": 0.0,
        "Random Roughness": 0.0,
    }.items():
        if key in fibre.inputs:
            fibre.inputs[key].default_value = value
    links.new(fibre.outputs[0], nodes["Material Output"].inputs["Surface"])
    return made


def fibres(path, place):
    """The curves of a file of `organza export usd`, with hair materials, at a place."""
    present = set(bpy.data.objects)
    options = {"apply_unit_conversion_scale": False}
    known = bpy.ops.wm.usd_import.get_rna_type().properties.keys()
    options = {key: value for key, value in options.items() if key in known}
    bpy.ops.wm.usd_import(filepath=str(path), import_materials=False, **options)
    text = path.read_text(encoding="utf-8")
    blocks = re.split(r"def Material \"", text)[1:]
    materials = {block.split('"', 1)[0]: block for block in blocks}
    new = [o for o in bpy.data.objects if o not in present]
    for thing in (o for o in new if o.type == "CURVES"):
        name = thing.data.name if thing.data.name in materials else thing.name.split(".")[0]
        if name in materials:
            thing.data.materials.clear()
            thing.data.materials.append(hair(name, materials[name]))
    # Points carry the tiles, whose own curves lie hidden at a root of their own.
    for points in (o for o in new if o.type == "POINTCLOUD"):
        root = points
        while root.parent is not None:
            root = root.parent
        root.location, root.scale = place, [1.0 / unit_mm()] * 3
    bpy.context.scene.cycles_curves.shape = "THICK"
    return new


def volume(path, place):
    """The grids of a file of `organza voxelize`, with a Principled Volume, at a place."""
    bpy.ops.object.volume_import(filepath=str(path))
    tile = bpy.context.object
    tile.location, tile.scale = place, [1.0 / unit_mm()] * 3
    made = bpy.data.materials.new("cloth volume")
    made.use_nodes = True
    nodes = made.node_tree.nodes
    nodes.clear()
    cloth, output = nodes.new("ShaderNodeVolumePrincipled"), nodes.new("ShaderNodeOutputMaterial")
    cloth.inputs["Density Attribute"].default_value = "density"
    cloth.inputs["Density"].default_value = 1.0
    cloth.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    cloth.inputs["Color Attribute"].default_value = "albedo"
    made.node_tree.links.new(cloth.outputs["Volume"], output.inputs["Volume"])
    tile.data.materials.append(made)
    return [tile]
