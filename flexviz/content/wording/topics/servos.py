"""Joints that follow goals."""

from __future__ import annotations

from flexviz.base.facts import Fact
from flexviz.base.spelling import listed, number
from flexviz.content.wording.facts import says

STAGES = {
    "masses": "computing what the masses do along the measured motion",
    "fit": "fitting the free motion from the goals",
    "own": "fitting the set's own model",
    "search": "trying what else the servos may have",
    "stairs": "comparing the models on the way",
}


@says("servo-stage")
def stage(fact: Fact) -> str:
    """What is being done."""
    return STAGES[fact.values["stage"]]


@says("servo-fitted")
def fitted(fact: Fact) -> str:
    """How a fit was made."""
    return "fitted by the free motion from the goals alone"


@says("servo-given")
def given(fact: Fact) -> str:
    """Where values come from that were not fitted."""
    return "values as given; the motion is simulated with them"


@says("no-scale")
def no_scale(fact: Fact) -> str:
    """Joints of which only ratios are determined."""
    return (
        f"scale of {listed(list(fact.joints))} not determined: gain, inertia and friction are known in ratio "
        "to each other only; state their kp, say which servos are alike (kp and same in [drive]; in the app: "
        "Servos in step Identify), or hang a known mass on the joint"
    )


@says("servo-left")
def left(fact: Fact) -> str:
    """Joints whose motion no effect explains to the noise."""
    return (
        f"the motion of {listed(list(fact.joints))} differs from the model's by more than the encoder's noise"
    )


@says("unsigned-current")
def unsigned_current(fact: Fact) -> str:
    """Why a log's current is not its torque."""
    return f"{fact.columns[0]} is a current without a sign, which is no torque"


@says("load-register")
def load_register(fact: Fact) -> str:
    """Why a log's load is not its torque."""
    return f"{fact.columns[0]} is a servo's load in no known unit, which is no torque"


@says("half-recorded")
def half_recorded(fact: Fact) -> str:
    """A joint of which a log has the goal or the position only."""
    lacks = {"theta": "position", "theta_ref": "goal"}[fact.values["lacks"][0]]
    return f"{fact.joints[0]} has {fact.columns[0]} and no {lacks}, expected both; it is locked at 0"


@says("constant-goal")
def constant_goal(fact: Fact) -> str:
    """A joint whose servo holds still."""
    return (
        f"{fact.joints[0]}: {fact.columns[0]} does not change in any log, and nothing is learned of a servo "
        f"that stands still; it is locked at 0, its position column stands at {number(fact.values['at'])}"
    )


@says("other-unit")
def other_unit(fact: Fact) -> str:
    """A joint that is no angle, or in a unit of its own."""
    return (
        f"{fact.joints[0]}: its encoder's count differs from that of the other joints, so it is in another "
        "unit (per cent of its range?); locked at 0 unless unit and offset of theta and theta_ref are stated"
    )


@says("alike-servos")
def alike_servos(fact: Fact) -> str:
    """Joints that may have one type of servo."""
    efforts = listed([f"{effort:g} Nm" for effort in fact.values["efforts"]])
    return (
        f"joints with the same effort limit ({efforts}); if they have one type of servo, it is fitted once:"
    )


@says("goals-drive")
def goals_drive(fact: Fact) -> str:
    """What stands in for a torque."""
    return f"what drives the joints: the goals {fact.columns[0]}, [drive]"


@says("unit-by-limits")
def unit_by_limits(fact: Fact) -> str:
    """How the unit of angles without a torque was found."""
    return "the unit in which the joints stay within their limits and one encoder's count is like another's"


@says("goals-instead")
def goals_instead(fact: Fact) -> str:
    """What else may be done with a current whose constant is not known."""
    return 'or [drive] from = "goal" to use theta_ref instead'


@says("goal-stands")
def goal_stands(fact: Fact) -> str:
    """A goal that never changes."""
    return (
        f"found {number(fact.values['at'], 4)} throughout, expected goals that change: nothing is learned "
        f"of a servo that stands still; leave out [joints.{fact.joints[0]}]"
    )


@says("goal-turned")
def goal_turned(fact: Fact) -> str:
    """A goal of the other sign."""
    return "turns the other way than the position, expected the same"


@says("goal-unit")
def goal_unit(fact: Fact) -> str:
    """A goal in another unit."""
    times, unit = number(fact.values["times"], 3), fact.values["unit"]
    return (
        f"moves {times} times as far as the position, expected the goal in the unit of the position, [{unit}]"
    )


@says("goal-of-another")
def goal_of_another(fact: Fact) -> str:
    """A goal that the joint does not follow."""
    return f"{_away(fact)}, and does not move with it, expected the goal of {fact.joints[0]}"


@says("goal-zero")
def goal_zero(fact: Fact) -> str:
    """A goal that is measured from another zero."""
    return f"{_away(fact)}, expected the same zero for both"


def _away(fact: Fact) -> str:
    away, unit = number(fact.values["away"], 3), fact.values["unit"]
    return f"is {away} {unit} away from the position, in the median"
