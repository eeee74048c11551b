"""Simulated robots: where their values come from, and how a recorded motion was simulated."""

from __future__ import annotations

from flexviz.base.facts import Fact
from flexviz.content.wording.facts import says

ORIGINS = {
    "urdf": "proportional to the URDF's inertia; not the values of a real robot",
    "paper": "the paper's true values are lost; these were chosen near its start values",
    "demonstration": "chosen for demonstration; masses, centres and inertias are 15 % away from the URDF's",
    "set": "the set's [initial] values and URDF, or in proportion to its inertia where it gives none",
}
LOOPS = {
    "goals": "driven by the goals alone",
    "closed": "closed loop: the set's controller drives the model along the recorded reference",
    "open": "open loop: the recorded torque drives the model, a weak PD (2 Hz) keeps it near the motion",
}
LIMITED = {"stiffness": "stiffness lowered", "motor_inertia": "motor inertia raised"}


@says("true-values")
def true_values(fact: Fact) -> str:
    """The origin of the values of a simulated robot."""
    return ORIGINS[fact.values["from"]]


@says("replayed")
def replayed(fact: Fact) -> str:
    """What drives the model."""
    return LOOPS[fact.values["loop"]]


@says("not-simulated")
def not_simulated(fact: Fact) -> str:
    """An effect that the simulator does not know."""
    return f"{fact.values['effect']} left out: its class has no simulation"


@says("limited")
def limited(fact: Fact) -> str:
    """Values beyond what can be simulated."""
    return f"{LIMITED[fact.values['what']]} to what can be simulated: {', '.join(fact.joints)}"
