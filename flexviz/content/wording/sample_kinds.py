"""What is said of samples that no motion explains: what is found, its cause, and what is expected."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from flexviz.base.spelling import listed, number, plural
from flexviz.content.wording.issues import IssueLike, says

Values = Mapping[str, Any]


class Said(NamedTuple):
    """The parts of a message."""

    found: str
    cause: str
    expected: str


FEWEST_BITS = 8  # of a register, whose overflow is called by its power of two
SAMPLES: dict[str, Callable[[Values], Said]] = {}


def of_samples(*kinds: str) -> Callable[[Callable[[Values], Said]], Callable[[Values], Said]]:
    """Register what is said of these kinds, by the numbers of a finding."""

    def register(function: Callable[[Values], Said]) -> Callable[[Values], Said]:
        for kind in kinds:
            SAMPLES[kind] = function
            says(kind)(sample_message)
        return function

    return register


def sample_message(issue: IssueLike) -> str:
    """Where it is, what it is, and the keys that mend it."""
    values, said = issue.values, what_is_said(issue)
    also = f"; also in {listed(list(values['also_in']))}" if values["also_in"] else ""
    who = f"{values['joint']}, " if len(issue.joints) > 1 else ""
    message = (
        f"in {values['group']}, {who}{_where(values)}: {said.found}{also}: {said.cause}? "
        f"Expected: {said.expected}"
    )
    keys = "; ".join(dict.fromkeys(map(str, issue.remedies)))
    return message + (f". Proposed: {keys}" if keys else "")


def what_is_said(issue: IssueLike) -> Said:
    """Its parts."""
    return SAMPLES[issue.kind]({**issue.values, "signal": issue.signal})


def _where(values: Values) -> str:
    """Rows of the log and seconds after its first sample."""
    parts = []
    for first, last, begin, end in values["stretches"]:
        parts.append(
            f"row {first} ({number(begin, 4)} s)"
            if first == last
            else f"rows {first} to {last} ({number(begin, 4)} to {number(end, 4)} s)"
        )
    more = f", … ({plural(values['count'], 'sample')} in all)" if values["more"] else ""
    return ", ".join(parts) + more


def _here(values: Values, unit: str = "") -> str:
    return f"(here from {number(values['before'])} to {number(values['after'])}{unit})"


def _jumps_at(values: Values) -> str:
    unit = values["unit"]
    return (
        f"the position jumps at {values['jumps']} of {values['instants']} instants, by up to "
        f"{number(values['speed'], 3)} {unit}/s {_here(values, f' {unit}')}"
    )


@of_samples("messages")
def _messages(values: Values) -> Said:
    return Said(
        f"{_jumps_at(values)}; {values['incomplete']} of {values['instants']} rows lack another signal, and "
        "without these rows nothing jumps",
        "two publishers on one topic, or two kinds of message",
        "only the rows that have every signal",
    )


@of_samples("outliers")
def _outliers(values: Values) -> Said:
    often = values["often"]
    return Said(
        _jumps_at(values),
        "two publishers on one topic" if often else "late or wrong samples (transmission errors)",
        "the continuous motion of one joint; the samples that jump away and back may be left out",
    )


@of_samples("jumps")
def _jumps(values: Values) -> Said:
    cause = "two publishers on one topic, a new zero of the encoder, late or dropped values"
    return Said(_jumps_at(values), cause, "the continuous motion of one joint")


@of_samples("wrapped")
def _wrapped(values: Values) -> Said:
    if "bit" in values:
        bit = values["bit"]
        return Said(
            f"the value jumps by 2^{bit} {values['count']} times and is continuous otherwise if the numbers "
            f"above are negative {_here(values)}",
            f"a register in sign-magnitude form, of which bit {bit} is the sign",
            "numbers with their sign",
        )
    unsigned = "an unsigned or overflowing counter" + (" (16 bit)" if values["period"] == 2.0**16 else "")
    return Said(
        f"the value jumps by about {_period(values['period'])} {values['count']} times and is continuous "
        f"otherwise {_here(values)}",
        unsigned if values["signal"] == "tau" else "a wrapped angle or overflowing counter",
        "the continuous motion or signed torque",
    )


def _period(period: float) -> str:
    """2π, 360, a power of two, or the number."""
    if math.isclose(period, 2 * math.pi, rel_tol=1e-3):
        return "2π"
    if math.isclose(period, 360.0, rel_tol=1e-3):
        return "360"
    bits = round(math.log2(period))
    if bits >= FEWEST_BITS and math.isclose(period, 2.0**bits, rel_tol=1e-3):
        return f"2^{bits}"
    return number(period, 6)


@of_samples("dropped")
def _dropped(values: Values) -> Said:
    return Said(
        f"{values['count']} times the value is {number(values['value'])} between others far from it (here "
        f"after {number(values['before'])})",
        "dropped values",
        "a measured number in every row; a row without one may be left out and is interpolated",
    )


@of_samples("constant")
def _constant(values: Values) -> Said:
    return Said(
        f"the value is {number(values['value'])} in all {values['count']} rows",
        "a joint that rests or has no motor, or a channel that was not recorded",
        "a recorded signal; leave such a joint out of [joints]: it then stays locked",
    )


@of_samples("repeated")
def _repeated(values: Values) -> Said:
    return Said(
        f"each value stands in {number(values['lasts'], 3)} rows on average, {number(values['rate'], 3)} Hz",
        "a log faster than its drive",
        "new values only; those between are interpolated",
    )


@of_samples("stale")
def _stale(values: Values) -> Said:
    return Said(
        f"the value stands still for up to {number(values['longest'], 3)} s while the joint moves",
        "stale values: lost messages, or a drive that is off",
        "measured values only",
    )


@of_samples("held")
def _held(values: Values) -> Said:
    unit = values["unit"]
    return Said(
        f"the joint stands still with {number(values['torque'], 3)} {unit}, {number(values['off'], 3)} "
        f"{unit} from what would hold it; static friction is about {number(values['static'], 2)} {unit}",
        "brakes, an emergency stop, a drive that is off, or a support",
        "motion under the drives alone",
    )


@of_samples("contact")
def _contact(values: Values) -> Said:
    unit = values["unit"]
    return Said(
        f"for {number(values['seconds'], 2)} s the torque is up to {number(values['largest'], 3)} {unit} "
        f"away from that of the same motion at other times (usually {number(values['usual'], 2)} {unit})",
        "a hand, a cable or another contact",
        "motion without contact",
    )
