"""Limits on a result: what is met, for which range that holds, and what it does not prove."""

from __future__ import annotations

from flexviz.base.facts import Fact
from flexviz.base.spelling import listed, number, plural
from flexviz.base.units import joint_unit
from flexviz.content.records import FOLLOWING, PERCENT
from flexviz.content.wording.facts import says
from flexviz.content.wording.numbers import plain_name, quantity

QUANTITIES = {
    "verdict": "verdict",
    "held-out-error": "held-out error",
    "interval": "95 % interval of {parameter}",
}
NO_FIGURE = {
    "not-diagnosed": "not diagnosed",
    "nothing-held-out": "no group is held out",
    "unknown": "not known",
    "not-in-model": "not in the model",
    "not-determined": "not determined",
    "at-bound": "at its bound",
}
NOT_PROVED = {
    "range": "Poses, speeds, torques and payloads beyond the range stated above; between its ends, what no "
    "held-out motion passed.",
    "robots": "Other robots of this type, and this one after wear, repair, or a change of temperature or "
    "oil.",
    "link-side": "The link side: motor-side data show the torque that a motion needs, not where the flange "
    "is.",
    "cause": "That the named effects are the cause: an effect that acts alike in these motions has the same "
    "error.",
    "sensors": "Systematic errors of the sensors: a wrong torque constant scales torque and parameters "
    "alike.",
}


@says("acceptance")
def acceptance(fact: Fact) -> str:
    """How many requirements are met."""
    met, of = fact.values["met"], fact.values["of"]
    word = "Accepted" if met == of else "Not accepted"
    return f"{word}: {met} of {of} requirements are met."


@says("acceptance-quantity")
def acceptance_quantity(fact: Fact) -> str:
    """What is required to keep a limit."""
    return QUANTITIES[fact.values["what"]].format(parameter=plain_name(fact.values["parameter"]))


@says("acceptance-figure")
def figure(fact: Fact) -> str:
    """What a result has."""
    values = fact.values
    if isinstance(values["figure"], str):
        return values["figure"]
    also = f" ({values['also']})" if values["also"] else ""
    return f"{number(values['figure'], 3)} {values['unit']}{also}"


@says("acceptance-limit")
def limit(fact: Fact) -> str:
    """What it has to keep."""
    values = fact.values
    return (
        values["limit"]
        if isinstance(values["limit"], str)
        else f"at most {values['limit']:g} {values['unit']}"
    )


@says("error-also")
def error_also(fact: Fact) -> str:
    """An error in its other unit."""
    error, unit = fact.values["error"], fact.values["unit"]
    return f"{number(error, 3)} {unit}" if unit in (PERCENT, FOLLOWING) else quantity(error, unit)


@says("no-figure")
def no_figure(fact: Fact) -> str:
    """Why a result has no such figure."""
    return NO_FIGURE[fact.values["why"]]


@says("not-proved")
def not_proved(fact: Fact) -> str:
    """What an acceptance does not prove."""
    return NOT_PROVED[fact.values["what"]]


@says("joint-range")
def joint_range(fact: Fact) -> str:
    """ "joint1: -1.20 … 1.30 rad, up to 2.10 rad/s and 40.0 Nm"."""
    values = fact.values
    unit = joint_unit("rad", values.get("slides", False))
    way = f"{number(values['low'], 3)} … {number(values['high'], 3)} {unit}"
    fastest, most = number(values["speed"], 3), quantity(values["torque"], values["of"])
    ahead = ", its goal ahead by up to" if values["of"] == unit else " and"
    return f"{fact.joints[0]}: {way}, up to {fastest} {unit}/s{ahead} {most}"


@says("acceptance-scope")
def scope(fact: Fact) -> str:
    """The range in which a prediction was tested."""
    values = fact.values
    how = "held out, " if values["held_out"] else "fitted, not held out, "
    loads = listed([f"{name} ({quantity(mass, 'kg')})" for name, mass in values["payloads"]])
    gravity = ", ".join(f"{value:g}" for value in values["gravity"])
    degrees = " … ".join(f"{value:g}" for value in dict.fromkeys(values["temperatures"]))
    warm = f", at {degrees} °C" if degrees else ", at temperatures that are not stated"
    return (
        "Holds for predictions within the recorded range of position, speed, torque and payload: "
        f"{plural(len(fact.groups), 'group')} ({how}{values['seconds']:.0f} s), "
        f"payload {loads}, gravity [{gravity}] m/s²{warm}."
    )
