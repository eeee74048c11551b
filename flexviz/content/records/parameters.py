"""Parameters of a result, with their uncertainty, and the effects of a model."""

from __future__ import annotations

import math
from dataclasses import dataclass as plain_dataclass
from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from flexviz.base.fields import RECORD, Number, Real, is_none
from flexviz.base.statistics import NORMAL_95
from flexviz.content.records.notes import Grade

NOT_DETERMINED = "not determined"


def is_determined(grade: Grade | None, value: float, std: float | None) -> bool:
    """Whether the data determine a value: not if it is graded "no", nor if its interval is wider.

    A "yes" near zero is an answer: an offset known to be none.
    """
    narrow = std is None or math.isnan(std) or NORMAL_95 * std <= abs(value)
    return grade == "yes" or (grade != "no" and narrow)


@plain_dataclass(frozen=True)
class Interval:
    """The 95 % interval of a parameter; its text says what is not determined.

    Attributes:
        lower, upper: its ends, in `unit`; infinite where the data set no limit, NaN without an interval.
        unit: SI.
        determined: whether the data determine the value: its grade is not "no", and half of the interval is
            no wider than the value, unless that is known to be near zero.
    """

    lower: float
    upper: float
    unit: str
    determined: bool

    def __contains__(self, value: float) -> bool:
        return self.lower <= value <= self.upper

    def __str__(self) -> str:
        if math.isinf(self.upper) and math.isfinite(self.lower):
            return f"{NOT_DETERMINED} (above {self.lower:.4g} {self.unit})"
        if not self.determined:
            return NOT_DETERMINED
        if math.isnan(self.lower):
            return "without an interval"
        return f"{self.lower:.5g} … {self.upper:.5g} {self.unit}".rstrip()


@dataclass(frozen=True, config=RECORD)
class ParameterEstimate:
    """One parameter.

    Attributes:
        name, joint, unit: as in the JSON contract; joint is None where it belongs to none.
        value: in SI units.
        std: standard error; infinite or NaN where unknown, null in documents. NaN if `identifiable` is "no":
            the interval of what the data do not determine is not known either.
        identifiable: "yes", "weak" or "no".
        start: start value.
        tied_to: parameters ("izz:joint1") that the data cannot move independently of this one.
        at_bound: held at a physical bound.
        payload, group: of an effect that concerns one payload, or one group only.
        rigid_above: of a stiffness that the data do not tell from infinity: what it is above, at 95 %.
    """

    name: str
    joint: str | None
    value: Number
    std: Real
    unit: str
    identifiable: Grade
    start: Real = math.nan
    tied_to: tuple[str, ...] = ()
    at_bound: bool = False
    payload: str | None = None
    group: str | None = None
    rigid_above: Annotated[Number | None, Field(exclude_if=is_none)] = None

    def __post_init__(self) -> None:
        _without_interval(self)

    @property
    def interval(self) -> Interval:
        """The 95 % interval, value ± 1.96 std; of a stiffness that may be infinite from `rigid_above` on.

        Ends are NaN where the standard error is not known, as for what the data do not determine.
        """
        known = is_determined(self.identifiable, self.value, self.std)
        if self.rigid_above is not None:
            return Interval(self.rigid_above, math.inf, self.unit, known)
        half = NORMAL_95 * self.std if math.isfinite(self.std) else math.nan
        return Interval(self.value - half, self.value + half, self.unit, known)

    @property
    def label(self) -> str:
        """`izz:joint1`, `payload_error.relative_mass_error:p2`, as an iteration names it."""
        return ":".join(part for part in (self.name, self.joint, self.payload, self.group) if part)


@dataclass(frozen=True, config=RECORD)
class Combination:
    """A base parameter: the smallest combination of inertial parameters that motion can show.

    Attributes:
        name: "izz:joint1 + 1 mass:joint2".
        value, std: in the unit of the leading parameter; std as in `ParameterEstimate`.
        unit: of the leading parameter.
        identifiable: "yes", "weak" or "no".
        weights: parameter → coefficient.
    """

    name: str
    value: Number
    std: Real
    unit: str
    identifiable: Grade
    weights: dict[str, Number] = Field(default_factory=dict)

    def __post_init__(self) -> None:
        _without_interval(self)


def _without_interval(estimate: ParameterEstimate | Combination) -> None:
    if estimate.identifiable == "no":
        object.__setattr__(estimate, "std", math.nan)


@dataclass(frozen=True, config=RECORD)
class EffectParameter:
    """A parameter of an effect: value, standard error (NaN if unknown), unit; graded in exports."""

    value: Number
    std: Real = math.nan
    unit: str = ""
    identifiable: Annotated[Grade | None, Field(exclude_if=is_none)] = None


@dataclass(frozen=True, config=RECORD)
class EffectEntry:
    """An effect of a model with its place and values; an export adds title and equation."""

    effect: str
    parameters: dict[str, EffectParameter]
    joint: str | None = None
    group: str | None = None
    payload: str | None = None
    title: Annotated[str | None, Field(exclude_if=is_none)] = None
    equation: Annotated[str | None, Field(exclude_if=is_none)] = None
