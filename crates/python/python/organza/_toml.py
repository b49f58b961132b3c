"""TOML text of dictionaries, in which every number is read back as it was."""

from __future__ import annotations

import json
import math
import os
import re
from typing import Any, Iterator, Mapping

from .errors import InputError

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def value(item: Any, key: str) -> str:
    """A value as TOML on one line; ``key`` stands in messages."""
    if hasattr(item, "tolist"):  # numpy
        item = item.tolist()
    if isinstance(item, bool):
        return "true" if item else "false"
    if isinstance(item, int):
        if not -(2**63) <= item < 2**63:
            raise _wrong(key, f"expected a whole number of 64 bits, found {item}")
        return str(int(item))
    if isinstance(item, float):
        if math.isnan(item):
            return "nan"
        if math.isinf(item):
            return "inf" if item > 0 else "-inf"
        return repr(float(item))
    if isinstance(item, (str, os.PathLike)):
        try:
            os.fspath(item).encode()
        except UnicodeEncodeError:
            raise _wrong(key, f"expected a text in Unicode, found {item!r}") from None
        return json.dumps(os.fspath(item), ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(item, Mapping):
        inside = (f"{_name(k)} = {value(v, f'{key}.{k}')}" for k, v in _items(item, key))
        return "{" + ", ".join(inside) + "}"
    if isinstance(item, (list, tuple)):
        return "[" + ", ".join(value(v, f"{key}[{i}]") for i, v in enumerate(item)) + "]"
    raise _wrong(
        key,
        "expected a text, a number, a boolean, a list or a dictionary, "
        f"found {type(item).__name__}",
    )


def text(table: Mapping[str, Any]) -> str:
    """A whole file."""
    return "\n".join(_lines(table, "")) + "\n"


def _lines(table: Mapping[str, Any], path: str) -> Iterator[str]:
    under = f"{path}." if path else ""
    tables, lists = [], []
    for key, item in _items(table, path):
        place = under + _name(key)
        if isinstance(item, Mapping):
            tables.append((place, item))
        elif isinstance(item, (list, tuple)) and item and all(
            isinstance(one, Mapping) for one in item
        ):
            lists.append((place, item))
        else:
            yield f"{_name(key)} = {value(item, place)}"
    for place, item in tables:
        yield f"[{place}]"
        yield from _lines(item, place)
    for place, items in lists:
        for item in items:
            yield f"[[{place}]]"
            yield from _lines(item, place)


def _items(table: Mapping[str, Any], path: str) -> Iterator[tuple[str, Any]]:
    """Keys and values; None is a key that is not there."""
    for key, item in table.items():
        if not isinstance(key, str):
            raise _wrong(path, f"expected texts as keys, found {key!r}")
        if item is not None:
            yield key, item


def _name(key: str) -> str:
    return key if _BARE.fullmatch(key) else value(key, key)


def _wrong(key: str, message: str) -> InputError:
    return InputError(f"{key}: {message}" if key else message, key=key or None, message=message)
