"""An observer fed with one sample at a time, as in a controller."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flexviz.base.arrays import Array
from flexviz.base.errors import InputError


class LiveStep(NamedTuple):
    """One bandwidth's recursion z ← A z + b₀ y_k + b₁ y_{k+1} and its states x̂ = C z."""

    transition: Array  # A (6, 6)
    before: Array  # b₀ (6,)
    after: Array  # b₁ (6,)
    output: Array  # C (6, 6)


class LiveObserver:
    """An observer's states at the newest sample: those of the whole record, up to rounding.

    It costs two products of 6 × 6 matrices per joint and sample. Like the observer of a record it takes the
    signal as a straight line between samples, and as constant before the first one. Made by
    `Observer.live`:

        eso = flexviz.make_observer("eso", 60.0).live(step=0.001)
        while True:
            angle, velocity, *_ = eso.update(read_angles())

    Args:
        steps: of each joint, or one for all.
    """

    def __init__(self, steps: Sequence[LiveStep]) -> None:
        self._transition, self._before, self._after, self._output = map(np.array, zip(*steps, strict=True))
        self._first: Array | None = None

    def update(self, sample: ArrayLike) -> Array:
        """The states after one more sample.

        Args:
            sample: shape (n,), or a number for a single joint [rad] or [Nm].

        Returns:
            (6, n): the signal and its derivatives up to the fifth [rad/s^k], [Nm/s^k]; of the
            extended-state observer the last one is the disturbance.

        Raises:
            InputError: for another number of joints than before, or than bandwidths; for NaN. The states
                are then as before.
        """
        y = np.atleast_1d(np.asarray(sample, float))
        if not np.isfinite(y).all():
            raise InputError(f"found {y}, expected finite numbers")
        if self._first is None:
            self.reset(y)
            assert self._first is not None
        if y.shape != self._first.shape:
            raise InputError(f"a sample has the shape {y.shape}, expected {self._first.shape}")
        y = y - self._first  # at rest in the beginning
        self._z = np.einsum("jab,jb->ja", self._transition, self._z)
        self._z += self._before * self._last[:, None] + self._after * y[:, None]
        self._last = y
        states = np.einsum("jab,jb->aj", self._output, self._z)
        states[0] += self._first
        return states

    def reset(self, sample: ArrayLike) -> None:
        """Start anew from rest at a sample (n,)."""
        first = np.atleast_1d(np.array(sample, float))
        if first.ndim != 1 or len(self._before) not in (1, len(first)):
            found = f"a sample of the shape {first.shape} for {len(self._before)} bandwidths"
            raise InputError(f"{found}: expected one value per joint")
        self._first, self._last = first, np.zeros(len(first))
        self._z = np.zeros((len(first), self._before.shape[1]))
