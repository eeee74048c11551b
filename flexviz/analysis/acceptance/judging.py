"""Whether a result keeps its limits, line by line."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from flexviz.analysis.acceptance.limits import AcceptanceLimits
from flexviz.base.errors import InputError
from flexviz.base.statistics import NORMAL_95
from flexviz.content.records import PERCENT, TORQUE, JointErrors, ParameterEstimate
from flexviz.content.results import ResultDocument
from flexviz.content.wording import error_in_other, number, plain_name

NO_HELD_OUT = "no group is held out"


@dataclass(frozen=True)
class AcceptanceLine:
    """One requirement.

    Attributes:
        what: the quantity in words.
        joint: None for the whole robot.
        parameter: whose interval it is; None: an error or the verdict.
        figure: what the result has, in `unit`; None where it has none.
        limit: what it has to keep.
        unit: of both; empty for a verdict.
        passed: whether figure ≤ limit, or the verdict is one of the accepted ones.
        remark: why there is no figure; empty otherwise.
        also: an error in the other unit, per cent or Nm.
    """

    what: str
    joint: str | None
    parameter: str | None
    figure: float | str | None
    limit: float | str
    unit: str
    passed: bool
    remark: str = ""
    also: str = ""

    @property
    def figure_text(self) -> str:
        """ "3.21 %", "nothing-missing", or why there is no figure."""
        if self.figure is None:
            return self.remark
        if isinstance(self.figure, str):
            return self.figure
        also = f" ({self.also})" if self.also else ""
        return f"{number(self.figure, 3)} {self.unit}{also}"

    @property
    def limit_text(self) -> str:
        """ "at most 5 %"."""
        return self.limit if isinstance(self.limit, str) else f"at most {self.limit:g} {self.unit}"


@dataclass(frozen=True)
class AcceptanceResult:
    """All requirements; the result is accepted where each passes."""

    lines: tuple[AcceptanceLine, ...]

    def to_dict(self) -> dict[str, Any]:
        """What JSON holds of it."""
        return {"passed": self.passed, "lines": [asdict(line) for line in self.lines]}

    @property
    def passed(self) -> bool:
        """Whether every line passes."""
        return all(line.passed for line in self.lines)

    @property
    def text(self) -> str:
        """ "Accepted: 12 of 12 requirements are met."."""
        met = sum(line.passed for line in self.lines)
        word = "Accepted" if self.passed else "Not accepted"
        return f"{word}: {met} of {len(self.lines)} requirements are met."


def judge(result: ResultDocument, limits: AcceptanceLimits, joints: Sequence[str]) -> AcceptanceResult:
    """Compare the errors on held-out groups, the 95 % intervals and the verdict with their limits.

    A value that the result does not have fails. A default limit of a parameter concerns the joints that have
    it, and fails where none has.

    Raises:
        InputError: the result is of other joints.
    """
    lines = [] if not limits.verdict else [_verdict(result, limits)]
    errors = _errors(result, joints)
    for index, joint in enumerate(joints):
        lines += _held_out(joint, errors, index, limits)
    for joint in joints:
        for name, limit in limits.of(joint).interval_percent.items():
            found = next((p for p in result.all_parameters if (p.name, p.joint) == (name, joint)), None)
            asked = name in limits.joints[joint].interval_percent if joint in limits.joints else False
            if found is not None or asked:
                lines.append(_interval(name, joint, found, limit))
    known = {line.parameter for line in lines}
    absent = [(name, limit) for name, limit in limits.default.interval_percent.items() if name not in known]
    return AcceptanceResult((*lines, *(_interval(name, None, None, limit) for name, limit in absent)))


def _verdict(result: ResultDocument, limits: AcceptanceLimits) -> AcceptanceLine:
    found, accepted = result.final_verdict, " or ".join(limits.verdict)
    known = found in limits.verdict
    return AcceptanceLine("verdict", None, None, found, accepted, "", known, "" if found else "not diagnosed")


def _errors(result: ResultDocument, joints: Sequence[str]) -> JointErrors | None:
    """Errors on the held-out groups; None without any."""
    of = result.final_errors
    if of is None:
        raise InputError(f"the result of {result.set} has no errors per joint, expected those of a diagnosis")
    if list(of.joints) != list(joints):
        names = ", ".join(of.joints)
        raise InputError(f"the result is of the joints {names}, the set has {', '.join(joints)}")
    return JointErrors(of.rms_validation, of.torque_spread, units=of.units) if of.rms_validation else None


def _held_out(
    joint: str, errors: JointErrors | None, index: int, limits: AcceptanceLimits
) -> Iterator[AcceptanceLine]:
    of = limits.of(joint)
    kinds = (
        (of.held_out_percent, PERCENT, [] if errors is None else errors.shares),
        (of.held_out_torque, TORQUE, [] if errors is None else errors.rms),
    )
    for limit, unit, values in kinds:
        if limit is None:
            continue
        known = index < len(values) and math.isfinite(values[index])
        figure = values[index] if known else None
        remark = "" if known else NO_HELD_OUT if errors is None else "not known"
        passed = figure is not None and figure <= limit
        also = "" if errors is None or figure is None else error_in_other(errors, index, unit)
        if unit == TORQUE and errors is not None and errors.units:
            unit = errors.units[index]
        yield AcceptanceLine("held-out error", joint, None, figure, limit, unit, passed, remark, also)


def _interval(name: str, joint: str | None, found: ParameterEstimate | None, limit: float) -> AcceptanceLine:
    what, figure, remark = f"95 % interval of {plain_name(name)}", None, ""
    if found is None:
        remark = "not in the model"
    elif found.identifiable == "no" or not math.isfinite(found.std) or not found.value:
        remark = "not determined"
    elif found.at_bound:
        remark = "at its bound"
    else:
        figure = 100.0 * NORMAL_95 * found.std / abs(found.value)
    passed = figure is not None and figure <= limit
    return AcceptanceLine(what, joint, name, figure, limit, "% of the value", passed, remark)
