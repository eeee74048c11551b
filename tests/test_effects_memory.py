"""Friction with memory: the closed form against its recurrence, and what was before a record."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexviz.effects import EFFECTS, JointMotion, LawEffect
from flexviz.effects.presliding_hysteresis import dahl
from flexviz.identification import identify
from flexviz.measurements import MeasurementSet, read_set
from flexviz.simulation.sets import simulate_preset

TIME = np.linspace(0.0, 8.0, 4001)
_RANDOM = np.random.default_rng(3)
PATHS = {
    "swing": np.sin(2 * TIME) + 0.1 * np.sin(11 * TIME),
    "rest first": np.where(TIME < 1.0, 0.3, 0.3 + np.sin(2 * (TIME - 1.0))),
    "noise": 1e-4 * _RANDOM.standard_normal(len(TIME)),
    "stops and turns": 1e-3 * np.cumsum(_RANDOM.integers(-1, 2, len(TIME))),
    "still": np.full(20, 0.7),
    "two samples": np.array([0.0, -0.02]),
    "one sample": np.array([0.4]),
}


def recurrence(position: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """h and ∂h/∂ρ step by step, as the law says."""
    h, slope = [0.0], [0.0]
    for change in np.diff(position).tolist():
        fade, target, away = np.exp(-rate * abs(change)), np.sign(change), h[-1] - np.sign(change)
        slope.append(fade * slope[-1] - abs(change) * fade * away)
        h.append(target + away * fade)
    return np.array(h), np.array(slope)


@pytest.mark.parametrize("rate", [1e-3, 0.5, 30.0, 1e4, 1e9])
@pytest.mark.parametrize("name", PATHS)
def test_dahl_is_its_recurrence(name: str, rate: float) -> None:
    h, slope = dahl(PATHS[name], rate)
    wanted, wanted_slope = recurrence(PATHS[name], rate)
    np.testing.assert_allclose(h, wanted, rtol=0, atol=1e-12)
    # the recurrence itself loses digits at high rates: rounding of a position counts ρ times
    np.testing.assert_allclose(
        slope, wanted_slope, rtol=0, atol=1e-11 * max(np.abs(wanted_slope).max(), 1e-30)
    )


@pytest.mark.parametrize("values", [(200.0, 2.0), (5.0, 3.0), (4000.0, 0.4)])
def test_slopes_with_respect_to_both_parameters(values: tuple[float, float]) -> None:
    effect = EFFECTS["presliding_hysteresis"]
    assert isinstance(effect, LawEffect)
    path = PATHS["swing"]
    blank = np.zeros_like(path)
    motion = JointMotion(TIME, path, blank, blank, blank, blank, 1000.0, 1.0, 1.0)
    slopes = effect.law(motion, np.array(values))[1]
    for k in range(2):
        h = 1e-6 * values[k]
        up, down = np.array(values), np.array(values)
        up[k] += h
        down[k] -= h
        measured = (effect.law(motion, up)[0] - effect.law(motion, down)[0]) / (2 * h)
        np.testing.assert_allclose(slopes[k], measured, rtol=1e-6, atol=1e-7 * np.abs(measured).max())


def cut_at_reversals(measurements: MeasurementSet, after: float) -> MeasurementSet:
    """Every group from the first reversal of joint 1 after `after` [s] on: there its friction is wound up."""
    groups = []
    for group in measurements.groups:
        segment = group.segments[0]
        direction = np.sign(np.gradient(segment.theta[:, 0]))
        late = int(after / segment.step)
        first = late + int(np.flatnonzero(np.diff(direction[late:]))[0])
        time, theta, tau = segment.time[first:], segment.theta[first:], segment.tau[first:]
        cut = replace(segment, time=time, theta=theta, tau=tau)
        blank = {"q": None, "tau_joint": None, "theta_ref": None}
        groups.append(replace(group, segments=(cut,), time=time, **blank))
    return replace(measurements, groups=tuple(groups))


def test_record_that_starts_with_wound_up_friction(tmp_path: Path) -> None:
    hidden = "presliding_hysteresis:joint1:presliding_stiffness=60,coulomb=6"
    simulate_preset("planar-2r", tmp_path / "set", [hidden], seed=3)
    measurements = cut_at_reversals(read_set(tmp_path / "set"), 3.0)
    for refine in (False, True):
        result = identify(measurements, effects=["presliding_hysteresis:joint1"], refine=refine)
        exact = 1.0 if refine else 5.0
        assert result.residual.rms[0] < 3 * result.residual.noise_floor[0]
        assert result["link_viscous_friction", "joint1"].value == pytest.approx(1.0, rel=2e-3 * exact)
        assert result["presliding_hysteresis.coulomb", "joint1"].value == pytest.approx(6.0, rel=2e-4 * exact)
        stiffness = result["presliding_hysteresis.presliding_stiffness", "joint1"].value
        assert stiffness == pytest.approx(60.0, rel=2e-4 * exact)


def test_what_is_remembered_is_the_difference_of_two_beginnings() -> None:
    effect = EFFECTS["presliding_hysteresis"]
    assert isinstance(effect, LawEffect)
    values = np.array([40.0, 2.0])
    path, late = PATHS["swing"], 700
    blank = np.zeros_like(path)
    whole = JointMotion(TIME, path, blank, blank, blank, blank, 1000.0, 1.0, 1.0)
    part = replace(whole, time=TIME[late:], position=path[late:])
    missing = effect.law(whole, values)[0][late:] - effect.law(part, values)[0]
    unknown = effect.unknown(part, values)
    assert unknown.shape == (1, len(part.time))
    size = missing[0] / unknown[0, 0]
    assert 0.1 < abs(size) <= 3**0.5
    np.testing.assert_allclose(size * unknown[0], missing, atol=1e-12 * values[1])
