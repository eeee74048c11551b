"""Observer, errors, models on the way: what a result consists of besides parameters and findings."""

from __future__ import annotations

import operator
from collections.abc import Sized
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from flexviz.base.fields import RECORD, Number, check_lengths, is_none
from flexviz.content.records.findings import FoundEffect
from flexviz.content.records.notes import Verdict
from flexviz.content.records.parameters import EffectEntry, ParameterEstimate


@dataclass(frozen=True, config=RECORD)
class GainsEntry:
    """Gains β1 … β6 of the observers of θ and τ [1/sⁱ], at the first joint's bandwidth."""

    theta: tuple[Number, ...]
    tau: tuple[Number, ...]


@dataclass(frozen=True, config=RECORD)
class ObserverEntry:
    """The observer; its bandwidth [rad/s] is one number or one per joint; gains only if set by hand."""

    name: str
    bandwidth: Number | tuple[Number, ...]
    gains: Annotated[GainsEntry | None, Field(exclude_if=is_none)] = None

    @property
    def tuning(self) -> str:
        """Bandwidth and gains as text."""
        width = ", ".join(f"{value:.4g}" for value in np.atleast_1d(self.bandwidth)) + " rad/s"
        if self.gains is None:
            return width
        theta, tau = (", ".join(f"{one:.4g}" for one in row) for row in (self.gains.theta, self.gains.tau))
        return f"{width}, gains β1 … β6 set by hand: {theta if theta == tau else f'{theta} (θ), {tau} (τ)'}"


@dataclass(frozen=True, config=RECORD)
class ResidualSummary:
    """Residual of the equation in Nm, unweighted, one number per joint.

    Attributes:
        joints: their names.
        rms: over the fitted groups, in the band of all errors and in units of the recorded torque.
        rms_validation: over the validation groups; None without any.
        noise_floor: rms due to measurement noise alone: of the recording, the same for all models of a set;
            empty if unknown.
        torque_spread: standard deviation of the recorded torque over all groups; empty if unknown.
        rms_between_reversals: rms over the samples of the fitted groups that no reversal and no crossing of a
            gap disturbs; empty if the model has no effect whose torque is unknown there.
        noise_share: share of the noise in each joint's torque, in the band of the fit (1: nothing but
            noise); empty if unknown.
        units: of each joint's torque, "N" where it slides; empty if all are in Nm.
    """

    joints: tuple[str, ...]
    rms: tuple[Number, ...]
    rms_validation: tuple[Number, ...] | None
    noise_floor: tuple[Number, ...]
    torque_spread: tuple[Number, ...] = ()
    rms_between_reversals: Annotated[tuple[Number, ...], Field(exclude_if=operator.not_)] = ()
    noise_share: tuple[Number, ...] = ()
    units: Annotated[tuple[str, ...], Field(exclude_if=operator.not_)] = ()

    @model_validator(mode="after")
    def _per_joint(self) -> Self:
        lists: dict[str, Sized | None] = {
            "rms": self.rms,
            "rms_validation": self.rms_validation,
        }
        for name in ("noise_floor", "torque_spread", "rms_between_reversals", "noise_share", "units"):
            lists[name] = getattr(self, name) or None
        check_lengths(len(self.joints), "one per joint", **lists)
        return self


@dataclass(frozen=True, config=RECORD)
class TorqueEntry:
    """Standard deviation of the recorded torque per joint, over all groups: in `units`, in Nm without."""

    joints: tuple[str, ...]
    spread: tuple[Number, ...]
    units: Annotated[tuple[str, ...], Field(exclude_if=operator.not_)] = ()

    @model_validator(mode="after")
    def _per_joint(self) -> Self:
        check_lengths(len(self.joints), "one per joint", spread=self.spread)
        return self


@dataclass(frozen=True, config=RECORD)
class GroupError:
    """The error of one group [Nm per joint], and whether the group is held out."""

    name: str
    rms: tuple[Number, ...]
    validation: bool


@dataclass(frozen=True, eq=False, config=RECORD)
class StepEntry:
    """A model on the way.

    Attributes:
        added: what it has more than the one before; None for the initial model.
        rms, rms_validation: its errors [Nm], one per joint, as in `PredictionErrors`.
        noise_floor: the rms that noise alone leaves [Nm], one per joint: the same for all models.
        groups: the same errors by group.
        verdict: on it.
        units: of each joint's torque, "N" where it slides; empty if all are in Nm.
    """

    added: FoundEffect | None = None
    rms: tuple[Number, ...] = ()
    rms_validation: tuple[Number, ...] | None = None
    groups: tuple[GroupError, ...] = ()
    noise_floor: tuple[Number, ...] = ()
    verdict: Verdict = Field(kw_only=True)
    units: tuple[str, ...] = Field(default=(), kw_only=True, exclude_if=operator.not_)


@dataclass(frozen=True, config=RECORD)
class ModelEntry:
    """The final model of a diagnosis."""

    effects: tuple[EffectEntry, ...]
    parameters: tuple[ParameterEstimate, ...]
