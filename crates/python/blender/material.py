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
    gltf = next(m for m in read(folder)["materials"] if m["name"] == "glTF 2.0")
    add_transmission(material, folder / "textures", gltf["parameters"]["transmittance"])
    return material


def add_transmission(material, textures, transmittance):
    """Divides diffuse light: a share of the base colour is left to what is transmitted."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    principled = next(n for n in nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    output = next(n for n in nodes if n.bl_idname == "ShaderNodeOutputMaterial")

    def texture(name, space):
        node = nodes.new("ShaderNodeTexImage")
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

    def scaled(colour, factor):
        node = nodes.new("ShaderNodeVectorMath")
        node.operation = "SCALE"
        links.new(colour, node.inputs[0])
        links.new(factor, node.inputs["Scale"])
        return node.outputs[0]

    share = math("MULTIPLY", texture("diffuse_transmission.png", "Non-Color"), transmittance)
    kept = math("SUBTRACT", 1.0, share)
    base = principled.inputs["Base Color"]
    links.new(scaled(base.links[0].from_socket, kept), base)
    translucent = nodes.new("ShaderNodeBsdfTranslucent")
    passed = scaled(texture("diffuse_transmission_color.png", "sRGB"), share)
    alpha = principled.inputs["Alpha"]
    if alpha.is_linked:
        passed = scaled(passed, alpha.links[0].from_socket)
    links.new(passed, translucent.inputs["Color"])
    both = nodes.new("ShaderNodeAddShader")
    links.new(principled.outputs[0], both.inputs[0])
    links.new(translucent.outputs[0], both.inputs[1])
    links.new(both.outputs[0], output.inputs["Surface"])


if __name__ == "__main__":
    after = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else []
    load(after[0] if after else FOLDER)
