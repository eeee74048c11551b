"""Families of effects that the data do not separate, as text."""

from __future__ import annotations

from flexviz.wording.numbers import plain_name
from flexviz.wording.records import FamilyLike, NamedLike

FAMILY_TITLES = {
    "dry_friction": "dry friction",
    "constant_torque": "a constant torque",
    "torque_scale": "torque scale or load-dependent friction",
}
UNTOLD = "which kind, these data do not tell"


def family_title(name: str) -> str:
    """ "dry friction"; the readable name of a family that has no title."""
    return FAMILY_TITLES.get(name, plain_name(name))


def tied_family(finding: NamedLike) -> FamilyLike | None:
    """The family that a finding stands for; None if the data tell which of its members acts."""
    return finding.family if finding.family is not None and finding.family.tied else None


def capitalised(text: str) -> str:
    """The text with a capital first letter."""
    return text[:1].upper() + text[1:]
