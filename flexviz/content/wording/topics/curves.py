"""Free curves: what they are, and the simple laws that they resemble."""

from __future__ import annotations

from flexviz.base.facts import Fact
from flexviz.base.units import joint_unit
from flexviz.content.wording.facts import says

SLIDING = [joint_unit(unit, True) for unit in ("rad", "rad/s", "rad/s²", "Nm")]  # units of what slides


@says("curve-not-physics")
def not_physics(fact: Fact) -> str:
    """What every free curve is."""
    return "fitted to the residual, not physics: it shows where, not why"


@says("curve-form")
def curve_form(fact: Fact) -> str:
    """ "a bump of 14.9 Nm at −0.02 rad, 0.18 rad wide, against the motion (97 % of the curve)"."""
    values, unit, kind = fact.values, fact.values["unit"], fact.values["kind"]
    numbers = ("size", "slope", "centre", "width", "order")
    v = {name: f"{values[name]:.3g}".replace("-", "−") for name in numbers if name in values}
    step, both = (values["direction"] == way for way in ("against", "both"))
    slides = unit in SLIDING
    torque, angle = joint_unit("Nm", slides), joint_unit("rad", slides)
    if kind == "constant":
        text = f"a step of {v['size']} {torque} where the motion reverses"
        text = text if step else f"a constant torque of {v['size']} {torque}"
    elif kind == "line":
        text = f"a straight line of {v['slope']} {torque} per {unit}, {v['size']} {torque} at zero"
        if values["variable"] == "position" and both:
            text = f"a linear spring of {v['slope']} {torque}/{angle}, {v['size']} {torque} at zero"
    elif kind == "bump":
        text = f"a bump of {v['size']} {torque} at {v['centre']} {unit}, {v['width']} {unit} wide"
    elif kind == "exponential":
        rate = values["rate"]
        way = f"{'grows' if rate > 0 else 'falls'} by a factor of e every {1 / abs(rate):.3g} {unit}"
        text = f"an exponential of {v['size']} {torque} at zero that {way}"
    else:
        text = f"a sine of {v['size']} {torque} with {v['order']} rad per {unit}"
    way = "" if both else ", against the motion" if step else f", in {values['direction']} motion only"
    way = "" if kind == "constant" and step else way
    return f"{text}{way} ({min(100 * values['explained'], 99):.0f} % of the curve)"
