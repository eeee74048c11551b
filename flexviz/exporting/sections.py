"""Parts of a text between `[name` and `name]`, each alone in a comment: kept or left out, marks and all."""

from __future__ import annotations

import re
from collections.abc import Collection

MARK = re.compile(r"\s*(?:#|/\*)\s*(?:\[(?P<open>\w+)|(?P<close>\w+)\])\s*(?:\*/)?\s*")


def with_sections(text: str, kept: Collection[str]) -> str:
    """The text with only those of its parts whose names are in `kept`."""
    out: list[str] = []
    inside: list[str] = []
    for line in text.splitlines():
        mark = MARK.fullmatch(line)
        if mark is None:
            if all(name in kept for name in inside):
                out.append(line)
        elif mark["open"]:
            inside.append(mark["open"])
        elif not inside or inside.pop() != mark["close"]:
            raise AssertionError(f"section {mark['close']} is not open")
    assert not inside, f"section {inside} is not closed"
    return "\n".join(out) + "\n"


def section_names(text: str) -> set[str]:
    """The names of all parts of a text."""
    marks = (MARK.fullmatch(line) for line in text.splitlines())
    return {mark["open"] for mark in marks if mark and mark["open"]}
