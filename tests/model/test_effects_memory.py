"""Friction with memory: the closed form against its recurrence, and what was before a record."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexviz.analysis.identification import identify
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS, JointMotion, JointState, LawEffect
from flexviz.model.effects.presliding_hysteresis import dahl
from flexviz.model.effects.startup_friction import worn_off
from flexviz.model.simulation.laws import BreakAway
from tests.planar_arm import planar_set

TIME = np.linspace(0.0, 8.0, 4001)
_RANDOM = np.random.default_rng(3)
PATHS: dict[str, np.ndarray] = {
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


def moving(path: np.ndarray, velocity: np.ndarray | None = None) -> JointMotion:
    """A motion of which only the motor side is known."""
    blank = np.zeros_like(path)
    return JointMotion(
        TIME, path, blank if velocity is None else velocity, blank, blank, blank, 1000.0, 1.0, 1.0
    )


STARTS: dict[
    str, np.ndarray
] = {  # there, a pause, and back, at two speeds; a swing without a pause; creeping
    "moves": 0.3 * (np.clip(TIME - 1, 0, 1) - np.clip(TIME - 3, 0, 2) / 2) ** 2,
    "swing": 0.4 * np.sin(2 * TIME),
    "creeping": 0.004 * TIME + 0.002 * np.sin(3 * TIME),
}


@pytest.mark.parametrize("angle", [0.003, 0.02, 0.2])
@pytest.mark.parametrize("name", STARTS)
def test_startup_friction_follows_the_simulators_state(name: str, angle: float) -> None:
    path, law = np.asarray(STARTS[name], np.float64), BreakAway(2.0, angle)
    step, worn, states = float(TIME[1] - TIME[0]), 0.0, [0.0]
    for speed in (np.diff(path) / step).tolist():
        for _ in range(20):  # Euler's midpoint rule on a fine grid
            at = JointState(0.0, 0.0, speed, 0.0, 0.0, 0.0, (worn,))
            half = worn + 0.5 * step / 20 * law.pull(at).rates[0]
            worn += step / 20 * law.pull(at._replace(z=(half,))).rates[0]
        states.append(worn)
    np.testing.assert_allclose(worn_off(path, step, angle)[0], states, atol=1e-4)
    effect, velocity = EFFECTS["startup_friction"], np.gradient(path, step)
    assert isinstance(effect, LawEffect)
    torques = [
        law.pull(JointState(0.0, 0.0, v, 0.0, 0.0, 0.0, (y,))).motor
        for v, y in zip(velocity.tolist(), states, strict=True)
    ]
    u = effect.law(moving(path, velocity), np.array([2.0, angle]))[0]
    np.testing.assert_allclose(u, torques, atol=3e-4)


def test_only_a_rest_restores_startup_friction() -> None:
    still = np.zeros(500)
    there = 0.5 * np.arange(1, 401) * 2e-3  # 0.5 rad/s
    path = np.concatenate((still, there, there[-1] + still, there[-1] - there, there), dtype=np.float64)
    worn = worn_off(path, 2e-3, 0.02)[0]
    starts, reversal = (500, 1400), 1800
    for start in starts:
        gone = np.abs(path[start : start + 300] - path[start - 1])
        np.testing.assert_allclose(1 - worn[start : start + 300], np.exp(-gone / 0.02), atol=1e-4)
    assert (worn[reversal - 5 : reversal + 300] > 0.999).all()


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("presliding_hysteresis", (200.0, 2.0)),
        ("presliding_hysteresis", (5.0, 3.0)),
        ("presliding_hysteresis", (4000.0, 0.4)),
        ("startup_friction", (2.0, 0.003)),
        ("startup_friction", (0.5, 0.2)),
    ],
)
def test_slopes_with_respect_to_both_parameters(name: str, values: tuple[float, float]) -> None:
    effect = EFFECTS[name]
    assert isinstance(effect, LawEffect)
    path = PATHS["swing"] if name == "presliding_hysteresis" else STARTS["moves"]
    motion = moving(path, np.gradient(path, TIME[1]))
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


@pytest.mark.slow
def test_record_that_starts_with_wound_up_friction(tmp_path: Path) -> None:
    hidden = "presliding_hysteresis:joint1:presliding_stiffness=60,coulomb=6"
    measurements = cut_at_reversals(planar_set(tmp_path / "set", [hidden], seed=3, duration=12.0), 3.0)
    for refine in (False, True):
        result = identify(measurements, effects=["presliding_hysteresis:joint1"], refine=refine)
        exact = 1.0 if refine else 5.0
        assert result.residual.rms[0] < 3 * result.residual.noise_floor[0]
        assert result["link_viscous_friction", "joint1"].value == pytest.approx(1.0, rel=2e-3 * exact)
        assert result["presliding_hysteresis.coulomb", "joint1"].value == pytest.approx(6.0, rel=2e-4 * exact)
        stiffness = result["presliding_hysteresis.presliding_stiffness", "joint1"].value
        assert stiffness == pytest.approx(60.0, rel=2e-4 * exact)


@pytest.mark.parametrize(
    ("name", "values", "late"),
    [("presliding_hysteresis", (40.0, 2.0), 700), ("startup_friction", (2.0, 0.4), 300)],
)
def test_what_is_remembered_is_the_difference_of_two_beginnings(
    name: str, values: tuple[float, float], late: int
) -> None:
    effect, p = EFFECTS[name], np.array(values)
    assert isinstance(effect, LawEffect)
    whole = moving(PATHS["swing"], np.gradient(PATHS["swing"], TIME[1]))
    part = replace(whole, time=TIME[late:], position=whole.position[late:], velocity=whole.velocity[late:])
    missing = effect.law(whole, p)[0][late:] - effect.law(part, p)[0]
    unknown = effect.unknown(part, p)
    assert unknown.shape == (1, len(part.time))
    size = missing[0] / unknown[0, 0]
    assert 0.1 < abs(size) <= 3**0.5
    np.testing.assert_allclose(size * unknown[0], missing, atol=1e-12 * p.max())
