"""Numbers, quantities and names for display: the one place where digits and prefixes are chosen."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Container, Iterable, Sequence
from typing import Any

from flexviz.base.spelling import number
from flexviz.base.statistics import NORMAL_95


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


MOST_DIGITS = 5  # of a value that is told with its error
PREFIXES = {-3: "n", -2: "µ", -1: "m", 0: "", 1: "k", 2: "M", 3: "G"}  # by the power of 1000
PREFIXED = re.compile(r"(Nm|rad|N|m|s|Hz|V|A|W|J)(?![²³\w])")  # units that take a prefix


def si_scale(size: float, unit: str) -> tuple[float, str]:
    """Factor and prefixed unit with which a quantity of this size is written; (1, unit) where none fits.

    Sizes from 0.1 to 1000 keep the unit; beyond, the number before the unit lies there.

    >>> si_scale(92.2e-6, "rad"), si_scale(0.135, "Nm"), si_scale(8471.0, "Nm/rad"), si_scale(2e-3, "kg m²")
    ((1000000.0, 'µrad'), (1.0, 'Nm'), (0.001, 'kNm/rad'), (1.0, 'kg m²'))
    """
    if not (math.isfinite(size) and size != 0 and PREFIXED.match(unit)):
        return 1.0, unit
    exponent = math.floor(math.log10(abs(size)))
    power = min(max((exponent + (exponent < 0)) // 3, min(PREFIXES)), max(PREFIXES))
    return (1000.0**-power if power < 0 else 1.0 / 1000.0**power), PREFIXES[power] + unit


def quantity(value: float | None, unit: str, digits: int = 3) -> str:
    """A value with `digits` significant digits and its unit with an SI prefix.

    >>> quantity(0.00231, "Nm"), quantity(0.4, "kg m²"), quantity(2.0, "-")
    ('2.31 mNm', '0.400 kg m²', '2.00')
    """
    if value is None or not math.isfinite(value):
        return "–"
    factor, prefixed = si_scale(value, unit)
    return f"{number(factor * value, digits)} {unit_text(prefixed)}".rstrip()


def measured(value: float, std: float | None, unit: str) -> str:
    """A value with half its 95 % interval and its unit, from its standard error.

    >>> measured(92.2e-6, 1.28e-6, "rad"), measured(3.0, 0.00005, "Nm"), measured(3.0, None, "Nm")
    ('92.2 ± 2.5 µrad', '3.0000 ± 0.0001 Nm', '3.00 Nm')
    """
    shown, half, prefixed = measured_parts(value, std, unit)
    error = f" ± {half}" if half != "–" else ""
    return f"{shown}{error} {unit_text(prefixed)}".rstrip()


def measured_parts(value: float, std: float | None, unit: str) -> tuple[str, str, str]:
    """The value, half its 95 % interval, and the prefixed unit of both, for the cells of a table."""
    known = std is not None and math.isfinite(std) and std > 0 and math.isfinite(value)
    if std is None or not known:
        factor, prefixed = si_scale(value, unit)
        return number(factor * value, 3), "–", prefixed
    half = NORMAL_95 * std
    factor, prefixed = si_scale(max(abs(value), half), unit)
    return *with_error(factor * value, factor * half), prefixed


def with_error(value: float, error: float | None) -> tuple[str, str]:
    """A value and its error as two texts, both rounded to the error's second significant digit.

    A value of more than `MOST_DIGITS` digits is rounded to that many, if its error is not 0 then.

    >>> with_error(100.234, 0.82)
    ('100.23', '0.82')
    >>> with_error(1000.234, 0.82)
    ('1000.2', '0.8')
    >>> with_error(3.0, 0.0000123)
    ('3.00000', '0.00001')
    >>> with_error(-0.0004, 0.02)
    ('0.000', '0.020')
    """
    if error is None or not math.isfinite(error) or error <= 0 or not math.isfinite(value):
        return number(value), "–"
    place = math.floor(math.log10(error)) - 1
    top = math.floor(math.log10(abs(value))) if value else place
    if place > 4 or place < -7 or top - place > 9:
        return number(value, 5), number(error, 2)
    if top - place >= MOST_DIGITS:
        last = top - MOST_DIGITS + 1
        place = last if error >= 0.5 * 10.0**last else place + 1
    decimals = max(-place, 0)
    shown = f"{value:.{decimals}f}"
    return shown.replace("-", "−" if float(shown) else ""), f"{error:.{decimals}f}"


def interval(value: float, std: float | None) -> tuple[str, str]:
    """A value and half its 95 % interval, from its standard error, in the unit itself."""
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


def sliding_note(joints: Sequence[str], slides: Iterable[Any]) -> str:
    """A sentence for files whose comments state units of joints that turn; empty if no joint slides."""
    names = ", ".join(joint for joint, one in zip(joints, slides, strict=True) if one)
    return f"Sliding joints ({names}): N and m where Nm and rad are written." if names else ""


MARKS = {"yes": "●", "weak": "◐", "no": "○"}
SYMBOLS = {
    "stiffness": "K",
    "motor_inertia": "B",
    "link_viscous_friction": "f_lv",
    "motor_viscous_friction": "f_mv",
    "viscous_friction_sum": "f_lv+f_mv",
    "position_control.gain": "kp",
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
