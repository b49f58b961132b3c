"""Runs requests: keywords become their fields, dictionaries files in memory."""

from __future__ import annotations

import json
import os
import warnings
from typing import Any, Callable, Mapping, Optional, Union

import numpy as np

from . import _native, _toml
from .errors import InputError, OrganzaWarning

Progress = Callable[[str, float], object]
"""Called with the name of the task and the share of it that is done, from 0 to 1."""


def array(buffer: tuple[str, tuple[int, ...], bytearray]) -> np.ndarray:
    """The numpy array over a buffer of the native module; nothing is copied."""
    kind, shape, data = buffer
    return np.frombuffer(data, dtype=kind).reshape(shape)


def run(
    name: str,
    request: Mapping[str, Any],
    files: Mapping[str, bytes],
    progress: Optional[Progress],
    *,
    threads: Optional[int],
    max_memory: Union[str, int, None],
    cache: Union[str, "os.PathLike[str]", None],
) -> dict[str, Any]:
    """The arrays and figures of a request, by name, and its files under ``files``. Fields that are
    None are left out."""

    def warn(message: str) -> None:
        warnings.warn(message, OrganzaWarning, stacklevel=4)

    if threads is not None and not 0 < threads < 65536:
        message = f"expected a whole number from 1 to 65535, found {threads}"
        raise InputError(f"threads: {message}", key="threads", message=message)
    memory = None if max_memory is None else str(max_memory)
    text = _toml.text({key: _plain(item, key) for key, item in request.items()})
    words = ", ".join(f"{key}={item!r}" for key, item in request.items() if item is not None)
    place = None if cache is None else os.fspath(cache)
    about = (threads, memory, place, f"organza.{name}({words})")
    found = _native.call((name, text), dict(files), about, warn, progress)
    results: dict[str, Any] = {name: array(b) for name, b in found["arrays"].items()}
    results.update({name: json.loads(text) for name, text in found["figures"].items()})
    results["files"] = found["files"]
    return results


def _plain(item: Any, key: str) -> Any:
    """A value of a request as TOML has it."""
    if isinstance(item, range):
        if item.step != 1:
            raise InputError(f"{key}: expected a range of step 1", key=key)
        return [item.start, item.stop]
    if key == "seed" and isinstance(item, int) and item >= 2**63:
        return str(item)  # beyond the numbers of TOML
    return item
