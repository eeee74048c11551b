"""Entries for what a plot shows: residual maps, a free curve, the check over the bandwidth."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Any, Self

import numpy as np
from pydantic import model_validator

from flexviz.effects import FREE_CURVE_DIRECTIONS, CurveForm, curve_points, free_curve, simple_form
from flexviz.results.base import Column, Counts, Nullable, ResultEntry, Rows, check_lengths
from flexviz.wording import ParameterLike


class MapEntry(ResultEntry):
    """One joint's residual [Nm] against one variable; one row per curve."""

    joint: str
    variable: str
    unit: str
    curves: list[str]
    centres: Rows
    mean: Rows
    std: Rows
    count: Counts
    explained: Nullable
    explained_std: Nullable
    explained_by_group: dict[str, Nullable]
    range: Column


class FreeCurveEntry(ResultEntry):
    """A free curve of residual torque [Nm] against one variable, a stopgap."""

    joint: str
    variable: str
    unit: str
    directions: list[str]
    centres: Column
    value: Rows
    std: Rows
    explained: Nullable
    explained_std: Nullable
    smoothing: Nullable
    note: str
    form: str = ""


class CurveTableEntry(ResultEntry):
    """A free curve of the model as a table: torque [Nm] at its nodes, one row per direction of motion.

    Between the nodes it is a natural cubic spline, beyond them constant; of velocity it is a function of the
    speed.
    """

    effect: str
    joint: str | None
    variable: str
    unit: str
    directions: list[str]
    at: Column
    value: Rows
    std: Rows
    form: str = ""

    @model_validator(mode="after")
    def _per_node(self) -> Self:
        check_lengths(len(self.directions), "one row per direction", value=self.value, std=self.std)
        for row in (*self.value, *self.std):
            check_lengths(len(self.at), "one per node", row=row)
        return self

    def simple_form(self) -> CurveForm | None:
        """The simple law that the curve resembles."""
        rows = (tuple(map(tuple, rows)) for rows in (self.value, self.std))
        return _simple_form(self.variable, self.unit, tuple(self.at), *rows)


@lru_cache(maxsize=64)  # it takes 0.2 s, and every document and chart of a model asks for it
def _simple_form(
    variable: str, unit: str, at: tuple[float | None, ...], *rows: tuple[tuple[float | None, ...], ...]
) -> CurveForm | None:
    return simple_form(curve_points(variable, at, *rows), variable, unit)


def curve_tables(parameters: Iterable[ParameterLike]) -> list[CurveTableEntry]:
    """The free curves among the parameters of a model."""
    found: dict[tuple[str, str | None], list[ParameterLike]] = {}
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
        std = [[known[spec.name].std for spec in side] for side in curve.node_parameters]
        table = CurveTableEntry(
            effect=name,
            joint=joint,
            variable=curve.variable,
            unit=curve.unit,
            directions=list(FREE_CURVE_DIRECTIONS if curve.sides == 2 else ("",)),
            at=curve.node_places(values).tolist(),
            value=curve.node_values(values).tolist(),
            std=std,
        )
        form = table.simple_form()
        out.append(table.model_copy(update={"form": form.text}) if form else table)
    return out


class GuardJointEntry(ResultEntry):
    """What moves with the bandwidth at one joint [Nm], one number per bandwidth."""

    joint: str
    rms: Column
    change: Column
    change_noise: Column
    observer_error: bool


class GuardParameterEntry(ResultEntry):
    """One parameter over the bandwidth."""

    name: str
    joint: str | None
    place: str | None
    unit: str
    values: Column
    std: Column
    moved: Nullable
    trusted: bool


class GuardEntry(ResultEntry):
    """What moves with the observer's bandwidth [rad/s]."""

    observer: str
    bandwidths: Column
    in_use: int
    joints: list[GuardJointEntry]
    parameters: list[GuardParameterEntry]
    texts: list[str]

    @model_validator(mode="before")
    @classmethod
    def _by_joint(cls, data: Any) -> Any:
        if not hasattr(data, "observer_error"):  # of a file
            return data
        noise = np.zeros_like(data.change.T)  # of `change`: below `band`, all bands are flat
        columns = (data.rms.T, data.change.T, noise, data.observer_error.tolist())
        rows = zip(data.joints, *columns, strict=True)  # the fields of a GuardJointEntry
        return {
            "observer": data.observer,
            "bandwidths": data.bandwidths,
            "in_use": int(data.in_use),
            "joints": list(rows),
            "parameters": data.parameters,
            "texts": data.texts(),
        }
