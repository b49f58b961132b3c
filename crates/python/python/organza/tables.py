"""Scenes and fabrics: dictionaries with the keys of their TOML files."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Iterable, Mapping, Optional, Union

from . import _native, _toml
from .drafts import Draft
from .volumes import Volume

AnyPath = Union[str, "os.PathLike[str]"]


class _Table(dict[str, Any]):
    """A dictionary with the keys of a TOML file."""

    path: Optional[Path]
    """The file it was read from; names of other files in it begin at its folder. None: they
    begin at the working folder."""

    _name = "<table>"

    def __init__(
        self,
        table: Union[Mapping[str, Any], Iterable[tuple[str, Any]]] = (),
        *,
        path: Optional[AnyPath] = None,
    ):
        super().__init__(table)
        if path is None:
            path = getattr(table, "path", None)
        self.path = None if path is None else Path(path)

    def to_toml(self) -> str:
        """The text of the file. Objects in it (:class:`Draft`, :class:`Volume`, a fabric in a
        scene) cannot be written into one file and are refused."""
        return _toml.text(self)

    def save(self, path: AnyPath) -> None:
        """Writes the file. Names in it are kept as they are."""
        Path(path).write_text(self.to_toml(), encoding="utf-8")

    def __repr__(self) -> str:
        return f"organza.{type(self).__name__}({dict.__repr__(self)})"


class Fabric(_Table):
    """A fabric: a dictionary with the keys of a fabric file, see docs/fabrics.md.

    ::

        fabric = organza.load("scenes/fabrics/denim.toml")
        fabric["warp"]["per_cm"] = 30
        fabric["draft"] = organza.Draft.named("satin-8-3")
    """

    _name = "<fabric>"


class Scene(_Table):
    """A scene: a dictionary with the keys of a scene file, see docs/scenes.md.

    ``object[i]["fabric"]`` may be a :class:`Fabric` (or a dictionary) in place of a file's
    name, and ``object[i]["file"]`` a :class:`Volume`::

        scene = organza.Scene({
            "camera": {"origin_mm": [1, 1, 5], "target_mm": [1, 1, 0], "width_mm": 2,
                       "resolution": [64, 64]},
            "light": [{"kind": "environment", "radiance": [1, 1, 1]}],
            "object": [{"kind": "cloth", "fabric": fabric}],
        })
        picture = organza.render(scene, spp=16)["rgb"]
    """

    _name = "<scene>"


def load(source: Union[AnyPath, Mapping[str, Any]]) -> Union[Scene, Fabric, Draft, Volume]:
    """Reads a file, or takes a dictionary, as what it is.

    ``.toml`` and dictionaries give a :class:`Scene` or a :class:`Fabric`, ``.wif`` a
    :class:`Draft`, ``.ovox``, ``.vdb``, ``.vol`` and ``.nrrd`` a :class:`Volume`. Keys and the
    types of their values are checked; what a file names is read when it is used.

    Raises
    ------
    InputError
        Names the file, the place in it, the key, what was expected and the nearest valid name.
    """
    if isinstance(source, Mapping):
        files = GivenFiles()
        name = files.give_table(source)
        kind, _ = _native.read_toml(name, files.files[name])
        return _table(kind, source, None)
    path = Path(source)
    ending = path.suffix.lower()
    if ending == ".wif":
        return Draft.from_wif(path)
    if ending in (".ovox", ".vdb", ".vol", ".nrrd"):
        return Volume.read(path)
    kind, table = _native.read_toml(path, None)
    return _table(kind, json.loads(table), path)


def parsed(text: bytes, path: Optional[AnyPath]) -> Union[Scene, Fabric]:
    """The table of a file's text."""
    kind, table = _native.read_toml("<text>", text)
    return _table(kind, json.loads(table), path)


def _table(
    kind: str, table: Mapping[str, Any], path: Optional[AnyPath]
) -> Union[Scene, Fabric]:
    return Scene(table, path=path) if kind == "scene" else Fabric(table, path=path)


class GivenFiles:
    """Files in memory: dictionaries as TOML texts, volumes and drafts, by their paths."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}

    def give(self, path: str, data: bytes) -> str:
        """Gives a file and returns its path, to which a number is added if it is taken."""
        stem, ending = os.path.splitext(path)
        count = 1
        while self.files.get(path, data) != data:
            count += 1
            path = f"{stem} {count}{ending}"
        self.files[path] = data
        return path

    def give_table(self, source: Union[AnyPath, Mapping[str, Any]], folder: str = "") -> str:
        """The path of a scene or fabric, whose names begin at ``folder`` if it has no path.
        A path is kept, and nothing is given for it."""
        if not isinstance(source, Mapping):
            return os.fspath(source)
        is_fabric = "draft" in source
        own = getattr(source, "path", None)
        if own is not None:
            path = os.fspath(own)
        elif folder:
            path = os.path.join(os.path.abspath(""), "<fabric>" if is_fabric else "<scene>")
        else:
            path = "<fabric>" if is_fabric else "<scene>"
        table = dict(source)
        inside = os.path.dirname(path)
        if is_fabric and isinstance(table["draft"], Draft):
            table["draft"] = self._draft(table["draft"], inside)
        objects = table.get("object")
        if isinstance(objects, (list, tuple)):
            table["object"] = [self._object(one, inside) for one in objects]
        return self.give(path, _toml.text(table).encode())

    def _draft(self, draft: Draft, folder: str) -> dict[str, Any]:
        if draft._wif is None:
            return draft._table
        path = self.give(os.path.join(folder, "<draft>.wif"), draft._wif)
        return {"wif": os.path.basename(path)}

    def _object(self, one: Any, folder: str) -> Any:
        if not isinstance(one, Mapping):
            return one
        table = dict(one)
        fabric, volume = table.get("fabric"), table.get("file")
        if isinstance(fabric, Mapping):
            path = self.give_table(fabric, folder)
            table["fabric"] = os.path.abspath(path) if folder else path
            if table["fabric"] != path:
                self.files[table["fabric"]] = self.files.pop(path)
        if isinstance(volume, Volume):
            count = sum(name.endswith(volume.name) for name in self.files)
            prefix = "" if count == 0 else f"{count + 1} "
            for name, data in volume.files.items():
                self.files[os.path.join(folder, prefix + name)] = data
            table["file"] = prefix + volume.name
        return table
