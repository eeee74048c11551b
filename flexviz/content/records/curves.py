"""What a plot shows: where a residual lies, its maps, and free curves."""

from __future__ import annotations

import operator
from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from flexviz.base.facts import Fact
from flexviz.base.fields import RECORD, Column, Counts, Real, Rows, Said, check_lengths
from flexviz.base.statistics import NORMAL_95
from flexviz.content.records.parameters import ParameterEstimate
from flexviz.model.effects import (
    CURVES,
    FREE_CURVE_DIRECTIONS,
    CurveForm,
    curve_points,
    free_curve,
    simple_form,
)

Array = NDArray[np.float64]

NOT_PHYSICS = Fact("curve-not-physics")


@dataclass(frozen=True, config=RECORD)
class ResidualLocation:
    """A joint, and a variable that explains a share of its residual out of sample."""

    joint: str
    variable: str
    explained: Real
    range: tuple[Real, Real]


@dataclass(frozen=True, eq=False, config=RECORD)
class ResidualMap:
    """Residual of one joint against one variable.

    Attributes:
        joint, variable: of the residual; "position × direction" has one curve per direction.
        curves: names of the S curves: directions, groups (against time), or "" for a single one; for
            "frequency" the residual and its noise floor.
        centres: shape (S, B), mean of the variable in each bin, in its `unit`; NaN in empty bins.
        mean: shape (S, B), mean residual [Nm]; for "frequency" the square root of its density [Nm/√Hz].
        std: shape (S, B), standard error of the mean, including autocorrelation [Nm].
        count: shape (S, B), samples; for "frequency" spectral lines.
        explained, explained_std: out-of-sample share of the residual's mean square, and its standard error;
            zero on average for noise. For "frequency" that of the strongest band of one hertz above the noise
            floor, excluding the frequencies of the motion and their harmonics.
        explained_by_group: group → share within its samples.
        range: shortest range of the variable that contains half of the explained share.
    """

    joint: str
    variable: str
    unit: str
    curves: tuple[str, ...]
    centres: Rows
    mean: Rows
    std: Rows
    count: Counts
    explained: Real
    explained_std: Real
    explained_by_group: dict[str, Real]
    range: tuple[Real, Real]


@dataclass(frozen=True, eq=False, config=RECORD)
class FreeCurve:
    """Residual torque of one joint as a smooth curve of one variable.

    Attributes:
        joint, variable, unit: what it is of; position and velocity may have one curve per direction.
        directions: names of the S curves: forward and backward, or "" for a single one.
        centres: shape (M,), values of the variable.
        value: shape (S, M), torque missing in the model [Nm]; positive like friction at positive velocity;
            NaN outside the range of the motion. The part that the model's parameters can absorb is excluded,
            so that, e.g., extra friction beside Coulomb friction is known up to a constant.
        std: shape (S, M), its standard error [Nm].
        explained, explained_std: share of the joint's residual predicted out of sample; its standard error.
        smoothing: variance of an independent sample, relative to which the curve's prior counts [Nm²].
        note: what every such curve is.
        form: the simple law that the curve resembles; "" if there is none.
    """

    joint: str
    variable: str
    unit: str
    directions: tuple[str, ...]
    centres: Column
    value: Rows
    std: Rows
    explained: Real
    explained_std: Real
    smoothing: Real
    note: Said = NOT_PHYSICS
    form: Said = ""

    @property
    def certain(self) -> bool:
        """Whether it explains anything beyond doubt."""
        return self.explained >= NORMAL_95 * self.explained_std

    def simple_form(self) -> CurveForm | None:
        """The simple law that the curve resembles."""
        return form_of(self.variable, self.unit, self.centres, self.value, self.std)

    @property
    def effects(self) -> tuple[str, ...]:
        """The free curves of a model that are of its kind, on motor and link; none against acceleration."""
        kind = self.variable, len(self.directions) > 1
        return tuple(curve.name for curve in CURVES if (curve.variable, curve.each_way) == kind)


@dataclass(frozen=True, eq=False, config=RECORD)
class CurveTable:
    """A free curve of the model as a table.

    Between the nodes it is a natural cubic spline, beyond them constant; of velocity it is a function of the
    speed.

    Attributes:
        directions: names of the S curves: forward and backward, or "" for a single one.
        at: shape (M,), nodes, in the `unit` of the variable.
        value, std: shape (S, M), torque and its standard error [Nm]; NaN where unknown.
        form: the simple law that the curve resembles; "" if there is none.
    """

    effect: str
    joint: str | None
    variable: str
    unit: str
    directions: tuple[str, ...]
    at: Column
    value: Rows
    std: Rows
    form: Annotated[Said, Field(exclude_if=operator.not_)] = ""

    @model_validator(mode="after")
    def _per_node(self) -> Self:
        check_lengths(len(self.directions), "one row per direction", value=self.value, std=self.std)
        for row in (*self.value, *self.std):
            check_lengths(len(self.at), "one per node", row=row)
        return self

    def simple_form(self) -> CurveForm | None:
        """The simple law that the curve resembles."""
        return form_of(self.variable, self.unit, self.at, self.value, self.std)


def form_of(variable: str, unit: str, at: Array, value: Array, std: Array) -> CurveForm | None:
    """The simple law that a curve resembles: at (M,) of a variable, torque and its error (S, M) [Nm]."""
    return _form_of(variable, unit, len(at), *(array.tobytes() for array in (at, value, std)))


@lru_cache(maxsize=64)  # it takes 0.2 s, and every document and chart of a model asks for it
def _form_of(variable: str, unit: str, nodes: int, *arrays: bytes) -> CurveForm | None:
    at, value, std = (np.frombuffer(array).reshape(-1, nodes) for array in arrays)
    return simple_form(curve_points(variable, at[0], value, std), variable, unit)


def curve_tables(parameters: Iterable[ParameterEstimate]) -> list[CurveTable]:
    """The free curves among the parameters of a model."""
    found: dict[tuple[str, str | None], list[ParameterEstimate]] = {}
    for p in parameters:
        effect = p.name.partition(".")[0]
        if free_curve(effect) is not None:
            found.setdefault((effect, p.joint), []).append(p)
    out = []
    for (name, joint), own in found.items():
        curve = free_curve(name)
        assert curve is not None
        known = {p.name.partition(".")[2]: p for p in own}
        values = np.array([known[spec.name].value for spec in curve.parameters])
        std = np.array([[known[spec.name].std for spec in side] for side in curve.node_parameters], float)
        table = CurveTable(
            name, joint, curve.variable, curve.unit, FREE_CURVE_DIRECTIONS if curve.sides == 2 else ("",),
            curve.node_places(values), curve.node_values(values), np.where(np.isfinite(std), std, np.nan),
        )  # fmt: skip
        form = table.simple_form()
        out.append(replace(table, form=form.fact) if form else table)
    return out
