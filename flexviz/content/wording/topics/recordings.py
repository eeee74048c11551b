"""What recorded signals cannot show, whatever is fitted to them."""

from __future__ import annotations

from flexviz.base.facts import Fact
from flexviz.content.wording.errors import noise_text
from flexviz.content.wording.facts import says
from flexviz.content.wording.numbers import number


@says("no-torque")
def no_torque(fact: Fact) -> str:
    """Joints whose torque is no signal, and the key that leaves it out."""
    each = "; ".join(f"{joint}: {why}" for joint, why in zip(fact.joints, fact.values["why"], strict=True))
    names = ", ".join(f'"{joint}"' for joint in fact.joints)
    what = "the torque of a joint is" if len(fact.joints) == 1 else "the torques of some joints are"
    return f"{what} no signal ({each}): state no_torque = [{names}] in [model] to leave it out"


@says("torque-saturated")
def torque_saturated(fact: Fact) -> str:
    """Joints whose torque stands at a limit."""
    names = ("lower", "upper", "tolerance", "rows")
    columns = zip(fact.joints, *(fact.values[name] for name in names), strict=True)
    each = "; ".join(f"tau of {joint} {limit_text(*numbers)}" for joint, *numbers in columns)
    return f"{each}: saturated; these rows are left out of fits"


def limit_text(lower: float | None, upper: float | None, tolerance: float, rows: int) -> str:
    """ "stands at its largest value (3.000 Nm) in 40 rows"; a side without a limit is None."""
    if lower is None or upper is None:
        side = "smallest" if upper is None else "largest"
        at = f"{side} value ({number(lower if upper is None else upper, 4)} Nm)"
    elif abs(lower + upper) <= 2 * tolerance + 1e-3 * upper:
        at = f"largest / smallest value (±{number((upper - lower) / 2, 4)} Nm)"
    else:
        at = f"largest / smallest value ({number(upper, 4)} and {number(lower, 4)} Nm)"
    return f"stands at its {at} in {rows} rows"


@says("filtered")
def filtered(fact: Fact) -> str:
    """A log that was low-passed before it was written."""
    return (
        f"this log was filtered before it was written (nothing above about {number(fact.values['hertz'], 2)} "
        "Hz): the model error, not the sensor noise, is the yardstick"
    )


@says("noise")
def noise(fact: Fact) -> str:
    """Joints whose torque is noise in part."""
    return noise_text(dict(zip(fact.joints, fact.values["shares"], strict=True)))
