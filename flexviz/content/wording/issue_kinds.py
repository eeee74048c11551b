"""What is said of issues that have words of their own: one function per kind."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from flexviz.base.spelling import listed, number
from flexviz.base.units import joint_unit
from flexviz.content.wording.issues import IssueLike, gained, general, keys_text, percent, says

SATURATED = "saturated; these rows are left out of fits"


def unit_in(issue: IssueLike, unit: str) -> str:
    """The unit of a quantity of an issue's joints, from that of joints that turn."""
    return " or ".join(dict.fromkeys(joint_unit(unit, joint in issue.slides) for joint in issue.joints))


@says("mounting")
def _mounting(issue: IssueLike) -> str:
    return f"{general(issue)}: is the robot mounted on a wall, on its side or under a ceiling?"


@says("order")
def _order(issue: IssueLike) -> str:
    return f"{general(issue)}: is the order of the joints right?"


@says("payload")
def _payload(issue: IssueLike) -> str:
    asked = ": was a payload carried that is not stated?" if "mass" in issue.values else ""
    return general(issue) + asked


@says("magnitude")
def _magnitude(issue: IssueLike) -> str:
    lost = "it is never negative, as if it had lost its sign: "
    return f"{lost}{general(issue)}. Log the torque or current with its sign"


@says("rated")
def _rated(issue: IssueLike) -> str:
    values, unit = issue.values, unit_in(issue, "Nm")
    rated = listed([f"{number(torque, 2)} {unit}" for torque in values["rated"].values()])
    return (
        f"masses and payloads ask for another size on each joint: is it in {values['share']} of the drives' "
        f"rated torques (about {rated})? Then unit = rated torque / {values['parts']:g}, of the data sheets"
    )


@says("gravity")
def _gravity(issue: IssueLike) -> str:
    if "motion" not in issue.values["lacks"]:
        return (
            "it has the torque of the motion, but not that of gravity (factor 0): without it the robot's "
            f"masses explain {gained(issue)}. Was it logged before the controller adds its gravity "
            "compensation? Log the whole torque, or add that part"
        )
    return (
        f"it has the torque of gravity and nothing else: gravity alone explains {gained(issue)}. Is it a "
        "computed torque, or was the arm moved by hand? Log the motors' torque while they drive the motion"
    )


@says("unit")
def _unit(issue: IssueLike) -> str:
    values = issue.values
    if "times_q" in values:
        each = values["times_q"]
        gears = listed([f"{ratio:.4g}" for ratio in each.values()])
        times = listed([f"{ratio:.5g}" for ratio in each.values()])
        return (
            f"it turns {times} times as far as q: is that the motor's angle before a gear (gear = {gears}, "
            'side = "motor")?'
        )
    if "per_cent" in values:
        return f"it seems to be in per cent of the joints' ranges, −100 to 100: {general(issue)}"
    if "unit_sizes" in values:
        return _unknown_unit(issue)
    if "slopes" in values:
        return _size(issue)
    if "times_theta" in values:
        return _against_theta(issue)
    if "span" in values:
        return _beyond(issue)
    if issue.signal == "theta and tau":
        text = general(issue)
        stated = 'their gears are stated, but not used: both signals have side = "joint". '
        return stated + text[0].upper() + text[1:]
    return general(issue)


def _unknown_unit(issue: IssueLike) -> str:
    """θ in no unit that is known: what one of it seems to be."""
    units, ratios = (
        listed([f"{x:.2g}" for x in issue.values[name].values()]) for name in ("unit_sizes", "gears")
    )
    unit = unit_in(issue, "rad")
    return (
        f"no known unit explains it. With about {units} {unit} per unit the robot's masses explain "
        f"{gained(issue)}: the motor's angle before a gear of about {ratios} (gear, side), or "
        f"per cent of the joint's range (unit = the size of one in {unit})?"
    )


def _size(issue: IssueLike) -> str:
    """How large τ is against the robot's masses, and what would explain it."""
    slopes = issue.values["slopes"]
    if issue.fixes:
        joint = issue.joints[0]
        slope, factor = slopes[joint], issue.values["factors"][joint]
        return (
            f"it is {slope:.3g} times the torque of the rigid model: with {keys_text(issue.fixes)} it is "
            f"{slope / factor:.2g} times"
        )
    ratios = ", ".join(dict.fromkeys(f"{slope:.3g}" for slope in slopes.values()))
    return f"it is {ratios} times the torque of the rigid model: {_scale_hint(issue)}?"


def _scale_hint(issue: IssueLike) -> str:
    """Possible reasons for τ of another size, where no unit or gear of the mapping explains it."""
    slopes, gears = issue.values["slopes"], issue.values["stated_gears"]
    if min(slopes.values()) > 1:
        return "a smaller unit, a gear counted twice, or per cent or per mille of the rated torque (unit)"
    if 1.0 not in gears.values():
        about = ", ".join(f"{1 / slope / gears[joint]:.2g}" for joint, slope in slopes.items())
        return (
            f'a current (unit = "A", side = "motor", torque_constant about {about} {unit_in(issue, "Nm")}/A)'
        )
    about = ", ".join(f"{1 / slope:.2g}" for slope in slopes.values())
    return f'a current (unit = "A", torque_constant), or before a gear (of about {about}; gear, side)'


