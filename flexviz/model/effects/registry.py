"""The registry of effects: name → effect, the library's first."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from importlib import import_module
from types import ModuleType
from typing import Any

from flexviz.model.effects.decoys import DECOYS
from flexviz.model.effects.effect import Effect
from flexviz.model.effects.free_curve import free_curve
from flexviz.model.effects.names import EFFECT_NAMES, GOAL_EFFECT_NAMES


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
    """The effects defined in `flexviz/model/effects/<name>.py`, one per file."""
    found: dict[str, Effect] = {}
    for name in names:
        (only,) = effect_classes(import_module(f"flexviz.model.effects.{name}"))
        found[name] = only()
        assert found[name].name == name, f"flexviz/model/effects/{name}.py defines {found[name].name}"
    return found


class Registry(dict[str, Effect]):
    """Physical effects by name.

    Found, but not listed, are free curves and decoys, which are not physics, and what only servos have that
    follow goals.
    """

    def __missing__(self, name: str) -> Effect:
        found = _unlisted(name)
        if found is None:
            raise KeyError(name)
        return found

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or name in GOAL_EFFECTS or free_curve(str(name)) is not None

    def get(self, name: str, default: object = None) -> Any:
        return super().get(name) or _unlisted(name) or default


def _unlisted(name: str) -> Effect | None:
    return free_curve(name) or DECOYS.get(name) or GOAL_EFFECTS.get(name)


GOAL_EFFECTS = library(GOAL_EFFECT_NAMES)
EFFECTS: dict[str, Effect] = Registry(library(EFFECT_NAMES))
