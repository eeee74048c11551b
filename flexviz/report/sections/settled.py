"""Values as results: not printed where the 95 % interval is wider than the value."""

from __future__ import annotations

from flexviz import wording
from flexviz.diagnosis import Finding
from flexviz.effects import free_curve
from flexviz.records import Combination, ParameterEstimate
from flexviz.statistics import NORMAL_95

UNSETTLED = "not determined"


def settled(value: float, std: float | None) -> bool:
    """Whether half of the 95 % interval is smaller than the value; also without an interval."""
    return std is None or NORMAL_95 * std <= abs(value)


def estimate_text(p: ParameterEstimate | Combination, factor: float = 1.0) -> str:
    """ "1.73 ± 0.20 ◐", times `factor`; only ○ where the value is not settled."""
    if not settled(p.value, p.std) or p.identifiable == "no":
        return wording.MARKS["no"]
    value, half = wording.interval(factor * p.value, factor * p.std)
    return f"{value} ± {half} {wording.MARKS[p.identifiable]}"


def finding_values(finding: Finding) -> str:
    """ "coulomb 3.000 ± 0.012 Nm", with 95 % intervals."""
    if free_curve(finding.effect) is not None:
        return wording.values_text(finding)
    return ", ".join(
        f"{wording.plain_name(name)} "
        + (wording.value_text(finding.effect, name, one) if settled(one.value, one.std) else UNSETTLED)
        for name, one in finding.parameters.items()
    )
