"""Robot descriptions: what looks odd, and what was decided about their joints."""

from __future__ import annotations

from collections.abc import Sequence

from flexviz.base.facts import Fact
from flexviz.content.wording.facts import says

LISTED = 4  # names in a sentence; of more the number
MIMICS = {
    "locked": "mimic joints are locked where their leader's zero puts them, and coupled in exports: ",
    "lost": "mimic joints without an existing leader are locked: ",
    "own": "mimic joints are identified as joints of their own: ",
}


def first_names(names: Sequence[str]) -> str:
    """The first names, and how many more there are."""
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return ", ".join(names[:LISTED]) + more


@says("mimic-joints")
def mimic_joints(fact: Fact) -> str:
    """Joints that follow others."""
    pairs = zip(fact.joints, fact.values["follows"], strict=True)
    return MIMICS[fact.values["how"]] + first_names([f"{joint} ({follows})" for joint, follows in pairs])


@says("joints-without-load")
def without_load(fact: Fact) -> str:
    """Joints that move nothing."""
    return f"locked, because nothing with mass moves with it: joint {first_names(fact.joints)}"


@says("joint-held")
def held(fact: Fact) -> str:
    """A free joint."""
    return f"{fact.values['type']} joint {fact.joints[0]} is held fixed"


@says("dynamics-unused")
def dynamics_unused(fact: Fact) -> str:
    """Friction of joints that do not move."""
    return f"<dynamics> of locked joints is not used: {first_names(fact.joints)}"


@says("world-added")
def world_added(fact: Fact) -> str:
    """A base link that is not declared."""
    return 'link "world" is only named as a parent: taken for a fixed base'


@says("inertia-excess")
def inertia_excess(fact: Fact) -> str:
    """An inertia that no body has, by little."""
    values = fact.values
    moments = ", ".join(f"{moment:.4g}" for moment in values["moments"])
    by = f"exceeds the sum of the others by {100 * values['excess']:.2g} %"
    return (
        f'link "{values["link"]}": the largest of the principal moments {moments} kg m² {by}; look at '
        f"{values['suspect']}"
    )


@says("inertia-wide")
def inertia_wide(fact: Fact) -> str:
    """An inertia of a larger body than the robot has."""
    values = fact.values
    text = (
        f'link "{values["link"]}": {values["moment"]:.4g} kg m² and {values["mass"]:g} kg give a radius of '
        f"gyration of {values['radius']:.3g} m, far above the robot's longest link, {values['longest']:.3g} m"
    )
    return text + (f"; as implausible: {more} more links" if (more := values["more"]) else "")
