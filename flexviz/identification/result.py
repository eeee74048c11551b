"""Result of an identification."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from flexviz.arrays import Array
from flexviz.model import FlexibleModel
from flexviz.observers import EsoGains, Observer, make_observer
from flexviz.progress import Iteration
from flexviz.results import Grade, ObserverEntry, ResultDocument, curve_entries, find_parameter

IN_DOCUMENT = (
    "refined", "groups", "validation_groups", "converged", "stopped", "message", "seconds",
    "condition_number", "parameters", "residual",
)  # of an identification, under the same name  # fmt: skip


@dataclass(frozen=True)
class ParameterEstimate:
    """One parameter.

    Attributes:
        name, joint, unit: as in the JSON contract; joint is None where it belongs to none.
        value: in SI units.
        std: standard error.
        start: start value.
        identifiable: "yes", "weak" or "no".
        tied_to: parameters ("izz:joint1") that the data cannot move independently of this one.
        at_bound: held at a physical bound.
        payload, group: of an effect that concerns one payload, or one group only.
    """

    name: str
    joint: str | None
    value: float
    std: float
    unit: str
    start: float
    identifiable: Grade
    tied_to: tuple[str, ...] = ()
    at_bound: bool = False
    payload: str | None = None
    group: str | None = None

    @property
    def label(self) -> str:
        """`izz:joint1`, `payload_error.relative_mass_error:p2`, as an iteration names it."""
        return ":".join(part for part in (self.name, self.joint, self.payload, self.group) if part)


@dataclass(frozen=True)
class Combination:
    """A base parameter: an identifiable combination of inertial parameters.

    Attributes:
        name: "izz:joint1 + 1 mass:joint2".
        weights: parameter → coefficient.
        value, std: in the unit of the leading parameter.
        unit: of the leading parameter.
        identifiable: "yes", "weak" or "no".
    """

    name: str
    weights: dict[str, float]
    value: float
    std: float
    unit: str
    identifiable: Grade


@dataclass(frozen=True)
class ResidualSummary:
    """Residual of the equation in Nm, one number per joint.

    Attributes:
        joints: their names.
        rms: over the samples of the fitted groups.
        rms_validation: over the validation groups; None without any.
        noise_floor: rms due to measurement noise alone.
        torque_spread: standard deviation of the recorded torque over all groups; empty if unknown.
        rms_between_reversals: rms over the samples of the fitted groups that no reversal and no crossing of a
            gap disturbs; empty if the model has no effect whose torque is unknown there.
        noise_share: share of the noise in each joint's torque, in the band of the fit; empty if unknown.
    """

    joints: tuple[str, ...]
    rms: tuple[float, ...]
    rms_validation: tuple[float, ...] | None
    noise_floor: tuple[float, ...]
    torque_spread: tuple[float, ...] = ()
    rms_between_reversals: tuple[float, ...] = ()
    noise_share: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class ResidualSeries:
    """The residual of one group over time.

    Attributes:
        time: shape (N,) [s].
        residual: shape (N, n), r [Nm].
        torque: shape (N, n), transmission torque s seen from the motor [Nm].
        q: shape (N, n), identified link side [rad].
    """

    time: Array
    residual: Array
    torque: Array
    q: Array


@dataclass(frozen=True, eq=False, repr=False)
class Identification:
    """The result of one identification.

    Attributes:
        set_name: the measurement set.
        observer_name, bandwidth: bandwidth in rad/s, float or shape (n,).
        refined: whether the instrumental-variables refinement has run.
        groups, validation_groups: names.
        converged, stopped: how it ended; a stopped one keeps what it had.
        iterations: all steps of the solver.
        seconds: wall time.
        parameters: estimates.
        combinations: base parameters.
        residual: summary per joint.
        model: the identified model.
        condition_number: of the column-scaled weighted Jacobian over base and joint parameters.
        covariance: shape (P, P), of the entries that `parameter_names` lists.
        parameter_names: "izz:joint1".
        residuals: group name → residual over time.
        message: one sentence on the outcome.
        gains: of the extended-state observer, if set by hand, at its (first joint's) bandwidth.
    """

    set_name: str
    observer_name: str
    bandwidth: float | Array
    refined: bool
    groups: tuple[str, ...]
    validation_groups: tuple[str, ...]
    converged: bool
    stopped: bool
    iterations: tuple[Iteration, ...]
    seconds: float
    parameters: tuple[ParameterEstimate, ...]
    combinations: tuple[Combination, ...]
    residual: ResidualSummary
    model: FlexibleModel
    condition_number: float
    covariance: Array
    parameter_names: tuple[str, ...]
    residuals: dict[str, ResidualSeries]
    message: str
    gains: EsoGains | None = None

    @property
    def observer(self) -> Observer:
        """The observer that was used."""
        return make_observer(self.observer_name, self.bandwidth, self.gains)  # type: ignore[arg-type]

    @property
    def observer_entry(self) -> ObserverEntry:
        """The observer with its tuning, for documents and texts."""
        width = self.bandwidth if isinstance(self.bandwidth, float) else np.ravel(self.bandwidth).tolist()
        entry: dict[str, Any] = {"name": self.observer_name, "bandwidth": width}
        return ObserverEntry.model_validate(entry | ({"gains": self.gains} if self.gains else {}))

    def __getitem__(self, key: str | tuple[str, str | None]) -> ParameterEstimate:
        """A parameter by name and joint (or payload, or group): `result["stiffness", "joint1"]`.

        Raises:
            ParameterNotFound: unknown name or joint, with suggestions (a FlexvizError and KeyError).
        """
        return find_parameter(self.parameters, key)

    def __repr__(self) -> str:
        state = "stopped" if self.stopped else "converged" if self.converged else "not converged"
        rms = ", ".join(f"{value:.3g}" for value in self.residual.rms)
        return (
            f"<Identification of {self.set_name}: {state}, {len(self.parameters)} parameters, rms {rms} Nm>"
        )

    def summary(self, width: int = 140) -> str:
        """Parameters, inertial combinations and residuals as text."""
        return self.document().summary(width)

    def _repr_html_(self) -> str:
        return self.document()._repr_html_()

    def to_dict(self) -> dict[str, Any]:
        """The contract's `identify --json` document, with the base parameters as an extra key."""
        return self.document().to_dict()

    def document(self) -> ResultDocument:
        """The result as a document for files."""
        other = {
            "format": 1,
            "set": self.set_name,
            "observer": self.observer_entry,
            "iterations": max((i.number for i in self.iterations), default=0),
            "base_parameters": self.combinations,
        }
        same = {name: getattr(self, name) for name in IN_DOCUMENT}
        return ResultDocument.model_validate(same | other | curve_entries(self.parameters))
