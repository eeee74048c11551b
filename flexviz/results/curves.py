"""Entries for what a plot shows: residual maps, a free curve, the check over the bandwidth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import model_validator

from flexviz.results.base import Column, Counts, Nullable, ResultEntry, Rows


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
        if isinstance(data, Mapping):
            return data
        columns = (data.rms.T, data.change.T, data.change_noise.T, data.observer_error.tolist())
        rows = zip(data.joints, *columns, strict=True)  # the fields of a GuardJointEntry
        return {
            "observer": data.observer,
            "bandwidths": data.bandwidths,
            "in_use": int(data.in_use),
            "joints": list(rows),
            "parameters": data.parameters,
            "texts": data.texts(),
        }
