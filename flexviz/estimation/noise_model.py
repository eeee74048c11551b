"""Noise model of the residual, from which the data are weighted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """Filtered measurement noise, predicted from the samples before, and a white model error beside it.

    Attributes:
        order: number of earlier samples that predict each sample.
        every: the predictor is computed at every such sample and interpolated between; 1 is exact.
        ridge: share of the noise variance added to the earlier samples' own in the prediction.
        model_error: shape (n,), variance of the model error [Nm²].
    """

    order: int
    every: int
    ridge: float
    model_error: Array

    def with_model_error(self, variance: Array) -> NoiseModel:
        """The same with another model error, shape (n,) [Nm²]."""
        return replace(self, model_error=variance)


@dataclass(frozen=True)
class WeightingSettings:
    """Band and resolution of the weighting.

    A closer weighting comes nearer to the most that the data say; but a small error of a nearly correct law
    weighs more, too.

    Attributes:
        hertz: band of the residual.
        orders: number of joints → order of the predictor; lower for robots with more joints.
        long_order: the same for numbers of joints that are not listed.
        every, ridge: as in `NoiseModel`.
    """

    hertz: float
    orders: Mapping[int, int]
    long_order: int
    every: int = 1
    ridge: float = 0.0

    def noise_model(self, joints: int) -> NoiseModel:
        """For a robot with that many joints, without model error."""
        order = self.orders.get(joints, self.long_order)
        return NoiseModel(order, self.every, self.ridge, np.zeros(joints))


WIDE_HERTZ = 14.0
REFINING = WeightingSettings(WIDE_HERTZ, MappingProxyType({1: 40, 2: 32, 3: 24}), 14)
