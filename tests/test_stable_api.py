"""The public names: all are stated as stable or not, and the stable ones still have what they had.

`python -m tests.test_stable_api` writes tests/fixtures/stable_api.json anew: after an addition, or for a new
minor version.
"""

from __future__ import annotations

import inspect
import json
import re
from pathlib import Path
from typing import Any, get_args, get_type_hints

import pytest
from pydantic import BaseModel

import flexviz

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "api.md"
KNOWN = Path(__file__).parent / "fixtures" / "stable_api.json"


def stated() -> tuple[list[str], list[str]]:
    """The stable names of the page, and those that may change."""
    section = PAGE.read_text(encoding="utf-8").partition("## What is stable\n")[2].partition("\n## ")[0]
    stable, _, changing = section.partition("These may change:")
    lists = (re.findall(r"`(\w+)`(?= `|\n|$)", text) for text in (stable, changing))
    return tuple([name for name in names if name in flexviz.__all__] for names in lists)  # type: ignore[return-value]


def surface(thing: Any) -> dict[str, list[str]]:
    """What callers rely on: arguments by name, those by position in order; attributes of a class."""
    if not callable(thing):
        return {}
    if not inspect.isclass(thing):
        parameters = inspect.signature(thing).parameters.values()
        by_position = [p.name for p in parameters if p.kind is p.POSITIONAL_OR_KEYWORD]
        needed = [p.name for p in parameters if p.default is p.empty and p.kind is not p.VAR_KEYWORD]
        names = {p.name for p in parameters if p.kind is not p.VAR_KEYWORD}
        for p in parameters:
            if p.kind is p.VAR_KEYWORD:  # the keys of a TypedDict
                names |= get_type_hints(get_args(get_type_hints(thing)[p.name])[0]).keys()
        return {"arguments": sorted(names), "by_position": by_position, "needed": needed}
    fields = {name for base in thing.__mro__ for name in inspect.get_annotations(base)}
    names = ({*dir(thing)} | fields) - {*dir(BaseModel), *dir(Exception)}
    return {"attributes": sorted(name for name in names if not name.startswith("_"))}


def test_every_public_name_is_stated_once() -> None:
    stable, changing = stated()
    assert sorted([*stable, *changing]) == sorted(flexviz.__all__)


@pytest.mark.parametrize("name", stated()[0])
def test_a_stable_name_keeps_what_it_had(name: str) -> None:
    known = json.loads(KNOWN.read_text(encoding="utf-8"))
    assert sorted(known) == sorted(stated()[0]), "python -m tests.test_stable_api"
    before, now = known[name], surface(getattr(flexviz, name))
    for kind in ("arguments", "attributes"):
        assert not {*before.get(kind, ())} - {*now.get(kind, ())}
    assert now.get("by_position", [])[: len(before.get("by_position", []))] == before.get("by_position", [])
    assert {*now.get("needed", ())} <= {*before.get("needed", ())}, "an argument without a default is new"


if __name__ == "__main__":
    found = {name: surface(getattr(flexviz, name)) for name in sorted(stated()[0])}
    KNOWN.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
