"""Exceptions and warnings of organza."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Optional


class _Failure(Exception):
    """A message and its parts."""

    file: Optional[str]
    """The file at fault, ``<scene>`` for a dictionary; None where there is none."""
    line: Optional[int]
    """The line in the file, from 1; None for dictionaries."""
    column: Optional[int]
    """The column in the line, in characters from 1."""
    key: Optional[str]
    """The key at fault, such as ``camera.width_mm``, or the argument."""
    message: str
    """What is wrong, without file, place and key."""

    def __init__(
        self,
        text: str,
        file: Optional[str] = None,
        line: Optional[int] = None,
        column: Optional[int] = None,
        key: Optional[str] = None,
        message: Optional[str] = None,
    ):
        super().__init__(text)
        self.file, self.line, self.column, self.key = file, line, column, key
        self.message = text if message is None else message

    def __reduce__(self) -> tuple[Any, ...]:
        parts = (str(self), self.file, self.line, self.column, self.key, self.message)
        return type(self), parts


class InputError(_Failure, ValueError):
    """A file, a dictionary or an argument is wrong.

    The text of the exception names file, place, key, what was expected and the nearest valid
    name; the attributes have the parts.
    """


class MissingFileError(InputError, FileNotFoundError):
    """A file is not there."""


class RunError(_Failure, RuntimeError):
    """Something failed while running: a full disk, or a defect of organza."""


class OrganzaWarning(UserWarning):
    """Something about a file is odd but no mistake."""


def read_bytes(path: Path) -> bytes:
    """The bytes of a file; raises :class:`InputError`."""
    try:
        return path.read_bytes()
    except OSError as e:
        message = (e.strerror or str(e)).lower()
        kind = MissingFileError if isinstance(e, FileNotFoundError) else InputError
        raise kind(f"{path}: {message}", file=str(path), message=message) from None
