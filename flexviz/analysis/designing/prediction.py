"""Standard errors that `identify --refine` would find, from the motion alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexviz.analysis.estimation import TwoBandData, Whitening, start_values
from flexviz.data.measurements import MeasurementSet
from flexviz.model.equation import layout_of
from flexviz.robot.model import FlexibleModel


@dataclass(frozen=True)
class PredictedError:
    """A parameter with the standard error that is expected of its identification.

    Attributes:
        name, joint, unit: as in the results of `identify`.
        value: in the model of the design.
        std: standard error.
        prior_share: share of its variance that stems from the prior: near 1, the data do not show it.
    """

    name: str
    joint: str | None
    value: float
    std: float
    unit: str
    prior_share: float

    @property
    def label(self) -> str:
        """ "stiffness:joint1"."""
        return f"{self.name}:{self.joint}" if self.joint else self.name


def predict_errors(measurements: MeasurementSet, model: FlexibleModel) -> tuple[PredictedError, ...]:
    """Standard errors of the parameters of `model` with the groups of a set.

    The covariance is that of `identify --refine` with its noise model (sandwich), at the values of the model
    instead of fitted ones. The set may be predicted, with noise; its noise level is estimated from it.
    """
    groups = measurements.fit_groups
    layout = layout_of(measurements, [effect.text for effect in model.effects])
    data, x = TwoBandData(measurements, groups, layout), layout.vector(model)
    start = start_values(measurements, data.narrow)
    point = Whitening(data).point(start.bounds.clip(x))
    covariance = point.covariance(start.prior, from_noise=True)
    std = covariance.standard_errors.copy()
    values = x.copy()
    compliance = layout.compliance
    values[compliance] = 1 / x[compliance]
    std[compliance] = std[compliance] / x[compliance] ** 2
    return tuple(
        PredictedError(name, joint, float(value), float(error), unit, float(share))
        for (name, joint, unit), value, error, share in zip(
            layout.names(), values, std, np.clip(covariance.prior_share, 0.0, 1.0), strict=True
        )
    )
