"""Licences of the packages that an installation of flexviz brings along, from their own metadata.

    python -m benchmarks.licences [--write]

`--write` renews docs/licences.md.
"""

from __future__ import annotations

import sys
import tomllib
from email.message import Message
from importlib import metadata
from itertools import chain
from pathlib import Path
from typing import cast

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from benchmarks.command import command

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "licences.md"
LONGEST = 60  # characters: longer ones are a licence's whole text
HEAD = """# Licences

flexviz is under the Apache License 2.0. An installation with all
extras brings these packages along, under the licence that each states of itself.
`python -m benchmarks.licences --write` renews the list.

"""


def packages() -> list[str]:
    """The names of all packages that flexviz and its extras need on this machine, directly or not."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    waiting = [*project["dependencies"], *chain(*project["optional-dependencies"].values())]
    found: set[str] = set()
    while waiting:
        one = Requirement(waiting.pop())
        if (name := canonicalize_name(one.name)) in {*found, "flexviz"}:
            continue
        found.add(name)
        for text in metadata.requires(name) or ():
            marker, extras = Requirement(text).marker, (*one.extras, "")
            if marker is None or any(marker.evaluate({"extra": extra}) for extra in extras):
                waiting.append(text)
    return sorted(found)


def licence(name: str) -> str:
    """The licence that a package's metadata state: an SPDX expression, classifiers, or a short text."""
    about = cast(Message, metadata.metadata(name))
    if expression := about.get("License-Expression"):
        return expression
    classified = [c.rpartition(" :: ")[2] for c in about.get_all("Classifier", []) if c.startswith("License")]
    stated = (about.get("License") or "").strip()
    short = stated if 0 < len(stated) <= LONGEST and "\n" not in stated else ""
    return ", ".join(classified) or short or "see its files"


def page() -> str:
    """docs/licences.md."""
    found: dict[str, list[str]] = {}
    for name in packages():
        found.setdefault(licence(name), []).append(name)
    return HEAD + "".join(f"- **{text}**: {', '.join(found[text])}\n" for text in sorted(found))


@command
def main(*, write: bool = False) -> None:
    if write:
        PAGE.write_text(page(), encoding="utf-8")
    print(page())


if __name__ == "__main__":
    sys.exit(main())
