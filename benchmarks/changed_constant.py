"""Diagnoses sets with one constant changed; the text of this file runs by `python -c` in any version.

    python -c TEXT list                         the constants of flexviz.analysis.diagnosis, one a line
    python -c TEXT PLACE FACTOR SET ...         one line of JSON for each set

PLACE is a path of fields below the dataclass THRESHOLDS of flexviz.analysis.diagnosis.thresholds, as in
"search.rounds", or a module and a name in it, as in "flexviz.analysis.diagnosis.curves:RESONANCES". A default
of an argument keeps the value that it had when its function was made.
"""

from __future__ import annotations

import dataclasses
import importlib
import json
import pkgutil
import sys
from collections.abc import Iterator
from typing import Any

import flexviz.analysis.diagnosis


def is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and value not in (0, float("inf"))


def fields(thresholds: Any, path: str = "") -> Iterator[tuple[str, Any, str]]:
    """(path, owner, field) of every number in nested dataclasses."""
    for field in dataclasses.fields(thresholds):
        value, place = getattr(thresholds, field.name), f"{path}{field.name}"
        if dataclasses.is_dataclass(value):
            yield from fields(value, f"{place}.")
        elif is_number(value):
            yield place, thresholds, field.name


def modules() -> Iterator[Any]:
    """Every module of the diagnosis."""
    package = flexviz.analysis.diagnosis
    for entry in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        yield importlib.import_module(entry.name)


def places() -> dict[str, tuple[list[Any], str]]:
    """Place → who has the number, and its name there."""
    loaded = [flexviz.analysis.diagnosis, *modules()]
    others = [m for name, m in sys.modules.items() if name.startswith("flexviz.") and m not in loaded]
    thresholds = importlib.import_module("flexviz.analysis.diagnosis.thresholds").THRESHOLDS
    out = {path: ([owner], name) for path, owner, name in fields(thresholds)}
    for module in loaded:
        for name, value in vars(module).items():
            if not (name.isupper() and is_number(value)) or any(vars(m).get(name) is value for m in others):
                continue  # what another package has, too, is its own
            # where it was imported from is not known: the last of those that share it stands for all
            owners = [m for m in loaded if vars(m).get(name) is value]
            if owners[-1] is module:
                out[f"{module.__name__}:{name}"] = (owners, name)
    return out


def changed(value: Any, factor: float) -> Any:
    """The value times the factor, a whole number if it is one."""
    return max(round(value * factor), 1) if isinstance(value, int) else value * factor


def main(arguments: list[str]) -> None:
    found = places()
    if arguments == ["list"]:
        for place, (owners, name) in found.items():
            print(f"{place} {getattr(owners[0], name)!r}")
        return
    place, factor, *sets = arguments
    if place:
        owners, name = found[place]
        value = changed(getattr(owners[0], name), float(factor))
        for owner in owners:
            if dataclasses.is_dataclass(owner):
                object.__setattr__(owner, name, value)  # they are frozen
            else:
                setattr(owner, name, value)
    read_set = importlib.import_module("flexviz.data.measurements").read_set
    for folder in sets:
        try:
            got = flexviz.analysis.diagnosis.diagnose(read_set(folder), apply=True).to_dict()
            effects = sorted(f"{e['effect']}:{e.get('joint')}" for e in got["model"]["effects"])
            said = {"verdict": got["verdict"], "last": got["steps"][-1]["verdict"], "effects": effects}
        except Exception as error:
            said = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps({"set": folder} | said), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
