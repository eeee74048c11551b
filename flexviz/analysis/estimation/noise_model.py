"""Noise model of the residual and settings of the weighting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from flexviz.analysis.estimation.unknown_input import UnknownInput
from flexviz.base.arrays import Array


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """Filtered measurement noise plus a white model error, and an unknown input if any.

    Attributes:
        order: number of preceding samples that predict each sample.
        every: spacing of the samples at which the predictor is computed, interpolated in between; 1 is exact.
        ridge: share of the noise variance added to that of the preceding samples in the prediction.
        model_error: shape (n,), variance of the model error [Nm²].
        unknown_input: an arbitrary torque at one place.
    """

    order: int
    every: int
    ridge: float
    model_error: Array
    unknown_input: UnknownInput | None = None


@dataclass(frozen=True)
class WeightingSettings:
    """Band and resolution of the weighting.

    A higher resolution is more accurate, but also more sensitive to small errors of an approximate model.

    Attributes:
        hertz: band of the residual.
        orders: number of joints → order of the predictor; lower for robots with more joints.
        long_order: order for numbers of joints that are not listed.
        every, ridge: as in `NoiseModel`.
        products: products of signals are formed before they are filtered (`FilteredProducts`).
    """

    hertz: float
    orders: Mapping[int, int]
    long_order: int
    every: int = 1
    ridge: float = 0.0
    products: bool = False

    def noise_model(self, joints: int) -> NoiseModel:
        """Noise model for a number of joints, without model error."""
        order = self.orders.get(joints, self.long_order)
        return NoiseModel(order, self.every, self.ridge, np.zeros(joints))


WIDE_HERTZ = 14.0
REFINING = WeightingSettings(WIDE_HERTZ, MappingProxyType({1: 40, 2: 32, 3: 24}), 14)
