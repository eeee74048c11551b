"""Formatting of numbers and names for display."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Container, Iterable, Sequence

from flexviz.statistics import NORMAL_95


def number(value: float | None, digits: int = 4) -> str:
    """A value with `digits` significant digits: 1000, 0.01234, 3.200e-7; – if it is not finite."""
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    magnitude = math.floor(math.log10(abs(value)))
    if -4 <= magnitude < 6:
        return f"{value:.{max(digits - 1 - magnitude, 0)}f}".replace("-", "−")
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}e{int(exponent)}".replace("-", "−")


def unit_text(unit: str) -> str:
    """The unit; empty for a dimensionless number."""
    return "" if unit == "-" else unit


def temperature_text(degrees: Iterable[float] | None) -> str:
    """Temperatures [°C] of a group's joints, one number if they agree; empty where it states none.

    >>> temperature_text([25.0, 25.0]), temperature_text([25.0, 30.5])
    ('25 °C', '25, 30.5 °C')
    """
    values = [f"{value:g}" for value in ([] if degrees is None else degrees)]
    shown = values[:1] if len(set(values)) == 1 else values
    return f"{', '.join(shown)} °C" if shown else ""


def with_error(value: float, error: float | None) -> tuple[str, str]:
    """A value and its error as two texts, both rounded to the error's second significant digit.

    >>> with_error(1000.234, 0.82)
    ('1000.23', '0.82')
    >>> with_error(-0.0004, 0.02)
    ('0.000', '0.020')
    """
    if error is None or not math.isfinite(error) or error <= 0 or not math.isfinite(value):
        return number(value), "–"
    place = math.floor(math.log10(error)) - 1
    top = math.floor(math.log10(abs(value))) if value else place
    if place > 4 or place < -7 or top - place > 9:
        return number(value, 5), number(error, 2)
    decimals = max(-place, 0)
    shown = f"{value:.{decimals}f}"
    return shown.replace("-", "−" if float(shown) else ""), f"{error:.{decimals}f}"


def interval(value: float, std: float | None) -> tuple[str, str]:
    """A value and half its 95 % interval, from its standard error."""
    return with_error(value, None if std is None else NORMAL_95 * std)


def escape(text: object) -> str:
    """Untrusted text, safe inside HTML."""
    return html.escape(str(text), quote=True)


def as_markdown(text: str) -> str:
    """Text with its Markdown characters escaped."""
    return re.sub(r"([\\`*_{}\[\]<>#|~])", r"\\\1", text)


def markdown_table(
    head: Sequence[str], rows: Iterable[Sequence[str]], numbers: Container[int] = ()
) -> list[str]:
    """Lines of a Markdown table, whose columns `numbers` are aligned right; cells must be escaped."""
    rule = ["---:" if i in numbers else "---" for i in range(len(head))]
    return [f"| {' | '.join(row)} |" for row in (head, rule, *rows)]


def listed(names: Sequence[str]) -> str:
    """ "a, b and c"."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def plural(count: int, what: str) -> str:
    """1 group, 2 groups."""
    return f"{count} {what}" + ("" if count == 1 else "s")


INERTIAL = ("mass", "mx", "my", "mz", "ixx", "ixy", "iyy", "ixz", "iyz", "izz")
MARKS = {"yes": "●", "weak": "◐", "no": "○"}
SYMBOLS = {
    "stiffness": "K",
    "motor_inertia": "B",
    "link_viscous_friction": "f_lv",
    "motor_viscous_friction": "f_mv",
    "viscous_friction_sum": "f_lv+f_mv",
}


def plain_name(name: str) -> str:
    """Readable name of a parameter or effect: motor_inertia -> motor inertia."""
    effect, dot, parameter = name.partition(".")
    if parameter in effect.split("_"):  # as in coulomb_friction.coulomb
        dot = parameter = ""
    return f"{effect} {dot and '· '}{parameter}".strip().replace("_", " ")


def short_names(names: tuple[str, ...]) -> list[str]:
    """Names without their common prefix: panda_joint1, panda_joint2 -> joint1, joint2; all keep a letter."""
    first = names[0] if len(names) > 1 else ""
    cuts = [0, *(i + 1 for i, character in enumerate(first) if character in "_/:.-")]
    shared = (cut for cut in cuts if all(name[:cut] == first[:cut] for name in names))
    kept = (cut for cut in shared if all(any(map(str.isalpha, name[cut:])) for name in names))
    cut = max(kept, default=0)
    return [name[cut:] for name in names]
