"""What instruments of stiffness and damping share with the residual: dense sums, slopes, noise draws."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.bandwidth_check import fit_band
from flexviz.analysis.diagnosis.fit_context import FitContext
from flexviz.analysis.estimation import instrument_bias
from flexviz.analysis.estimation.instrument_bias import lookback, shared_noise
from flexviz.analysis.estimation.instrumental_variables import refine
from flexviz.analysis.estimation.noise_propagation import (
    THETA,
    NoiseDerivatives,
    NoisePath,
    instrument_paths,
    noise_paths,
)
from flexviz.analysis.estimation.two_band import TwoBandData
from flexviz.analysis.estimation.weighted_point import Point, Whitening
from flexviz.analysis.estimation.whitening import lagged_covariance, noise_kernel, shared_kernel, whitener
from flexviz.data.measurements import read_set
from flexviz.model.effects import ChosenEffect
from flexviz.model.equation import Layout, layout_of
from flexviz.model.equation.link import LinkTerms
from flexviz.model.observers import FlatZeroPhase
from flexviz.model.simulation import make_plan, move, record, write_plan
from flexviz.robot.model import EffectValue
from tests.planar_arm import of_groups

Array = NDArray[np.float64]
JOINTS = ("a", "b")
NARROW, WIDE = FlatZeroPhase(2 * np.pi * 5), FlatZeroPhase(2 * np.pi * 9)


def way(rng: np.random.Generator, depth: int, count: int, n: int) -> NoisePath:
    """Of the torque sensors of all joints, changing with time."""
    matrices = rng.standard_normal((depth, 1, n, n)) + 0.3 * rng.standard_normal((depth, count, n, n))
    matrices /= (2 * np.pi * 5) ** np.arange(depth)[:, None, None, None]
    return NoisePath(1, np.arange(n), matrices, NoiseDerivatives.plain(depth))


def test_shared_kernel_is_that_of_filtered_noise() -> None:
    rng = np.random.default_rng(4)
    raw, stride = 1e-3, 25
    noise = rng.standard_normal((400_000, 1))
    one, other = (o.derivatives(noise, raw, 3, stride=stride)[:, 200:-200, 0] for o in (NARROW, WIDE))
    two = NoiseDerivatives.plain(3)
    kernel = shared_kernel((NARROW, WIDE), raw * stride, raw, (two, two), 3)
    sizes = (noise_kernel(o, raw * stride, raw, two, 0)[0] for o in (NARROW, WIDE))
    scale = np.sqrt(np.outer(*(np.diag(size) for size in sizes)))
    for lag in range(-3, 4):
        here = slice(max(0, lag), one.shape[1] + min(0, lag))
        there = slice(max(0, -lag), one.shape[1] + min(0, -lag))
        empirical = one[:, here] @ other[:, there].T / (here.stop - here.start)
        assert np.abs((kernel[3 + lag] - empirical) / scale).max() < 0.03


def test_shared_noise_is_the_trace_of_the_dense_product(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(instrument_bias, "SAMPLE_SPACING", 1)
    rng, (count, n, order), (step, raw) = np.random.default_rng(5), (40, 2, 6), (0.03, 1e-3)
    instrument, residual = way(rng, 3, count, n), way(rng, 2, count, n)
    kernel = noise_kernel(WIDE, step, raw, residual.derivatives, order)
    lagged = lagged_covariance(residual.matrices, kernel, np.ones(n))
    lagged[0] += 0.05 * np.eye(n)
    tool = whitener(lagged)
    paths = instrument, residual
    derivatives = instrument.derivatives, residual.derivatives
    found = shared_noise(lookback(tool), *paths, shared_kernel((NARROW, WIDE), step, raw, derivatives, order))

    kernel = shared_kernel((NARROW, WIDE), step, raw, derivatives, count)
    apply = tool.apply(np.eye(count * n).reshape(count, n, count * n)).reshape(count * n, -1)
    for j in range(n):
        dense = np.zeros((count, n, count, n))  # E[z_j(t) r(u)ᵀ] from sensor j alone
        for t in range(count):
            for u in range(count):
                rho = kernel[count + t - u]
                z, r = instrument.matrices[:, t, :, j], residual.matrices[:, u, :, j]
                dense[t, :, u] = np.einsum("di,de,ek->ik", z, rho, r)
        product = apply @ dense.reshape(count * n, -1) @ apply.T
        later = np.diag(product).reshape(count, n)[order:]
        assert found[j] == pytest.approx(later.sum(axis=1).mean(), rel=1e-9)


@pytest.mark.parametrize("size", [9.0, 0.0])
def test_ways_of_the_instruments_are_slopes_of_those_of_the_residual(size: float) -> None:
    rng, joint = np.random.default_rng(6), 1
    damped, plain = Layout(JOINTS, (ChosenEffect("joint_damping", joint),)), Layout(JOINTS)
    x = np.abs(rng.standard_normal(damped.size))
    x[damped.compliance] = 1e-3, 7e-4
    x[-1] = size
    link = LinkTerms(*(rng.standard_normal((1, 2, 2)) for _ in range(3)))
    omega = np.array([5.0, 20.0, 31.0])  # where the filter passes all

    def response(path: NoisePath, j: int) -> Array:
        """Of r, or of its slope, to what sensor j says, shape (F, n)."""
        column = list(path.joints).index(j)
        gains = path.derivatives.gains(WIDE.transfer, omega)
        return np.sum([g[:, None] * m[0, :, column] for g, m in zip(gains, path.matrices, strict=True)], 0)

    def residual(layout: Layout, sensor: int, j: int, at: Array) -> Array:
        paths = noise_paths(layout, at[: layout.size], link)
        return response(next(w for w in paths if w.sensor == sensor and j in w.joints), j)

    seen = set()
    for parameters, into_z in instrument_paths(damped, x, link):
        for parameter, j in zip(parameters, into_z.joints, strict=True):
            seen.add((int(parameter), into_z.sensor))
            # the Jacobian's column of a compliance is that of the spring alone
            layout = damped if parameter == damped.size - 1 else plain
            h = 1e-5 * (x[parameter] or 1.0)
            up, down = x.copy(), x.copy()
            up[parameter] += h
            down[parameter] = max(down[parameter] - h, 0.0)
            ends = (residual(layout, into_z.sensor, j, at) for at in (up, down))
            slope = np.subtract(*ends) / (up[parameter] - down[parameter])
            close = 1e-6 * np.abs(slope).max()
            np.testing.assert_allclose(response(into_z, j), slope, rtol=1e-5, atol=close)
    stiff = range(damped.compliance.start, damped.compliance.stop)
    assert seen == {(p, s) for p in (*stiff, damped.size - 1) for s in (THETA, 1)}


def noise_deviation(point: Point) -> Array:
    """Standard deviation of the score from the noise model alone, shape (P,)."""
    two_band = point.two_band
    matrix = two_band.noise_score_covariance(point.x, point.link, point.z, point.weightings)
    return np.sqrt(np.diag(matrix))


@pytest.mark.slow
@pytest.mark.parametrize(
    "effects, noise",
    [
        ((), 2.0),
        ((EffectValue("joint_damping", "joint2", {"damping": 6.0}),), 0.6),
        ((EffectValue("backlash", "joint2", {"half_width": 1e-6}),), 0.6),  # instruments of the wide band
    ],
)
def test_without_what_is_shared_the_score_is_zero_on_average(
    tmp_path: Path, effects: tuple[EffectValue, ...], noise: float
) -> None:
    """A torque sensor that is so bad that the joint's deflection drowns in its noise."""
    plan = of_groups(make_plan("planar-2r"), duration=12.0)
    sensors = replace(plan.sensors, theta_noise=2e-7, torque_noise=noise)
    plan = replace(plan, sensors=sensors, model=replace(plan.model, effects=effects))
    runs = move(plan, 1)
    raw, clean = [], []
    for seed in range(16):
        measured = read_set(write_plan(plan, record(plan, runs, seed), tmp_path / f"s{seed}"))
        layout = layout_of(measured, [e.text for e in plan.model.effects])
        two_band = FitContext(measured, layout).two_band.with_layout(layout)
        x = layout.vector(plan.model)
        point = Whitening(two_band).point(x)
        deviation = noise_deviation(point)
        kept = [
            *range(layout.compliance.start, layout.compliance.stop),
            *range(layout.effect_start, layout.size),
        ]
        plain = point.z.reshape(-1, layout.size).T @ point.r.ravel()
        raw.append(plain[kept] / deviation[kept])
        clean.append(point.score()[kept] / deviation[kept])
    error = 1 / np.sqrt(len(raw))  # of the means
    assert np.abs(np.mean(raw, axis=0)).max() > 5 * error
    assert np.abs(np.mean(clean, axis=0)).max() < 3.5 * error
    assert 0.5 < np.std(clean) < 1.5


