"""The registry of effects: name → effect, the library's first."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from importlib import import_module
from types import ModuleType

from flexviz.effects.effect import Effect
from flexviz.effects.names import EFFECT_NAMES


def effect_classes(module: ModuleType) -> list[type[Effect]]:
    """The effect classes that a module defines, without base classes of others in it."""
    classes = [
        c
        for c in vars(module).values()
        if inspect.isclass(c) and issubclass(c, Effect) and c.__module__ == module.__name__
    ]
    parents = {parent for c in classes for parent in c.__mro__[1:]}
    return [c for c in classes if c not in parents]


def library(names: Sequence[str]) -> dict[str, Effect]:
    """The effects defined in `flexviz/effects/<name>.py`, one per file."""
    found: dict[str, Effect] = {}
    for name in names:
        (only,) = effect_classes(import_module(f"flexviz.effects.{name}"))
        found[name] = only()
        assert found[name].name == name, f"flexviz/effects/{name}.py defines {found[name].name}"
    return found


EFFECTS: dict[str, Effect] = library(EFFECT_NAMES)
