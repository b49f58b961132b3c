"""Cloth of organza in Blender: choose a draft or a fabric, change threads, yarn and colours, and
make a material for the selected meshes, fibres as curves, or a volume, at true scale."""

import pathlib
import tempfile

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

from . import program, shown
from .cloth import Cloth

KINDS = [
    ("MATERIAL", "Material", "Textures for the selected meshes, which repeat at true scale"),
    ("FIBRES", "Fibres", "Every fibre as a curve, in a flat piece at the 3D cursor"),
    ("VOLUME", "Volume", "Density and albedo of a tile as OpenVDB, at the 3D cursor"),
]


class Preferences(bpy.types.AddonPreferences):
    bl_idname = __package__
    program: StringProperty(
        name="Program",
        subtype="FILE_PATH",
        description="organza; without, the one on the path or the package of this extension",
    )

    def draw(self, _context):
        self.layout.prop(self, "program")


class Settings(bpy.types.PropertyGroup):
    source: StringProperty(
        name="Cloth",
        subtype="FILE_PATH",
        default="twill-3-1-s",
        description="A draft (.wif), a fabric (.toml) or a named weave such as satin-8-3",
    )
    kind: EnumProperty(name="Make", items=KINDS)
    has_threads: BoolProperty(name="Threads per cm")
    warp_per_cm: FloatProperty(name="Warp", default=30.0, min=0.5, max=500.0)
    weft_per_cm: FloatProperty(name="Weft", default=25.0, min=0.5, max=500.0)
    has_yarn: BoolProperty(name="Yarn")
    tex: FloatProperty(name="tex", default=20.0, min=0.1, max=5000.0, description="Grams per km")
    has_colours: BoolProperty(name="Colours")
    warp_colour: FloatVectorProperty(
        name="Warp", subtype="COLOR", size=3, min=0.0, max=1.0, default=(0.026, 0.04, 0.095)
    )
    weft_colour: FloatVectorProperty(
        name="Weft", subtype="COLOR", size=3, min=0.0, max=1.0, default=(0.6, 0.55, 0.45)
    )
    resolution: IntProperty(
        name="Texels", default=512, min=16, max=4096, description="Of the longer side of textures"
    )
    repeats: IntVectorProperty(name="Repeats", size=2, default=(4, 4), min=1, max=1000)
    voxel_um: FloatProperty(name="Voxel, um", default=20.0, min=1.0, max=1000.0)


def cloth_of(settings, folder):
    source = settings.source
    if source.startswith("//"):
        source = bpy.path.abspath(source)
    return Cloth(
        source,
        folder,
        per_cm=(settings.warp_per_cm, settings.weft_per_cm) if settings.has_threads else None,
        tex=settings.tex if settings.has_yarn else None,
        colours=(settings.warp_colour, settings.weft_colour) if settings.has_colours else None,
    )


class Make(bpy.types.Operator):
    """Make the cloth"""

    bl_idname = "organza.make"
    bl_label = "Make cloth"
    bl_options = {"REGISTER", "UNDO"}

    def start(self, context):
        """Begins; false, with a report, where that is not possible."""
        settings = context.scene.organza
        self.things = [o for o in context.selected_objects if o.type == "MESH"]
        if settings.kind == "MATERIAL":
            flat = [o.name for o in self.things if shown.mm_per_uv(o) == 0.0]
            if not self.things or flat:
                missing = f"{flat[0]} has no UV map" if flat else "select a mesh with a UV map"
                self.report({"ERROR"}, missing)
                return False
        add_on = context.preferences.addons.get(__package__)
        named = bpy.path.abspath(add_on.preferences.program) if add_on else ""
        self.words, self.environment = program.found(named)
        if not self.words:
            self.report({"ERROR"}, "organza was not found; name the program in the preferences")
            return False
        self.cloth = cloth_of(settings, pathlib.Path(tempfile.mkdtemp(prefix="organza_")))
        self.steps = [self.cloth.prepare, self.product]
        return self.next()

    def product(self):
        settings = bpy.context.scene.organza
        ways = {
            "MATERIAL": lambda: self.cloth.material(settings.resolution),
            "FIBRES": lambda: self.cloth.fibres(settings.repeats),
            "VOLUME": lambda: self.cloth.volume(settings.voxel_um),
        }
        self.path, command = ways[settings.kind]()
        return [[*command, *self.cloth.changes()]]

    def next(self):
        """Starts the next step; false, with a report, where it cannot be."""
        try:
            commands = self.steps.pop(0)()
        except (OSError, ValueError) as error:
            self.report({"ERROR"}, str(error))
            return False
        self.run = program.Run(self.words, self.environment, commands)
        return True

    def ended(self, context):
        """What became of a step that is done: None to go on, else how the operator ends."""
        if self.run.error:
            self.report({"ERROR"}, self.run.error)
            return {"CANCELLED"}
        if self.run.is_stopped:
            return {"CANCELLED"}
        if self.steps:
            return None if self.next() else {"CANCELLED"}
        place = context.scene.cursor.location
        kind = context.scene.organza.kind
        if kind == "MATERIAL":
            shown.baked(self.path, self.things)
        else:
            (shown.fibres if kind == "FIBRES" else shown.volume)(self.path, place)
        return {"FINISHED"}

    def execute(self, context):
        """Waits for the cloth; `invoke` leaves Blender usable meanwhile."""
        if not self.start(context):
            return {"CANCELLED"}
        while True:
            self.run.wait()
            result = self.ended(context)
            if result:
                return result

    def invoke(self, context, _event):
        if not self.start(context):
            return {"CANCELLED"}
        self.timer = context.window_manager.event_timer_add(0.2, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self.run.stop()
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        context.workspace.status_text_set(f"organza (Esc stops): {self.run.line}")
        result = self.ended(context) if self.run.is_done else None
        if result:
            context.window_manager.event_timer_remove(self.timer)
            context.workspace.status_text_set(None)
            return result
        return {"RUNNING_MODAL"}


class Panel(bpy.types.Panel):
    bl_idname = "VIEW3D_PT_organza"
    bl_label = "Cloth"
    bl_space_type, bl_region_type, bl_category = "VIEW_3D", "UI", "organza"

    def draw(self, context):
        settings, layout = context.scene.organza, self.layout
        layout.use_property_split = True
        layout.prop(settings, "source")
        for switch, keys in [
            ("has_threads", ["warp_per_cm", "weft_per_cm"]),
            ("has_yarn", ["tex"]),
            ("has_colours", ["warp_colour", "weft_colour"]),
        ]:
            layout.prop(settings, switch)
            if getattr(settings, switch):
                for key in keys:
                    layout.prop(settings, key)
        layout.prop(settings, "kind", expand=True)
        own = {"MATERIAL": "resolution", "FIBRES": "repeats", "VOLUME": "voxel_um"}
        layout.prop(settings, own[settings.kind])
        layout.operator(Make.bl_idname)


CLASSES = [Preferences, Settings, Make, Panel]


def register():
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Scene.organza = PointerProperty(type=Settings)


def unregister():
    del bpy.types.Scene.organza
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
