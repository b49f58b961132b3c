"""Runs commands: arguments become flags, dictionaries files in memory."""

from __future__ import annotations

import json
import os
import re
import warnings
from typing import Any, Callable, Mapping, Optional

import numpy as np

from . import _native, _toml
from .errors import InputError, OrganzaWarning

_FLAG = re.compile(r"--([a-z][a-z-]*)")

Progress = Callable[[str, float], object]
"""Called with the name of the task and the share of it that is done, from 0 to 1."""


def array(buffer: tuple[str, tuple[int, ...], bytearray]) -> np.ndarray:
    """The numpy array over a buffer of the native module; nothing is copied."""
    kind, shape, data = buffer
    return np.frombuffer(data, dtype=kind).reshape(shape)


def flags(options: Mapping[str, Any]) -> list[str]:
    """Keyword arguments as flags of the command line. None and False give none."""
    words = []
    for name, option in options.items():
        flag = "--" + name.replace("_", "-")
        if option is None or option is False:
            continue
        if option is True:
            words.append(flag)
        elif name == "set":
            words += [f"--set={key}={_toml.value(item, key)}" for key, item in option.items()]
        elif isinstance(option, range):
            if option.step != 1:
                raise InputError(f"{name}: expected a range of step 1", key=name)
            words.append(f"{flag}={option.start}..{option.stop}")
        elif isinstance(option, (list, tuple, np.ndarray)):
            words.append(f"{flag}=" + ",".join(_word(item) for item in option))
        else:
            words.append(f"{flag}={_word(option)}")
    return words


def _word(option: Any) -> str:
    if isinstance(option, (float, np.floating)):
        return repr(float(option))
    return os.fspath(option) if isinstance(option, os.PathLike) else str(option)


def run(
    command: str,
    positional: list[str],
    options: Mapping[str, Any],
    files: Mapping[str, bytes],
    progress: Optional[Progress],
) -> dict[str, Any]:
    """The arrays and figures of a command, by name, and its files under ``files``."""

    def warn(message: str) -> None:
        warnings.warn(message, OrganzaWarning, stacklevel=4)

    words = [command, *flags(options), "--", *positional]
    try:
        found = _native.call(words, dict(files), warn, progress)
    except InputError as e:
        flag = _FLAG.search(str(e)) if e.file is None and e.key is None else None
        if flag:
            e.key = flag[1].replace("-", "_")
        raise
    results: dict[str, Any] = {name: array(b) for name, b in found["arrays"].items()}
    results.update({name: json.loads(text) for name, text in found["figures"].items()})
    results["files"] = found["files"]
    return results
