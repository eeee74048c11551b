"""Whether a result keeps its limits, line by line."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any

from flexviz.analysis.acceptance.limits import AcceptanceLimits
from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.base.statistics import NORMAL_95
from flexviz.content.records import FOLLOWING, PERCENT, TORQUE, JointErrors, ParameterEstimate
from flexviz.content.results import ResultDocument


@dataclass(frozen=True)
class AcceptanceLine:
    """One requirement.

    Attributes:
        what: the quantity.
        joint: None for the whole robot.
        parameter: whose interval it is; None: an error or the verdict.
        figure: what the result has, in `unit`; None where it has none.
        limit: what it has to keep.
        unit: of both; empty for a verdict.
        passed: whether figure ≤ limit, or the verdict is one of the accepted ones.
        remark: why there is no figure; None otherwise.
        also: an error in the other unit, per cent or Nm; None where it is not known.
    """

    what: Fact
    joint: str | None
    parameter: str | None
    figure: float | str | None
    limit: float | str
    unit: str
    passed: bool
    remark: Fact | None = None
    also: Fact | None = None

    @property
    def found(self) -> Fact:
        """ "3.21 %", "nothing-missing", or why there is no figure."""
        if self.remark is not None:
            return self.remark
        values = {"figure": self.figure, "unit": self.unit, "also": self.also and self.also.text}
        return Fact("acceptance-figure", values=values)

    @property
    def required(self) -> Fact:
        """ "at most 5 %"."""
        return Fact("acceptance-limit", values={"limit": self.limit, "unit": self.unit})

    @property
    def figure_text(self) -> str:
        """What the result has, in words."""
        return self.found.text

    @property
    def limit_text(self) -> str:
        """What it has to keep, in words."""
        return self.required.text

    def to_dict(self) -> dict[str, Any]:
        """What JSON holds of it."""
        texts = {name: str(getattr(self, name) or "") for name in ("what", "remark", "also")}
        return {field.name: getattr(self, field.name) for field in fields(self)} | texts


@dataclass(frozen=True)
class AcceptanceResult:
    """All requirements; the result is accepted where each passes."""

    lines: tuple[AcceptanceLine, ...]

    def to_dict(self) -> dict[str, Any]:
        """What JSON holds of it."""
        return {"passed": self.passed, "lines": [line.to_dict() for line in self.lines]}

    @property
    def passed(self) -> bool:
        """Whether every line passes."""
        return all(line.passed for line in self.lines)

    @property
    def fact(self) -> Fact:
        """How many requirements are met."""
        met = sum(line.passed for line in self.lines)
        return Fact(
            "acceptance", "note" if self.passed else "wrong", values={"met": met, "of": len(self.lines)}
        )

    @property
    def text(self) -> str:
        """ "Accepted: 12 of 12 requirements are met."."""
        return self.fact.text


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
    known, why = found in limits.verdict, None if found else _no_figure("not-diagnosed")
    return AcceptanceLine(_required("verdict"), None, None, found, accepted, "", known, why)


def _required(what: str, parameter: str = "") -> Fact:
    return Fact("acceptance-quantity", values={"what": what, "parameter": parameter})


def _no_figure(why: str) -> Fact:
    return Fact("no-figure", values={"why": why})


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
    percent = PERCENT if errors is None else errors.percent
    rms, shares = ([], []) if errors is None else (errors.rms, errors.shares)
    kinds = (
        (of.held_out_percent, percent, shares),
        (of.held_out_torque, TORQUE, rms if percent == PERCENT else []),
        (of.held_out_angle, "rad", rms if percent == FOLLOWING else []),
    )
    for limit, unit, values in kinds:
        if limit is None:
            continue
        known = index < len(values) and math.isfinite(values[index])
        figure = values[index] if known else None
        remark = None if known else _no_figure("unknown" if errors else "nothing-held-out")
        passed = figure is not None and figure <= limit
        also = None if errors is None or figure is None else _in_other(errors, index, unit)
        if unit != percent and known and errors is not None and errors.units:
            unit = errors.units[index]
        what = _required("held-out-error")
        yield AcceptanceLine(what, joint, None, figure, limit, unit, passed, remark, also)


def _in_other(errors: JointErrors, index: int, unit: str) -> Fact | None:
    """The error of a joint in its own unit where it is judged in per cent, and the other way round."""
    own = errors.units[index] if errors.units else TORQUE
    percent = errors.percent
    value, other = (errors.rms[index], own) if unit == percent else (errors.shares[index], percent)
    return Fact("error-also", values={"error": value, "unit": other}) if math.isfinite(value) else None


def _interval(name: str, joint: str | None, found: ParameterEstimate | None, limit: float) -> AcceptanceLine:
    what, figure, remark = _required("interval", name), None, None
    if found is None:
        remark = _no_figure("not-in-model")
    elif found.identifiable == "no" or not math.isfinite(found.std) or not found.value:
        remark = _no_figure("not-determined")
    elif found.at_bound:
        remark = _no_figure("at-bound")
    else:
        figure = 100.0 * NORMAL_95 * found.std / abs(found.value)
    passed = figure is not None and figure <= limit
    return AcceptanceLine(what, joint, name, figure, limit, "% of the value", passed, remark)
