"""Products of signals formed before they are filtered."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.fit_context import FitContext
from flexviz.analysis.estimation.noise_model import REFINING
from flexviz.analysis.estimation.two_band import TwoBandData
from flexviz.analysis.identification import identify
from flexviz.data.measurements import Segment
from flexviz.model.equation import Chain, FilteredProducts, LinkTerms, layout_of
from flexviz.model.observers import FlatZeroPhase
from flexviz.robot.robot import Robot
from tests.model.test_equation import made_up_set
from tests.model.test_reversals import simulated

LIGHT = "clean-2r-039-link_coulomb_friction"  # a light link that rings when the one before breaks loose
BAND = FlatZeroPhase(2 * np.pi * 14.0)
TWICE = FlatZeroPhase(2 * np.pi * 28.0)


def swinging(time: NDArray[np.float64], size: float) -> NDArray[np.float64]:
    """A 2 × 2 matrix that changes with the pose, shape (N, 2, 2)."""
    phase = np.array([[0.0, 0.4], [1.1, 2.0]])
    return size * (2.0 + np.sin(2 * np.pi * 1.5 * time[:, None, None] + phase))


def test_pulses_whose_products_are_formed_before_the_filter() -> None:
    step, every = 0.001, 16
    fine: NDArray[np.float64] = step * np.arange(6000.0)
    at, joint, compliance = 3.0047, 1, np.array([1e-3, 2e-3])
    unit = np.zeros((len(fine), 1))
    unit[3005] = 1.0  # 0.3 ms after `at`, so that the pose has to be taken there
    terms = LinkTerms(*(swinging(fine, size) for size in (40.0, 3.0, 0.5)))
    wide = TWICE.derivatives(unit, step, 3)[:, :, 0]
    whole = Chain(compliance, np.array([0.1, 0.2]), terms).column("deflection", (joint,), -wide[..., None])
    wanted = BAND.derivatives(whole, step, 1, stride=every)[0]

    time = fine[::every]
    seen = LinkTerms(*(swinging(time, size) for size in (40.0, 3.0, 0.5)))
    chain = Chain(compliance, np.array([0.1, 0.2]), seen)
    factors, own = chain.of_pulses(time, np.array([3.005, at]), joint)
    pulse = BAND.derivatives(unit, step, 3, stride=every)[:, :, 0]
    found = np.einsum("di,dt->ti", factors[:, 0], pulse)
    largest = np.abs(wanted).max()
    np.testing.assert_allclose(found, wanted, atol=0.003 * largest)
    assert (
        np.abs(chain.column("deflection", (joint,), -pulse[..., None]) - wanted).max() > 0.02 * largest
    )  # at each pose
    closer = np.abs(factors[:, 1] - factors[:, 0])
    assert np.all(closer < 0.01 * np.abs(factors[:, 0]).max(axis=1, keepdims=True))
    np.testing.assert_allclose(own, 2e-3)


@pytest.mark.parametrize(("every", "fast_enough"), [(1, True), (5, True), (10, False)])
def test_products_need_twice_the_band(every: int, fast_enough: bool) -> None:
    whole = made_up_set(Robot.load("robots:planar_2r"), "link2", seconds=12.0)  # 500 Hz
    thinned = [
        replace(g, segments=tuple(Segment(s.time[::every], s.theta[::every], s.tau[::every], every * s.step)
                                  for s in g.segments))
        for g in whole.groups
    ]  # fmt: skip
    data = TwoBandData(whole, thinned, layout_of(whole), replace(REFINING, products=True))
    assert data.has_products == fast_enough


@pytest.mark.slow
def test_links_that_break_loose_leave_less(tmp_path: Path) -> None:
    measurements = simulated(tmp_path, LIGHT, 109)
    layout = layout_of(measurements)
    context = FitContext(measurements, layout)
    x = layout.vector(identify(measurements).model)
    point = context.fit(layout, x, iterations=6).point
    data = context.two_band
    products = data._products
    assert isinstance(products, FilteredProducts)  # the model has friction on the link
    wide = data.wide.at(point.x, moving=True)
    left = [products.residual(wide, point.x), wide.residual(point.x)]
    whole, filtered = (
        np.concatenate([m.apply(r[b.rows]) for m, b in zip(point.weightings, data.blocks, strict=True)])
        for r in left
    )
    assert np.mean(whole**2, axis=0).max() < 1.3
    assert np.mean(filtered[:, 1] ** 2) > 1.4 * np.mean(whole[:, 1] ** 2)
