"""Read TOML files with one-line errors, and write TOML."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flexviz.base.errors import InputError
from flexviz.base.limits import check_size

LARGEST_TOML = 4 * 2**20  # [bytes]
MAX_KEY_PARTS = 32  # the memory that tomllib takes for a dotted key grows with the square of its parts
_PART = r"""(?:(?<![\w-])[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
_LONG_KEY = re.compile(rf"(?:{_PART}){{{MAX_KEY_PARTS}}}")


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


# tomlkit is imported where it is used: most commands only read


def dumps(document: Mapping[str, Any]) -> str:
    """A document as TOML: plain values first, then its tables."""
    import tomlkit

    return tomlkit.dumps(document)


def key_text(key: str) -> str:
    """A key, quoted where TOML demands it."""
    import tomlkit

    return tomlkit.key(key).as_string()


def value_text(value: Any) -> str:
    """A value on one line."""
    import tomlkit

    if not isinstance(value, Mapping):
        return tomlkit.item(value).as_string()
    table = tomlkit.inline_table()
    table.update(value)
    return table.as_string()
