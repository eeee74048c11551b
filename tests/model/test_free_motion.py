"""The free motion of a joint from its goals, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexviz.model.servo import CASES, INDEX, DrivenMotion, absent, free_motion

STEP, COUNT = 0.01, 400


def motion(goal: np.ndarray, inertia: float = 0.03, load: float = 0.0) -> DrivenMotion:
    """One joint that starts at rest at zero, whose masses have only an inertia and a constant torque."""
    shape = (len(goal), 1, 1)
    zero = np.zeros(shape)
    return DrivenMotion(
        np.array([STEP]), np.ones(1), zero[:1], goal.reshape(shape), zero, zero + load, zero, zero + inertia,
        zero + load, np.zeros((1, 1)), np.ones(shape, bool), np.zeros(1, int), np.zeros(1, int),
    )  # fmt: skip


def angles(given: DrivenMotion, turn: float = 0.05, **values: float) -> np.ndarray:
    all_values = absent(1)
    for name, value in {"gain": 12.0, "motor_inertia": 0.02, "motor_viscous_friction": 0.4, **values}.items():
        all_values[INDEX[name]] = value
    return free_motion(given, all_values[:, None], turn)[0, :, 0, 0]


def oscillation(
    time: np.ndarray, gain: float = 12.0, inertia: float = 0.05, viscous: float = 0.4
) -> np.ndarray:
    """Answer to a unit step of J q̈ + f q̇ + k q = k."""
    decay, turn = viscous / (2 * inertia), np.sqrt(gain / inertia - (viscous / (2 * inertia)) ** 2)
    return 1 - np.exp(-decay * time) * (np.cos(turn * time) + decay / turn * np.sin(turn * time))


TIME = np.arange(COUNT) * STEP
STEPS = np.where(TIME < 0.5 * STEP, 0.0, 1.0)  # the goal before the record is its first one


def test_a_step_is_answered_as_by_an_oscillator() -> None:
    exact = oscillation(TIME)
    coarse, fine = (np.abs(angles(motion(np.ones(COUNT)), turn) - exact).max() for turn in (0.1, 0.05))
    assert fine < 5e-4 and coarse / fine == pytest.approx(4.0, rel=0.3)  # an error of second order


def test_a_load_bends_the_servo() -> None:
    settled = angles(motion(np.ones(COUNT), load=0.6))[-1]
    assert settled == pytest.approx(1 - 0.6 / 12.0, abs=1e-6)


def test_dry_friction_holds_a_joint_up_to_its_size() -> None:
    below = angles(motion(np.full(COUNT, 0.09)), **{"coulomb_friction.coulomb": 1.2})
    assert not below.any()  # 12 Nm/rad · .09 rad < 1.2 Nm
    above = angles(motion(np.full(COUNT, 0.5)), **{"coulomb_friction.coulomb": 1.2})
    assert above[-1] == above[-50] and abs(above[-1] - 0.5) <= 0.1  # it rests within ± f_c / kp


def test_load_dependent_friction_is_a_share_of_the_load() -> None:
    pushed = angles(motion(np.full(COUNT, 0.09), load=-0.5), **{"load_dependent_friction.coefficient": 3.5})
    assert not pushed.any()  # 12 · .09 + .5 < 3.5 · .5


def test_a_delay_is_a_shift_of_the_goal() -> None:
    late = angles(motion(STEPS), **{"goal_delay.delay": 0.05})
    at = TIME - STEP - 0.05
    exact = np.where(at > 0, oscillation(np.maximum(at, 0.0)), 0.0)
    assert late == pytest.approx(exact, abs=2e-3)


def test_a_speed_limit_makes_a_ramp_of_a_step() -> None:
    found = angles(motion(STEPS), **{"goal_speed_limit.speed": 0.5})
    ramp = angles(motion(np.clip(0.5 * (TIME - 0.5 * STEP), 0.0, 1.0)))
    assert found == pytest.approx(ramp, abs=1e-3)


def test_a_low_pass_smooths_the_goal() -> None:
    found = angles(motion(STEPS), **{"goal_lag.time_constant": 0.1})
    smooth = angles(motion(1 - np.exp(-np.maximum(TIME - 0.5 * STEP, 0.0) / 0.1)))
    assert found == pytest.approx(smooth, abs=2e-3)


def test_a_dead_band_leaves_the_joint_short_of_its_goal() -> None:
    found = angles(motion(np.ones(COUNT)), **{"dead_band.half_width": 0.02, "motor_viscous_friction": 3.0})
    assert found[-1] == pytest.approx(0.98, abs=1e-3)


def test_a_torque_limit_is_a_largest_acceleration() -> None:
    found = angles(
        motion(np.full(COUNT, 100.0)), **{"torque_limit.limit": 0.5, "motor_viscous_friction": 1e-9}
    )
    assert found == pytest.approx(0.5 * 0.5 / 0.05 * TIME**2, rel=1e-3, abs=1e-6)


def test_another_gain_of_a_group_counts() -> None:
    given = motion(np.ones(COUNT))
    doubled = DrivenMotion(
        given.step, 2 * given.scale, *(getattr(given, name) for name in list(vars(given))[2:])
    )
    assert angles(doubled) == pytest.approx(angles(given, gain=24.0), abs=1e-12)


def test_variants_do_not_see_each_other() -> None:
    given, values = motion(np.ones(COUNT)), np.repeat(absent(1)[:, None], 3, axis=1)
    values[INDEX["gain"], :, 0] = 6.0, 12.0, 24.0
    together = free_motion(given, values, 0.05)
    alone = free_motion(given, values[:, 1:2], 0.05)
    assert together[1] == pytest.approx(alone[0], abs=5e-4)  # steps are those of the stiffest of a batch


@pytest.mark.parametrize("name, value", [("goal_lag.time_constant", 0.05), ("goal_speed_limit.speed", 0.5)])
def test_a_joint_without_the_law_is_not_changed_by_another_ones(name: str, value: float) -> None:
    given, values = motion(np.sin(TIME)), np.repeat(absent(1)[:, None], 2, axis=1)
    values[INDEX["gain"]], values[INDEX["motor_inertia"]], values[INDEX["motor_viscous_friction"]] = (
        12,
        0.02,
        0.4,
    )
    values[INDEX[name], 1] = value
    together, alone = free_motion(given, values, 0.05)[0], free_motion(given, values[:, :1], 0.05)[0]
    assert together == pytest.approx(alone, abs=1e-12)


def test_goals_before_a_stretch_act_in_it() -> None:
    """A ramp that began long before: the low-pass is a time constant late from the first instant."""
    slope, late = 1.0, 0.08
    ahead = np.arange(-200, 0) * STEP * slope
    given = replace(motion(slope * TIME), before=ahead.reshape(-1, 1, 1), speed=np.full((1, 1), slope))
    with_lag = angles(given, **{"goal_lag.time_constant": late, "gain": 500.0})
    delayed = angles(given, **{"goal_delay.delay": late, "gain": 500.0})
    steady = slope * TIME - 0.4 * slope / 500.0 - slope * late  # viscous friction holds it back
    # the joint itself begins at zero, not where the goals have led it: it swings there
    tail = TIME > 1.0
    assert with_lag[tail] == pytest.approx(steady[tail] - 0.5 * STEP * slope, abs=2e-3)
    assert with_lag[:50] == pytest.approx(delayed[:50], abs=3e-3)


def test_driving_friction_is_load_dependent_friction_of_another_scale() -> None:
    """(1 + m) and (1 − l) times a load are 1 + c and 1 − c times it, by one factor of all torques."""
    given = replace(motion(0.5 * np.sin(3 * TIME), load=2.0), own=np.zeros((COUNT, 1, 1)))
    values = absent(1)
    sizes = {
        "gain": 30.0,
        "motor_inertia": 0.05,
        "motor_viscous_friction": 0.8,
        "coulomb_friction.coulomb": 0.1,
    }
    sizes |= {"driving_friction.motor_driving": 1.1, "driving_friction.load_driving": 0.1}
    for name, size in sizes.items():
        values[INDEX[name]] = size
    (alike,) = CASES.values()
    # without inertia of the links, all that is not scaled is the load: it acts as (1 + m) / 1.5 of the other
    assert alike(values)[INDEX["load_dependent_friction.coefficient"], 0] == pytest.approx(0.4)
    assert alike(values)[INDEX["gain"], 0] == pytest.approx(20.0)
    other = alike(values)
    for way in ("motor", "load"):
        other[INDEX[f"driving_friction.{way}_driving"]] = 0.0
    first, second = (free_motion(given, x[:, None], 0.05)[0] for x in (values, other))
    assert np.ptp(first) > 0.5 and second == pytest.approx(first, abs=2e-3)
