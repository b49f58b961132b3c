"""A volumetric cloth renderer: weave drafts to fibres to a sparse octree to light.

Files become dictionaries and arrays, commands become functions::

    import organza

    fabric = organza.load("denim.toml")           # a dictionary with the keys of the file
    fabric["draft"] = organza.Draft.named("satin-8-3")
    scene = organza.load("scene.toml")
    scene["object"][0]["fabric"] = fabric
    picture = organza.render(scene, spp=64, seed=0)["rgb"]     # float32, (rows, columns, 3)

    bsdf = organza.measure(fabric, layout="irawan", spp=1024)
    fitted = organza.fit(fabric, data=bsdf)["fabric"]
    volume = organza.voxelize(fabric, voxel_um=10)             # volume.density, volume.axis
    organza.bake(fabric, outdir="material")                    # glTF, MaterialX, USD

Every function computes what the command of its name computes, bit for bit, and releases the
interpreter's lock while it runs. Ctrl-C stops it. What is wrong with a file or an argument is
raised as :class:`InputError`, a :class:`ValueError` with ``file``, ``line``, ``column``,
``key`` and ``message``.

Units: millimetres, degrees, linear Rec.709 colours; the unit is part of a key's name. Fabric
frame: x weft, y warp, z face normal.
"""

from ._native import VERSION as __version__
from .commands import bake, compare, fit, measure, render, voxelize
from .drafts import Draft
from .errors import InputError, MissingFileError, OrganzaWarning, RunError
from .tables import Fabric, Scene, load
from .volumes import Volume

__all__ = [
    "Draft",
    "Fabric",
    "InputError",
    "MissingFileError",
    "OrganzaWarning",
    "RunError",
    "Scene",
    "Volume",
    "__version__",
    "bake",
    "compare",
    "fit",
    "load",
    "measure",
    "render",
    "voxelize",
]