def _beyond(issue: IssueLike) -> str:
    unit, values = issue.values["unit"], issue.values
    small = 'millimetres (unit = "mm")' if unit == "m" else 'degrees (unit = "deg")'
    return (
        f"it spans {values['span']:.3g} {unit} at up to {values['speed']:.3g} {unit}/s, the joint's limits "
        f"are {values['width']:.3g} {unit} and {values['fastest']:.3g} {unit}/s: {small}, or the motor's "
        "angle before the gear (gear and side)?"
    )


@says("sign")
def _sign(issue: IssueLike) -> str:
    return _against_theta(issue) if "times_theta" in issue.values else general(issue)


def _against_theta(issue: IssueLike) -> str:
    slope = issue.values["times_theta"]
    message = f"it is {slope:.4g} times {issue.values['measured']}"
    if issue.fixes:
        return f"{message}: with {keys_text(issue.fixes)} they agree"
    gear = max(abs(slope), 1 / abs(slope))
    hint = f"a gear of {gear:.5g} on one of the two" if gear > 2.72 else "another joint or unit"
    return f"{message}: {hint}?"


@says("zero")
def _zero(issue: IssueLike) -> str:
    if "difference" not in issue.values:
        return general(issue)
    difference = f"{issue.values['difference']:.3g} {unit_in(issue, 'rad')}"
    return f"its mean is {difference} from that of theta, too far for a spring: another zero position?"


@says("reference")
def _reference(issue: IssueLike) -> str:
    return f"it {no_noise_text(max(issue.values['noise'].values()), unit_in(issue, 'rad'))}"


def no_noise_text(largest: float, unit: str) -> str:
    """What is said of an angle without noise, without its name."""
    return (
        f"has next to no noise ({number(largest, 2)} {unit}, less than any encoder's counts leave), but the "
        "torque has: is it the commanded angle, or a computed one? Log the measured angle of the motor"
    )


@says("swapped")
def _swapped(issue: IssueLike) -> str:
    return (
        "theta − q falls where tau rises, a spring does the opposite: are theta and q swapped, or is the "
        "sign of tau wrong?"
    )


@says("unexplained")
def _unexplained(issue: IssueLike) -> str:
    if "share" in issue.values:
        return f"it follows theta by {100 * issue.values['share']:.0f} % only: the same joint?"
    shares = issue.values["shares"]
    texts = list(map(percent, shares.values()))
    if len(set(texts)) > 1:
        texts = [f"{text} ({joint})" for joint, text in zip(shares, texts, strict=True)]
    return (
        f"the robot's masses explain {listed(list(dict.fromkeys(texts)))} of it: are robot, payload, "
        "order of the joints, units, signs and zero positions right, and does the base stand upright?"
    )


@says("clock")
def _clock(issue: IssueLike) -> str:
    values = issue.values
    return (
        f'in {values["group"]} the clock of "{values["clock"]}" is {values["text"]}; '
        f'[time] shift."{values["clock"]}" = {values["shift"]:.6g} would correct it'
    )


@says("delay")
def _delay(issue: IssueLike) -> str:
    values = issue.values
    if "text" not in values:
        return f"{general(issue)}: is this drive polled after the others?"
    return (
        f"torque and acceleration disagree in time: {values['text']} ({values['samples']:.2g} samples); "
        'time.shift corrects it where tau has a clock of its own, the effect "torque_delay" fits it'
    )


@says("no_torque")
def _no_torque(issue: IssueLike) -> str:
    return f"{no_torque_text(issue.values['what'])}: the motion of such a joint counts all the same"


def no_torque_text(found: Mapping[str, Mapping[str, Any]]) -> str:
    """What is said of joints whose torque is no signal, and the key that leaves it out; "" without any."""
    if not found:
        return ""
    each = "; ".join(f"{joint}: {_what_instead(what)}" for joint, what in found.items())
    names = ", ".join(f'"{joint}"' for joint in found)
    what = "the torque of a joint is" if len(found) == 1 else "the torques of some joints are"
    return f"{what} no signal ({each}): state no_torque = [{names}] in [model] to leave it out"


@says("saturated")
def _saturated(issue: IssueLike) -> str:
    return f"it {stands_text(**issue.values, unit=unit_in(issue, 'Nm'))}: {SATURATED}"


def stands_text(lower: float, upper: float, tolerance: float, rows: int, unit: str = "Nm") -> str:
    """Where a torque stands, without its name."""
    high, low = math.isfinite(upper), math.isfinite(lower)
    if high and low and abs(lower + upper) <= 2 * tolerance + 1e-3 * upper:
        at = f"largest / smallest value (±{number(upper, 4)} {unit})"
    elif high and low:
        at = f"largest / smallest value ({number(upper, 4)} and {number(lower, 4)} {unit})"
    else:
        side, value = ("largest", upper) if high else ("smallest", lower)
        at = f"{side} value ({number(value, 4)} {unit})"
    return f"stands at its {at} in {rows} rows"


def _what_instead(what: Mapping[str, Any]) -> str:
    values = what.get("values", ())
    if len(values) == 1:
        return f"it is {values[0]:g} all the time"
    if values:
        return f"it has {len(values)} values only, {', '.join(f'{v:g}' for v in values)}"
    return f"masses and friction explain {100 * what['share']:.0f} % of it, no more than chance"


@says("filtered")
def _filtered(issue: IssueLike) -> str:
    return (
        f"in all rows nothing is left above about {number(issue.values['hertz'], 2)} Hz, not even noise: was "
        "the log filtered before it was written, or computed? Expected: the signals as the drive measures "
        "them; these are of use only if theta and tau went through the same filter"
    )
