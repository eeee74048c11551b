"""The way to sets whose joints follow goals: another package identifies and diagnoses them."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any


def by_free_motion(name: str) -> Callable[..., Any]:
    """A function of `flexviz.analysis.servo`, which stands above: it makes results of both kinds."""
    found: Callable[..., Any] = getattr(import_module("flexviz.analysis.servo"), name)
    return found