@pytest.mark.slow
def test_every_fit_takes_it_off(tmp_path: Path) -> None:
    plan = make_plan("planar-2r")
    plan = replace(plan, sensors=replace(plan.sensors, theta_noise=2e-7, torque_noise=2.0))
    measured = read_set(write_plan(plan, record(plan, move(plan, 1), 1), tmp_path / "set"))
    layout = layout_of(measured, ())
    context = FitContext(measured, layout)
    begin = context.start(layout)
    prior, bounds = begin.prior, begin.bounds
    start = layout.vector(plan.model)

    def check(two_band: TwoBandData, x: Array) -> None:
        point = Whitening(two_band).point(x)
        deviation = noise_deviation(point)
        score = prior.gradient_and_hessian(x)[0] + point.score()
        plain = prior.gradient_and_hessian(x)[0] + point.z.reshape(-1, layout.size).T @ point.r.ravel()
        free = layout.compliance
        assert np.abs(score[free] / deviation[free]).max() < 0.4
        assert np.abs(plain[free] / deviation[free]).max() > 0.9

    fit = context.fit(layout, start, iterations=20)
    assert fit.converged
    check(context.two_band.with_layout(layout), fit.x)

    alone = context.two_band.with_layout(layout)
    refined = refine(alone, prior, bounds, start)
    assert refined.converged
    check(alone, refined.place.x)

    check(alone, fit_band(alone, prior, bounds, start).x)


