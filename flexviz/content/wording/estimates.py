"""Values with their intervals, where the data determine them."""

from __future__ import annotations

from flexviz.base.spelling import number
from flexviz.content.records import (
    NOT_DETERMINED,
    Combination,
    EffectParameter,
    ParameterEstimate,
    is_determined,
)
from flexviz.content.wording.numbers import MARKS, interval, measured, quantity

Estimate = ParameterEstimate | Combination | EffectParameter


def determined(p: Estimate) -> bool:
    """Whether a value is stated; see `is_determined`."""
    return is_determined(p.identifiable, p.value, p.std)


def told(p: ParameterEstimate | Combination) -> bool:
    """Whether the value is printed: it is determined, or that of a bound, without an interval."""
    return determined(p) or (isinstance(p, ParameterEstimate) and p.at_bound)


def estimate_cells(p: ParameterEstimate | Combination, factor: float = 1.0) -> tuple[str, str]:
    """The value and half its 95 % interval, times `factor`, for the cells of a table.

    A value at a bound has no interval. One that is not determined is not told, but what it is above.
    """
    if told(p):
        return interval(factor * p.value, factor * p.std)
    above = p.rigid_above if isinstance(p, ParameterEstimate) else None
    return NOT_DETERMINED, "–" if above is None else f"(above {number(factor * above, 3)})"


def interval_words(p: ParameterEstimate | Combination, factor: float = 1.0) -> str:
    """ "1013 ± 12" in the unit itself, times `factor`; "not determined (above 950)"."""
    value, half = estimate_cells(p, factor)
    return value if half == "–" else f"{value} {half}" if value == NOT_DETERMINED else f"{value} ± {half}"


def estimate_words(p: ParameterEstimate) -> str:
    """ "1.013 ± 0.012 kNm/rad", "not determined (above 950 Nm/rad)"."""
    if told(p):
        return measured(p.value, p.std, p.unit)
    above = p.rigid_above
    return NOT_DETERMINED if above is None else f"{NOT_DETERMINED} (above {quantity(above, p.unit)})"


def estimate_mark(p: ParameterEstimate | Combination, factor: float = 1.0) -> str:
    """ "1.73 ± 0.20 ◐", times `factor`; only ○ where the value is not determined."""
    return f"{interval_words(p, factor)} {MARKS[p.identifiable]}" if determined(p) else MARKS["no"]
