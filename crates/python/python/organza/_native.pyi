"""The native part of organza, see crates/python/src."""

from os import PathLike
from typing import Any, Callable, Mapping, Optional, Sequence, Union

VERSION: str

_Path = Union[str, PathLike[str]]
_Buffer = tuple[str, tuple[int, ...], bytearray]
_About = tuple[tuple[float, float, float], tuple[float, float, float], bool, int]

def call(
    request: tuple[str, str],
    files: Mapping[str, bytes],
    about: tuple[Optional[int], Optional[str], Optional[str], str],
    warn: Callable[[str], object],
    progress: Optional[Callable[[str, float], object]],
) -> dict[str, dict[str, Any]]: ...
def read_draft(
    word: str, bytes: Optional[bytes], rows: Optional[Sequence[str]]
) -> tuple[str, list[str], dict[str, _Buffer]]: ...
def read_toml(path: _Path, text: Optional[bytes]) -> tuple[str, str]: ...
def read_volume(
    name: str, files: Mapping[str, bytes], level: int
) -> tuple[_About, dict[str, _Buffer]]: ...
def run_command(arguments: Sequence[str], code: _Path) -> int: ...