def test_instruments_of_a_gap_come_from_the_wide_band(tmp_path: Path) -> None:
    plan = of_groups(make_plan("planar-2r", ["backlash:joint2:half_width=0.001"]))
    measured = read_set(write_plan(plan, record(plan, move(plan, 1), 1), tmp_path / "set"))
    layout = layout_of(measured, ["backlash:joint2", "coulomb_friction:joint1"])
    two_band = FitContext(measured, layout).two_band.with_layout(layout)
    names = [layout.names()[k][:2] for k in two_band.wide_columns]
    assert names == [
        (name, "joint2") for name in ("stiffness", "link_viscous_friction", "backlash.half_width")
    ]
    x = layout.vector(replace(plan.model, effects=plan.model.effects[:1]))
    here = two_band.evaluate(x)
    assert here.jacobian is not None
    bands = {True: here.wide_point, False: here.narrow_point}
    for k in range(layout.size):
        there = bands[k in two_band.wide_columns].evaluate(x, moving=True).jacobian
        np.testing.assert_allclose(here.jacobian[:, :, k], there[:, :, k], rtol=1e-12)
    point = Whitening(two_band).point(x)
    point.forget()
    again = replace(point)  # computed anew
    np.testing.assert_allclose(again.z, point.z, rtol=1e-9, atol=1e-9 * np.abs(point.z).max())
