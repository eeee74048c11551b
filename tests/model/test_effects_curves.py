"""Free curves, laws that follow the load, and the trial motion along which effects of users are checked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.effect_pages.pictures import PLACE
from flexviz.model.effects import CURVES, EFFECTS, JointState, LoadedEffect, Terms, free_curve
from flexviz.model.effects.free_curve import BEND, GRID, NODES, SIZE, STAND_INS
from flexviz.model.effects.trial import TrialSignal
from tests.model.test_effects import LAW_EFFECTS, MOTION, VALUES


def rms(y: np.ndarray) -> float:
    return float(np.sqrt(np.mean(y**2)))


# -- laws that follow the load

LOADED = [e for e in (*EFFECTS.values(), *CURVES) if isinstance(e, LoadedEffect)]


@pytest.mark.parametrize("effect", LOADED, ids=lambda e: e.name)
def test_slope_with_the_load_feeds_back(effect: LoadedEffect) -> None:
    """s falls by u, and u with it: ∂u/∂s of what is recorded is g/(1 + g), on the link g."""
    values = 0.4 * effect.sizes() if effect.stopgap else np.array(VALUES[effect.name])
    if effect.stopgap:
        values[:2] = -20.0, 30.0  # constant beyond
    motion, h = MOTION.motions(0)[0], 1e-4
    up, down = (effect.law(replace(motion, torque=motion.torque + sign * h), values)[0] for sign in (1, -1))
    slope = (up - down) / (2 * h)
    wanted = slope / (1 + slope) if effect.where == "motor" else slope
    kinks = np.array([0.0, -20.0, 30.0])[:, None]
    smooth = (np.abs(motion.torque - kinks) > 2 * h).all(axis=0)
    found = effect.torque_slope(motion, values)
    np.testing.assert_allclose(found[smooth], wanted[smooth], rtol=1e-5, atol=1e-7)
    assert np.abs(found).max() > 0.01


@pytest.mark.parametrize("curve", (*CURVES, *STAND_INS), ids=lambda c: c.name)
def test_free_curve_is_smooth_small_and_constant_beyond_its_range(curve) -> None:
    rng = np.random.default_rng(4)
    torque, drawn = 30.0, rng.standard_normal((len(curve.branches), NODES))
    x = np.r_[9.0, 9.0, drawn.ravel()]
    bend = drawn[:, 2:] - 2 * drawn[:, 1:-1] + drawn[:, :-2]
    energy = np.sum(drawn**2) / (SIZE * torque) ** 2 + np.sum(bend**2) / (BEND * torque) ** 2
    assert x @ curve.precision(torque) @ x == pytest.approx(energy)
    reach = {"position": (-0.7312, 1.1), "velocity": (-2.51, 1.9), "load": (-31.2, 77.0), "time": (0.0, 9.97)}
    rounded = {"position": (-0.75, 1.1), "velocity": (0.0, 2.55), "load": (-35.0, 80.0), "time": (0.0, 10.0)}
    np.testing.assert_allclose(
        curve.constants(reach), rounded[curve.variable], atol=1e-9
    )  # to a twentieth of 10ⁿ
    assert (SIZE, BEND) == (0.1, 0.05)  # a tenth of the rms torque, nearly straight from node to node
    assert (NODES, GRID) == (24, 20.0)  # sessions and exported curves name every node
    values, (motion,) = curve.sizes(), MOTION.motions(0)
    low, high = values[:2] = (0.2, 0.7) if curve.variable != "load" else (-20.0, 30.0)
    seen = curve.value(motion)
    seen = np.abs(seen) if curve.variable == "velocity" else seen
    u = curve.law(motion, values)[0]
    forward = 0.5 * (
        1 + np.tanh((motion.link_velocity if curve.where == "link" else motion.velocity) / 0.005)
    )
    table = curve.fine(values)
    exact = [np.interp(np.clip(seen, low, high), table[0], side) for side in table[1]]
    both = exact[0] if curve.sides == 1 else forward * exact[0] + (1 - forward) * exact[1]
    np.testing.assert_allclose(u, both, atol=2e-3 * np.abs(u).max())
    assert (seen < low).any() and (seen > high).any()
    assert [len(side) for side in curve.node_parameters] == [NODES] * curve.sides
    assert [x[list(branch)].tolist() for branch in curve.branches] == drawn.tolist()
    assert curve.node_parameters[-1][-1].name.endswith(f"_{NODES}")
    ways = curve.name.endswith(("_direction", "_velocity"))  # one curve per direction of motion
    against = curve.name.endswith("_friction")  # the same curve in both, against the motion
    assert (curve.each_way, curve.opposes, curve.sides) == (ways, against, 1 + (ways or against))
    assert free_curve(curve.name) is curve and EFFECTS[curve.name] is curve
    assert curve.linear and curve.smooth == (curve.sides == 1)
    assert curve.state == (curve.where == "link" or curve.variable == "load")


@pytest.mark.parametrize("curve", [c for c in (*CURVES, *STAND_INS) if c.sides == 2], ids=lambda c: c.name)
def test_simulated_curve_follows_the_direction_of_its_own_side(curve) -> None:
    """A wound-up joint whose motor and link move in opposite directions."""
    values, x = curve.sizes(), 0.3
    table, torques = curve.fine(values)
    forward, backward = (np.interp(x, table, side) for side in torques)
    torque = curve.simulation(values)
    for way in (1.0, -1.0):
        motor, link = (way * x, -way * x) if curve.variable == "velocity" else (way, -way)
        own = link if curve.where == "link" else motor
        seen = torque(JointState(0.0, x, motor, x, link, 0.0))
        assert seen == pytest.approx(forward if own > 0 else backward, abs=1e-9)
    assert abs(forward - backward) > 1.0


# -- the trial motion itself


def test_trial_motion_is_consistent() -> None:
    """User-defined effects are checked along it: derivatives, the link side, and weights of a pendulum."""
    signal = TrialSignal(((0.6, 1.3, 0.2), (0.3, 3.1, 1.0)), constant=0.4, slope=0.7)
    t, h = np.linspace(0.0, 5.0, 7), 1e-4
    levels, up, down = signal.at(t, 4), signal.at(t + h, 4), signal.at(t - h, 4)
    np.testing.assert_allclose(levels[1:], (up - down)[:-1] / (2 * h), atol=1e-6)
    np.testing.assert_allclose(
        levels[0], 0.4 + 0.7 * t + 0.6 * np.sin(1.3 * t + 0.2) + 0.3 * np.sin(3.1 * t + 1)
    )
    np.testing.assert_allclose(signal.at(t, 1), levels[:1])
    s, theta, q = MOTION.torque.at(MOTION.time, 3), MOTION.theta(0), MOTION.link_state(0)
    np.testing.assert_allclose(MOTION.stiffness * (theta[:3] - q), s, atol=1e-9)
    (motion,) = MOTION.motions(0)
    assert motion.torque_scale == pytest.approx(rms(s[0]))
    np.testing.assert_array_equal(motion.link_velocity, q[1])
    assert MOTION.in_group("g1").all() and (MOTION.count(), MOTION.joints()) == (len(MOTION.time), 2)
    weight = -9.81 * MOTION.gravity_torque(2)  # of the arm, as that of the payload
    np.testing.assert_allclose(weight / MOTION.arm, MOTION.payload_torque("p1") / MOTION.payload, atol=1e-12)
    assert np.array_equal(MOTION.delayed_tau(0, 0.1)[0], MOTION.torque.at(MOTION.time - 0.1, 1)[0])
    parts = [np.stack((np.sin(MOTION.time), np.cos(MOTION.time)))]
    filtered = MOTION.filtered(parts, 0, 2)
    np.testing.assert_array_equal(filtered[:, 0], parts[0])
    np.testing.assert_allclose(filtered[0, 1, 1:-1], np.cos(MOTION.time)[1:-1], atol=1e-5)
    assert set(LAW_EFFECTS) <= set(EFFECTS) and isinstance(
        EFFECTS["base_tilt"].terms(MOTION, PLACE, np.zeros(2)), Terms
    )
