"""Write the small part of TOML that measurement sets need (the standard library only reads it)."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r"}


def dumps(document: Mapping[str, Any]) -> str:
    """A TOML text with the document's plain values first, then its tables."""
    return "\n".join(_lines(document, ())) + "\n"


def key_text(key: str) -> str:
    """A key, in quotes where it needs them."""
    return _key(key)


def value_text(value: Any) -> str:
    """A value on one line; tables inside it stay inline."""
    return _value(value)


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    lines = [f"{_key(key)} = {_value(value)}" for key, value in table.items() if not _is_table(value)]
    for key, value in table.items():
        here = (*path, key)
        name = ".".join(_key(part) for part in here)
        if isinstance(value, Mapping):
            inside = _lines(value, here)
            only_tables = bool(value) and all(_is_table(child) for child in value.values())
            lines += inside if only_tables else ["", f"[{name}]", *inside]
        elif _is_table(value):
            for entry in value:
                lines += ["", f"[[{name}]]", *_lines(entry, here)]
    return lines


def _is_table(value: Any) -> bool:
    """Tables, and lists of tables that stand at the top of the file; other lists of tables stay inline."""
    if isinstance(value, Mapping):
        return True
    return (
        isinstance(value, list) and bool(value) and isinstance(value[0], Mapping) and "link" not in value[0]
    )


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _value(key)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + "".join(_character(character) for character in value) + '"'
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{value} cannot be written to a measurement set")
        return repr(value)
    if isinstance(value, list):
        return "[" + ", ".join(_value(entry) for entry in value) + "]"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_value(entry)}" for key, entry in value.items()) + " }"
    raise TypeError(f"{type(value).__name__} cannot be written to a measurement set")


def _character(character: str) -> str:
    if character in _ESCAPES:
        return _ESCAPES[character]
    code = ord(character)
    return f"\\u{code:04x}" if code < 0x20 or code == 0x7F else character
