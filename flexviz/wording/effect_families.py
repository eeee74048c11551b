"""Families of effects that the data do not separate, as text."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeVar

from flexviz.wording.numbers import plain_name

FAMILY_TITLES = {
    "dry_friction": "dry friction",
    "constant_torque": "a constant torque",
    "torque_scale": "torque scale or load-dependent friction",
}
UNTOLD = "which kind, these data do not tell"


class FamilyLike(Protocol):
    """Effects whose signatures are alike."""

    @property
    def name(self) -> str: ...
    @property
    def tied(self) -> bool: ...
    @property
    def members(self) -> Sequence[str]: ...
    @property
    def confidence(self) -> float: ...


F = TypeVar("F", bound=FamilyLike, covariant=True)


class InFamily(Protocol[F]):
    """An effect that may belong to a family."""

    @property
    def family(self) -> F | None: ...


def family_title(name: str) -> str:
    """ "dry friction"; the readable name of a family that has no title."""
    return FAMILY_TITLES.get(name, plain_name(name))


def tied_family(finding: InFamily[F]) -> F | None:
    """The family that a finding stands for; None if the data tell which of its members acts."""
    return finding.family if finding.family is not None and finding.family.tied else None


def capitalised(text: str) -> str:
    """The text with a capital first letter."""
    return text[:1].upper() + text[1:]
