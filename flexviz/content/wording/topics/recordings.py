"""What recorded signals cannot show, whatever is fitted to them."""

from __future__ import annotations

from math import inf

from flexviz.base.facts import Fact
from flexviz.base.spelling import number
from flexviz.content.wording.errors import noise_text
from flexviz.content.wording.facts import says
from flexviz.content.wording.issue_kinds import SATURATED, no_noise_text, no_torque_text, stands_text
from flexviz.content.wording.sample_kinds import what_is_said


@says("no-torque")
def no_torque(fact: Fact) -> str:
    """Joints whose torque is no signal, and the key that leaves it out."""
    columns = zip(fact.joints, fact.values["levels"], fact.values["explained"], strict=True)
    return no_torque_text({joint: {"values": levels, "share": share} for joint, levels, share in columns})


@says("torque-saturated")
def torque_saturated(fact: Fact) -> str:
    """Joints whose torque stands at a limit."""
    names = ("lower", "upper", "tolerance", "rows")
    units = fact.values.get("units") or ("Nm",) * len(fact.joints)
    columns = zip(fact.joints, *(fact.values[name] for name in names), units, strict=True)
    each = (
        f"tau of {joint} {stands_text(-inf if low is None else low, inf if high is None else high, *rest)}"
        for joint, low, high, *rest in columns
    )
    return f"{'; '.join(each)}: {SATURATED}"


@says("reference")
def reference(fact: Fact) -> str:
    """Angles that no sensor has measured."""
    unit = " or ".join(dict.fromkeys(fact.values["units"]))
    return f"theta of {', '.join(fact.joints)} {no_noise_text(max(fact.values['noise']), unit)}"


@says("behind-gear")
def behind_gear(fact: Fact) -> str:
    """A torque without motor inertia."""
    if fact.values["stated"]:
        return (
            "the torque is that of joint torque sensors, as stated: the model has no motor inertia and no "
            "motor friction"
        )
    return (
        "the torque shows no motor inertia: it is taken for that of joint torque sensors, behind the gears; "
        'torque = "joint" in the mapping confirms this, torque = "motor" denies it'
    )


@says("filtered")
def filtered(fact: Fact) -> str:
    """A log that was low-passed before it was written."""
    return (
        f"this log was filtered before it was written (nothing above about {number(fact.values['hertz'], 2)} "
        "Hz): the model error, not the sensor noise, is the yardstick"
    )


@says("spoilt-samples")
def spoilt_samples(fact: Fact) -> str:
    """Why a set is refused: samples of which nothing can be concluded."""
    said = what_is_said(fact.values["issue"])
    also = f"; also in {', '.join(fact.columns)}" if fact.columns else ""
    return f"{said.found}{also}: {said.cause}? expected {said.expected}"


@says("noise")
def noise(fact: Fact) -> str:
    """Joints whose torque is noise in part."""
    return noise_text(dict(zip(fact.joints, fact.values["shares"], strict=True)))
