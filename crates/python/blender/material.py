"""Imports a folder of `organza bake` into Blender, with the light that the cloth scatters
through, which Blender's importer of glTF leaves out.

The extension calls it. Alone, in Blender: open this file in the text editor, set FOLDER and run
it. From a shell:

    blender --python crates/python/blender/material.py -- denim_material
"""

import json
import pathlib
import sys

import bpy

FOLDER = ""


def read(folder):
    """What a bake says of itself."""
    return json.loads((pathlib.Path(folder) / "bake.json").read_text(encoding="utf-8"))


def load(folder):
    """Imports material.glb; returns the material with diffuse transmission added."""
    folder = pathlib.Path(folder).resolve()
    present = set(bpy.data.materials)
    bpy.ops.import_scene.gltf(filepath=str(folder / "material.glb"))
    material = next(m for m in bpy.data.materials if m not in present)
    baked = read(folder)
    gltf = next(m for m in baked["materials"] if m["name"] == "glTF 2.0")
    textures = folder / baked["textures"][0]["file"]
    add_transmission(material, textures.parent, gltf["parameters"])
    return material


def add_transmission(material, textures, parameters):
    """Divides diffuse light: a share of the base colour is left to what is transmitted, evenly
    spread. Blender would bend what keeps its direction, as a solid body does. Gives highlights
    the widths that glTF means."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    principled = next(n for n in nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    output = next(n for n in nodes if n.bl_idname == "ShaderNodeOutputMaterial")
    solid = principled.inputs["Transmission Weight"]
    for link in list(solid.links):
        links.remove(link)
    solid.default_value = 0.0
    places = [
        node.inputs["Vector"].links[0].from_socket
        for node in nodes
        if node.bl_idname == "ShaderNodeTexImage" and node.inputs["Vector"].is_linked
    ]

    def texture(name, space):
        node = nodes.new("ShaderNodeTexImage")
        if places:
            links.new(places[0], node.inputs["Vector"])
        node.image = bpy.data.images.load(str(textures / name))
        node.image.colorspace_settings.name = space
        return node.outputs["Color"]

    def math(operation, first, second):
        node = nodes.new("ShaderNodeMath")
        node.operation, node.use_clamp = operation, True
        for socket, value in zip(node.inputs, (first, second)):
            if isinstance(value, float):
                socket.default_value = value
            else:
                links.new(value, socket)
        return node.outputs[0]

    def vector(operation, first, second, socket):
        node = nodes.new("ShaderNodeVectorMath")
        node.operation = operation
        links.new(first, node.inputs[0])
        links.new(second, node.inputs[socket])
        return node.outputs[0]

    def given(name):
        socket = principled.inputs[name]
        return socket.links[0].from_socket if socket.is_linked else socket.default_value

    measured = texture("diffuse_transmission.png", "Non-Color")
    even = math("MULTIPLY", measured, parameters["transmittance"])
    forward = math("MULTIPLY", measured, parameters["forward"])
    below = math("SUBTRACT", 1.0, forward)
    base = principled.inputs["Base Color"]
    colour = base.links[0].from_socket
    kept = math("MULTIPLY", below, math("SUBTRACT", 1.0, even))
    links.new(vector("SCALE", colour, kept, "Scale"), base)
    translucent = nodes.new("ShaderNodeBsdfTranslucent")
    hue = texture("diffuse_transmission_color.png", "sRGB")
    spread = vector("SCALE", hue, math("MULTIPLY", below, even), "Scale")
    passed = vector("ADD", spread, vector("SCALE", colour, forward, "Scale"), 1)
    alpha = principled.inputs["Alpha"]
    if alpha.is_linked:
        passed = vector("SCALE", passed, alpha.links[0].from_socket, "Scale")
    links.new(passed, translucent.inputs["Color"])
    both = nodes.new("ShaderNodeAddShader")
    links.new(principled.outputs[0], both.inputs[0])
    links.new(translucent.outputs[0], both.inputs[1])
    links.new(both.outputs[0], output.inputs["Surface"])

    # glTF widens the highlight across the fibres, Blender keeps the product of both widths.
    order = texture("anisotropy.png", "Non-Color")
    strength = math("MULTIPLY", order, parameters["anisotropy"])
    narrow = math("POWER", given("Roughness"), 2.0)
    share = math("MULTIPLY", strength, strength)
    wide = math("ADD", narrow, math("MULTIPLY", share, math("SUBTRACT", 1.0, narrow)))
    unlike = math("SUBTRACT", 1.0, math("DIVIDE", narrow, wide))
    links.new(math("DIVIDE", unlike, 0.9), principled.inputs["Anisotropic"])
    mean = math("POWER", math("MULTIPLY", narrow, wide), 0.25)
    links.new(mean, principled.inputs["Roughness"])


if __name__ == "__main__":
    after = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else []
    load(after[0] if after else FOLDER)
