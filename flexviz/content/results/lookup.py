"""Parameters by name: `result["stiffness", "joint1"]`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from flexviz.base.errors import FlexvizError, choose_from
from flexviz.content.records import ParameterEstimate


class ParameterNotFound(FlexvizError, KeyError):
    """A result has no parameter of that name and place."""

    exit_code = 2


P = TypeVar("P", bound=ParameterEstimate)


def find_parameter(parameters: Sequence[P], key: str | tuple[str, str | None]) -> P:
    """The parameter of a name and a place, which is its joint, payload or group.

    A name alone is enough if it is unique; "stiffness:joint1" works as well.

    Raises:
        ParameterNotFound: listing similar names.
    """
    if isinstance(key, str):
        name, _, rest = key.partition(":")
        place: str | None = rest or None
    else:
        name, place = key
    named = [p for p in parameters if p.name == name]
    if not named:
        names = dict.fromkeys(p.name for p in parameters)
        raise ParameterNotFound(f'no parameter "{name}"; {choose_from(name, names, len(names))}')
    found = [p for p in named if place in (p.joint, p.payload, p.group)] if place else named
    if place is None and len(named) > 1:
        found = [p for p in named if p.joint is None] if not isinstance(key, str) else []
    if len(found) == 1:
        return found[0]
    places = [other for p in named if (other := p.joint or p.payload or p.group)]
    asked = f'"{place}"' if place else "without a place"
    raise ParameterNotFound(f'parameter "{name}" {asked}: {choose_from(place or "", places)}')
