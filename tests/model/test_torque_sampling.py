"""A logged torque that misses what acts between two rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from independent import cases, files
from independent.arms import Array
from independent.simulator import RECORD, Motion, simulate

import flexviz


class Tabulated(Motion):
    """A reference that is stated once per row of the record, with straight lines in between."""

    def position(self, t: float | Array) -> Array:
        return self._between(super().position, t)

    def velocity(self, t: float | Array) -> Array:
        return self._between(super().velocity, t)

    @staticmethod
    def _between(curve: Callable[[float | Array], Array], t: float | Array) -> Array:
        row = np.floor(np.asarray(t) / RECORD + 1e-9)
        share = (np.asarray(t) / RECORD - row)[..., None]
        return (1 - share) * curve(row * RECORD) + share * curve((row + 1) * RECORD)


@pytest.mark.slow
def test_an_interpolated_reference_makes_motor_inertia_too_small(tmp_path: Path) -> None:
    """By k_p Δt²/12: the mean over a row of the torque due to the straight lines, zero at the rows."""
    case = cases.draw(5, "none", "2r", hold=1e-4, noise=0.3, duration=5.0)
    smooth, setup = case.setup.motion, case.setup
    lines = Tabulated(smooth.centre, smooth.amplitude, smooth.omega, smooth.phase)
    missed = setup.kp * RECORD**2 / 12  # [kg m²]
    for motion, expected in ((smooth, 0.0), (lines, -missed[1])):
        record = simulate(replace(setup, motion=motion)).noisy(setup.noise, np.random.default_rng(2))
        folder = tmp_path / type(motion).__name__
        files.write(folder, setup, record, case.drawn, case.rough, case.own)
        found = flexviz.identify(flexviz.read_set(folder), refine=True)["motor_inertia", "joint2"]
        assert found.value == pytest.approx(setup.motor_inertia[1] + expected, abs=0.15 * missed[1])
