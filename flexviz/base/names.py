"""Lists of names as callers give them."""

from __future__ import annotations

from collections.abc import Iterable


def names_of(given: str | Iterable[str]) -> tuple[str, ...]:
    """The names of a list; one name alone is a list of one."""
    return (given,) if isinstance(given, str) else tuple(given)
