"""Read TOML files with one-line errors, and write the small part of TOML that flexviz needs."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Any

from flexviz.errors import InputError
from flexviz.limits import check_size

LARGEST_TOML = 4 * 2**20  # [bytes]
MAX_KEY_PARTS = 32  # the memory that tomllib takes for a dotted key grows with the square of its parts
_PART = r"""(?:(?<![\w-])[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
_LONG_KEY = re.compile(rf"(?:{_PART}){{{MAX_KEY_PARTS}}}")
_BARE = re.compile(r"[A-Za-z0-9_-]+")


def read(file: Path) -> dict[str, Any]:
    """The content of a TOML file."""
    try:
        check_size(file, LARGEST_TOML, "a TOML file")
        text = file.read_bytes().decode("utf-8-sig").replace("\r\n", "\n")
        if found := _LONG_KEY.search(text):
            message = f"a key of more than {MAX_KEY_PARTS} parts, expected a short one"
            raise InputError(message, file=file, place=f"line {text.count(chr(10), 0, found.start()) + 1}")
        return tomllib.loads(text)
    except UnicodeDecodeError as error:
        found = f"byte {error.start} is {error.object[error.start]:#04x}"
        raise InputError(f"not a text in UTF-8 ({found})", file=file) from None
    except InputError:
        raise
    except ValueError as error:  # also whole numbers of over 4300 digits
        raise InputError(f"not valid TOML: {error}", file=file) from None
    except RecursionError:
        raise InputError("not valid TOML: its tables are nested too deeply", file=file) from None
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=file) from None


def dumps(document: Mapping[str, Any]) -> str:
    """A document as TOML: plain values first, then its tables."""
    return "\n".join(_lines(document, ())) + "\n"


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    lines = [f"{key_text(key)} = {value_text(value)}" for key, value in table.items() if not _is_table(value)]
    for key, value in table.items():
        here = (*path, key)
        name = ".".join(key_text(part) for part in here)
        if isinstance(value, Mapping):
            inside = _lines(value, here)
            only_tables = bool(value) and all(_is_table(child) for child in value.values())
            lines += inside if only_tables else ["", f"[{name}]", *inside]
        elif _is_table(value):
            for entry in value:
                lines += ["", f"[[{name}]]", *_lines(entry, here)]
    return lines


def _is_table(value: Any) -> bool:
    """Tables and lists of tables; lists of payload bodies stay inline."""
    first = value[0] if isinstance(value, list) and value else value
    return isinstance(first, Mapping) and not (first is not value and "link" in first)


def key_text(key: str) -> str:
    """A key, quoted where TOML demands it."""
    return key if _BARE.fullmatch(key) else value_text(key)


def value_text(value: Any) -> str:
    """A value on one line; tables inside it stay inline."""
    if isinstance(value, list):
        return "[" + ", ".join(value_text(entry) for entry in value) + "]"
    if isinstance(value, Mapping):
        entries = (f"{key_text(key)} = {value_text(entry)}" for key, entry in value.items())
        return "{ " + ", ".join(entries) + " }"
    if isinstance(value, date):  # or a datetime
        return value.isoformat()
    if not isinstance(value, str | bool | int | float):
        raise TypeError(f"{type(value).__name__} cannot be written as TOML")
    # TOML writes these as JSON does, but for the character DEL
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")
