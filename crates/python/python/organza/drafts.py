"""Weave drafts."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Optional, Sequence, Union

import numpy as np

from . import _native
from ._run import array
from .errors import read_bytes


class Draft:
    """A weave draft: which warp threads (ends) lie over which weft threads (picks).

    Made by :meth:`named`, :meth:`from_wif` or from a drawdown::

        Draft.named("twill-3-1-s")
        Draft.from_wif("scenes/drafts/first_light.wif")
        Draft(["X..", ".X.", "..X"])           # as seen on the face, the last pick first
        Draft(np.eye(4, dtype=bool))           # warp_up[pick, end], the first pick first

    A fabric takes it as its draft: ``fabric["draft"] = draft``.
    """

    title: str
    """Name or title, for people."""
    warnings: list[str]
    """What is odd about the file it was read from."""
    warp_up: np.ndarray
    """bool, (picks, ends): True where the warp is on the face; first pick and end first."""
    warp_colour: np.ndarray
    """float32, (ends, 3): linear Rec.709 colours; NaN where the draft gives none."""
    weft_colour: np.ndarray
    """float32, (picks, 3): likewise."""
    warp_spacing_mm: np.ndarray
    """float32, (ends,): room that each end takes up; NaN where the draft gives none."""
    weft_spacing_mm: np.ndarray
    """float32, (picks,): likewise."""

    def __init__(self, drawdown: Union[Sequence[str], np.ndarray, Sequence[Sequence[bool]]]):
        if len(drawdown) and isinstance(drawdown[0], str):
            rows = [str(row) for row in drawdown]
        else:
            up = np.asarray(drawdown, dtype=bool)
            if up.ndim != 2:
                raise ValueError(f"expected warp_up[pick, end], found {up.ndim} indices")
            rows = ["".join("X" if cell else "." for cell in row) for row in up[::-1]]
        self._read("drawdown", None, rows)
        self._wif: Optional[bytes] = None
        self._table: dict[str, Any] = {"drawdown": rows}

    @classmethod
    def named(cls, name: str) -> Draft:
        """A weave by its name, such as ``plain``, ``twill-3-1-s`` or ``satin-8-3``.

        Raises :class:`organza.InputError` with the nearest valid name.
        """
        draft = cls.__new__(cls)
        draft._read(name, None, None)
        draft._wif, draft._table = None, {"weave": name}
        return draft

    @classmethod
    def from_wif(cls, source: Union[str, os.PathLike[str], bytes]) -> Draft:
        """A draft from a WIF file, or from the bytes of one."""
        draft = cls.__new__(cls)
        if isinstance(source, bytes):
            name, data = "<draft>.wif", source
        else:
            name, data = os.fspath(source), read_bytes(Path(source))
        draft._read(name, data, None)
        draft._wif, draft._table = data, {}
        return draft

    def _read(self, word: str, data: Optional[bytes], rows: Optional[list[str]]) -> None:
        self.title, self.warnings, buffers = _native.read_draft(word, data, rows)
        arrays = {name: array(b) for name, b in buffers.items()}
        self.warp_up = arrays["warp_up"].astype(bool)
        self.warp_colour = arrays["warp_colour"]
        self.weft_colour = arrays["weft_colour"]
        self.warp_spacing_mm = arrays["warp_spacing_mm"]
        self.weft_spacing_mm = arrays["weft_spacing_mm"]

    @property
    def ends(self) -> int:
        """Number of warp threads."""
        return int(self.warp_up.shape[1])

    @property
    def picks(self) -> int:
        """Number of weft threads."""
        return int(self.warp_up.shape[0])

    def picture(self) -> np.ndarray:
        """The drawdown as colours, float32 (picks, ends, 3), linear, the last pick first, as
        seen on the face. Threads without a colour are dark (warp) and light (weft)."""
        warp = np.where(np.isnan(self.warp_colour), np.float32(0.05), self.warp_colour)
        weft = np.where(np.isnan(self.weft_colour), np.float32(0.8), self.weft_colour)
        face = np.where(self.warp_up[:, :, None], warp[None], weft[:, None])
        return face[::-1]

    def __repr__(self) -> str:
        title = f" {self.title!r}" if self.title else ""
        return f"<organza.Draft{title}: {self.ends} ends, {self.picks} picks>"
