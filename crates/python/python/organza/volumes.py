"""Volumes: voxelized cloth, and grids."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Mapping, Optional, Sequence, Union

import numpy as np

from . import _native
from ._run import array
from .errors import InputError, read_bytes

_GRID_PARTS = ("sigma_t", "sggx", "albedo")


class Volume:
    """Voxels of cloth, or grids of density, orientation and colour.

    Read from a file (:func:`organza.load`), voxelized from a fabric
    (:func:`organza.voxelize`), or made from arrays::

        Volume(density=rho, axis=t, spread=0.2, albedo=(0.8, 0.7, 0.6),
               bounds_mm=((0, 0, 0), (1, 1, 0.4)))

    Arrays have one cell an entry, with indices (z, y, x). A scene takes a volume in place of
    its file: ``{"kind": "volume", "file": volume, "repeat_xy": True}``.

    Parameters
    ----------
    density
        (z, y, x), 1/mm: extinction of light that meets the fibres broadside.
    axis
        (z, y, x, 3): mean direction of the fibres, of any length; zero where there is none.
        Without it scattering is isotropic.
    spread
        (z, y, x) or a number, radians: how far fibres deviate from the axis (standard
        deviation of the polar angle).
    albedo
        (z, y, x, 3) or three numbers from 0 to 1: the share of light that is scattered.
        Without it the scene's object gives ``albedo``.
    bounds_mm
        Least and greatest corner of the box that the cells fill.
    """

    def __init__(
        self,
        *,
        density: np.ndarray,
        axis: Optional[np.ndarray] = None,
        spread: Union[np.ndarray, float, None] = None,
        albedo: Union[np.ndarray, Sequence[float], None] = None,
        bounds_mm: Sequence[Sequence[float]],
    ):
        density = np.asarray(density, dtype="<f4")
        if density.ndim != 3 or 0 in density.shape:
            raise _wrong("density", "(z, y, x) with at least one cell", density)
        cells = density.shape
        channels, parts = ["density"], [density[..., None]]
        if axis is not None:
            axis = np.asarray(axis, dtype="<f4")
            if axis.shape != (*cells, 3):
                raise _wrong("axis", f"{(*cells, 3)}", axis)
            spread = np.asarray(0.0 if spread is None else spread, dtype="<f4")
            if spread.shape not in ((), cells):
                raise _wrong("spread", f"a number or {cells}", spread)
            channels += ["orientation_x", "orientation_y", "orientation_z", "spread"]
            parts += [axis, np.broadcast_to(spread, cells)[..., None]]
        elif spread is not None:
            raise InputError("spread: goes with axis", key="spread")
        if albedo is not None:
            albedo = np.asarray(albedo, dtype="<f4")
            if albedo.shape not in ((3,), (*cells, 3)):
                raise _wrong("albedo", f"three numbers or {(*cells, 3)}", albedo)
            channels += ["albedo_r", "albedo_g", "albedo_b"]
            parts.append(np.broadcast_to(albedo, (*cells, 3)))
        low, high = (np.asarray(corner, dtype=float) for corner in bounds_mm)
        if low.shape != (3,) or high.shape != (3,) or not (low < high).all():
            message = f"expected two corners, the least first, found {bounds_mm}"
            raise InputError(f"bounds_mm: {message}", key="bounds_mm", message=message)
        counts = np.array(cells[::-1])
        edge = ((high - low) / counts).tolist()
        first = (low + (high - low) / counts / 2).tolist()
        header = (
            f"NRRD0004\ntype: float\ndimension: 4\nspace dimension: 3\n"
            f"sizes: {len(channels)} {counts[0]} {counts[1]} {counts[2]}\n"
            f"space directions: none ({edge[0]!r},0,0) (0,{edge[1]!r},0) (0,0,{edge[2]!r})\n"
            "centerings: none cell cell cell\nkinds: list domain domain domain\n"
            'endian: little\nencoding: raw\nspace units: "mm" "mm" "mm"\n'
            f"space origin: ({first[0]!r},{first[1]!r},{first[2]!r})\n"
            f"channels:={' '.join(channels)}\n\n"
        )
        values = np.concatenate(parts, axis=-1).astype("<f4", copy=False)
        self._open("<volume>.nrrd", {"<volume>.nrrd": header.encode() + values.tobytes()})

    @classmethod
    def read(cls, path: Union[str, os.PathLike[str]]) -> Volume:
        """Reads ``.ovox``, ``.vdb``, ``.nrrd``, or a set of ``.vol`` files by the name that
        they have in common."""
        path = Path(path)
        names = [path.name]
        if path.suffix == ".vol":
            stem = path.stem
            for part in _GRID_PARTS:
                stem = stem.removesuffix(f".{part}")
            names += [f"{stem}.{part}.vol" for part in _GRID_PARTS]
        files = {name: path.with_name(name) for name in names}
        if not any(file.exists() for file in files.values()):
            read_bytes(path)  # raises what is wrong with it
        found = {name: read_bytes(file) for name, file in files.items() if file.exists()}
        return cls.from_files(path.name, found)

    @classmethod
    def from_files(cls, name: str, files: Mapping[str, bytes]) -> Volume:
        """A volume from the bytes of its files by their names; ``name`` stands for all."""
        volume = cls.__new__(cls)
        volume._open(name, dict(files))
        return volume

    def _open(self, name: str, files: dict[str, bytes]) -> None:
        self.name = name
        self.files = files
        self._levels: dict[int, dict[str, np.ndarray]] = {}
        self.level(0)

    def level(self, level: int) -> dict[str, np.ndarray]:
        """The arrays of a level of detail by their names; 0 is the finest.

        ``density``, ``axis``, ``spread``, ``materials`` and, of voxelized cloth,
        ``radius_mm`` and ``yarns``; of grids also ``sggx`` and ``albedo``, where the file has
        them.
        """
        if not 0 <= level <= 255:
            message = f"expected a level from 0, found {level}"
            raise InputError(f"level: {message}", key="level", message=message)
        if level not in self._levels:
            about, buffers = _native.read_volume(self.name, self.files, level)
            low, high, self._repeats, self._level_count = about
            self._bounds_mm = np.array([low, high], dtype=np.float32)
            arrays = {name: array(b) for name, b in buffers.items()}
            for one in arrays.values():
                one.flags.writeable = False  # views of what scenes show
            self._levels[level] = arrays
        return self._levels[level]

    @property
    def bounds_mm(self) -> np.ndarray:
        """float32, (2, 3): least and greatest corner of the box."""
        return self._bounds_mm

    @property
    def repeats(self) -> bool:
        """Whether it is a tile that repeats without end in x and y."""
        return self._repeats

    @property
    def level_count(self) -> int:
        """Number of levels of detail."""
        return self._level_count

    @property
    def density(self) -> np.ndarray:
        """float32, 1/mm: extinction broadside to the fibres at the finest level. Shape
        (z, y, x) for grids, (z, y, x, populations) for voxelized cloth, of which each voxel
        holds up to four populations of fibres."""
        return self.level(0)["density"]

    @property
    def axis(self) -> Optional[np.ndarray]:
        """float32: unit mean direction of the fibres, with a last index of 3; None where the
        file has none."""
        return self.level(0).get("axis")

    @property
    def spread(self) -> Optional[np.ndarray]:
        """float32, radians: deviation of the fibres from their axis."""
        return self.level(0).get("spread")

    @property
    def materials(self) -> Optional[np.ndarray]:
        """int32: index of the population's material in the cloth, -1 where there is no fibre;
        None for grids."""
        return self.level(0).get("materials")

    def save(self, path: Union[str, os.PathLike[str]]) -> None:
        """Writes the file; its ending must be that of :attr:`name`."""
        path = Path(path)
        if path.suffix != Path(self.name).suffix or len(self.files) != 1:
            raise InputError(f"{path}: expected a name that ends in {Path(self.name).suffix}")
        path.write_bytes(next(iter(self.files.values())))

    def __repr__(self) -> str:
        z, y, x = self.density.shape[:3]
        return f"<organza.Volume {self.name}: {x} x {y} x {z} cells>"


def _wrong(key: str, expected: str, found: np.ndarray) -> InputError:
    message = f"expected the shape {expected}, found {found.shape}"
    return InputError(f"{key}: {message}", key=key, message=message)
