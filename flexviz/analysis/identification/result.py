"""Result of an identification."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from flexviz.analysis.identification.plots import IdentificationPlots
from flexviz.base.fields import Floats
from flexviz.base.iteration import Iteration
from flexviz.content.records import Combination, GainsEntry, ObserverEntry, ParameterEstimate, ResidualSummary
from flexviz.content.results import (
    DataFrame,
    FitFields,
    ResultDocument,
    curve_entries,
    find_parameter,
    parameter_frame,
    shared_fields,
    torque_side,
)
from flexviz.content.wording import stated_errors
from flexviz.model.observers import EsoGains, Observer, make_observer
from flexviz.robot.model import FlexibleModel


@dataclass(frozen=True, eq=False)
class ResidualSeries:
    """The residual of one group over time.

    Attributes:
        time: shape (N,) [s].
        residual: shape (N, n), r [Nm], in units of the recorded torque.
        torque: shape (N, n), transmission torque s seen from the motor [Nm].
        q: shape (N, n), identified link side [rad].
        noise: shape (n,), rms that measurement noise alone leaves with the fit's observer [Nm]; None in older
            sessions.
    """

    time: Floats
    residual: Floats
    torque: Floats
    q: Floats
    noise: Floats | None = None


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Identification(FitFields):
    """The result of one identification; what documents have under the same name is in `FitFields`.

    Attributes:
        set_name: the measurement set.
        observer_name, bandwidth: bandwidth in rad/s, float or shape (n,).
        groups: names of the fitted groups.
        iterations: all steps of the solver.
        seconds: wall time.
        parameters: estimates.
        combinations: base parameters.
        residual: summary per joint, in the band of all errors.
        model: the identified model.
        covariance: shape (P, P), of the entries that `parameter_names` lists.
        chance: the same without what the model lacks; None in older sessions.
        parameter_names: "izz:joint1".
        residuals: group name → residual over time, with the fit's own observer.
        gains: of the extended-state observer, if set by hand, at its (first joint's) bandwidth.
    """

    set_name: str
    observer_name: str
    bandwidth: float | Floats
    groups: tuple[str, ...]
    iterations: tuple[Iteration, ...]
    seconds: float
    parameters: tuple[ParameterEstimate, ...]
    combinations: tuple[Combination, ...]
    residual: ResidualSummary
    model: FlexibleModel
    covariance: Floats
    parameter_names: tuple[str, ...]
    residuals: dict[str, ResidualSeries]
    gains: EsoGains | None = None
    chance: Floats | None = None

    @property
    def chance_covariance(self) -> Floats:
        """Covariance (P, P) of chance alone: a band that allowed for missing effects would hide them."""
        return self.covariance if self.chance is None else self.chance

    @property
    def observer(self) -> Observer:
        """The observer that was used."""
        return make_observer(self.observer_name, self.bandwidth, self.gains)  # type: ignore[arg-type]

    @property
    def observer_entry(self) -> ObserverEntry:
        """The observer with its tuning, for documents and texts."""
        width = self.bandwidth if isinstance(self.bandwidth, float) else tuple(np.ravel(self.bandwidth))
        gains = self.gains and GainsEntry(self.gains.theta, self.gains.tau)
        return ObserverEntry(self.observer_name, width, gains)

    def noise_in(self, group: str) -> tuple[float, ...]:
        """Rms that measurement noise alone leaves in a residual over time, per joint [Nm]."""
        found = self.residuals[group].noise if group in self.residuals else None
        return self.residual.noise_floor if found is None else tuple(map(float, found))

    def __getitem__(self, key: str | tuple[str, str | None]) -> ParameterEstimate:
        """A parameter by name and joint (or payload, or group): `result["stiffness", "joint1"]`.

        Raises:
            ParameterNotFound: unknown name or joint, with suggestions (a FlexvizError and KeyError).
        """
        return find_parameter(self.parameters, key)

    def __repr__(self) -> str:
        state = "stopped" if self.stopped else "converged" if self.converged else "not converged"
        error = stated_errors(self.residual, self.residual.torque_spread).whole()
        return (
            f"<Identification of {self.set_name}: {state}, {len(self.parameters)} parameters, error {error}>"
        )

    def summary(self, width: int = 140) -> str:
        """Parameters, inertial combinations and residuals as text."""
        return self.document().summary(width)

    def _repr_html_(self) -> str:
        return self.document()._repr_html_()

    @property
    def plot(self) -> IdentificationPlots:
        """Figures: `plot.residual(joint="joint2")`, `plot.law("coulomb_friction", joint="joint2")`."""
        return IdentificationPlots(self)

    def to_frame(self) -> DataFrame:
        """The parameters as a table of pandas; MissingPackage if that is not installed."""
        return parameter_frame(self.parameters)

    def to_dict(self) -> dict[str, Any]:
        """The contract's `identify --json` document, with the base parameters as an extra key."""
        return self.document().to_dict()

    def document(self) -> ResultDocument:
        """The result as a document for files."""
        return ResultDocument(
            format=1,
            set=self.set_name,
            observer=self.observer_entry,
            groups=self.groups,
            iterations=max((i.number for i in self.iterations), default=0),
            seconds=self.seconds,
            parameters=self.parameters,
            base_parameters=self.combinations,
            residual=self.residual,
            torque_side=torque_side(self.parameters),
            **shared_fields(self, FitFields),
            **curve_entries(self.parameters),
        )
