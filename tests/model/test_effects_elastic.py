"""Hardening and damping on one joint: the exact law, not the sum of two small corrections."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexviz.analysis.diagnosis.fit_context import FitContext
from flexviz.analysis.identification import identify
from flexviz.data.measurements import read_set
from flexviz.model.effects import EFFECTS, JointMotion, LawEffect
from flexviz.model.effects.elastic_joint import DampedSpring, hardened
from flexviz.model.equation import layout_of
from flexviz.model.simulation import make_plan, simulate_plan, write_plan
from flexviz.model.simulation.laws import ElasticJoint
from flexviz.robot.model import EffectValue
from tests.planar_arm import of_groups, planar_set

STIFFNESS, COUNT, STEP = 1500.0, 4000, 2e-3
TIME = np.linspace(STEP / 2, (COUNT - 0.5) * STEP, COUNT)  # whole half-waves: even about both ends


def deflection_of(size: float) -> tuple[np.ndarray, np.ndarray]:
    """A deflection and its rate whose law mirrors at both ends."""
    x, rate = np.zeros(COUNT), np.zeros(COUNT)
    for share, waves in ((0.6, 10), (0.3, 37), (0.1, 80)):
        omega = np.pi * waves / (COUNT * STEP)
        x += size * share * np.cos(omega * TIME)
        rate -= size * share * omega * np.sin(omega * TIME)
    return x, rate


def motion(torque: np.ndarray, **present: tuple[float, ...]) -> JointMotion:
    blank = np.zeros(COUNT)
    scale = float(np.sqrt(np.mean(torque**2)))
    return JointMotion(TIME, blank, blank, torque, blank, blank, STIFFNESS, 1.0, scale, present)


def law(name: str) -> LawEffect:
    effect = EFFECTS[name]
    assert isinstance(effect, LawEffect)
    return effect


@pytest.mark.parametrize("hardening", [0.05, 0.3, 2.0])  # of the torque at the largest deflection
@pytest.mark.parametrize("seconds", [0.002, 0.01])  # D/K
def test_both_together_are_the_simulators_law(hardening: float, seconds: float) -> None:
    cubic, damping = hardening * STIFFNESS / 0.02**2, seconds * STIFFNESS
    x, rate = deflection_of(0.02)
    joint = ElasticJoint(STIFFNESS, cubic=cubic, damping=damping)
    torque = np.array([joint.torque(a, 0.0, b, 0.0) for a, b in zip(x, rate, strict=True)])
    present = {"stiffness_hardening": (cubic,), "joint_damping": (damping,)}
    seen = motion(torque, **present)
    u = law("stiffness_hardening").law(seen, np.array([cubic]))[0]
    u = u + law("joint_damping").law(seen, np.array([damping]))[0]
    inner = slice(200, -200)  # the law is causal, so its own past at the first sample is not the mirrored one
    np.testing.assert_allclose((torque / STIFFNESS - u)[inner], x[inner], atol=1e-6 * 0.02)
    # what each does alone does not add up to that
    alone = sum(law(n).law(motion(torque), np.array(v))[0] for n, v in present.items())
    assert np.abs((u - alone)[inner]).max() > 1e-3 * np.abs(u).max()


def test_slopes_beside_each_other() -> None:
    torque = 40.0 * np.cos(2.0 * TIME) + 15.0 * np.sin(9.0 * TIME)
    present = {"stiffness_hardening": (9e5,), "joint_damping": (12.0,)}
    for name, (size,) in present.items():
        seen = motion(torque, **present)
        slope = law(name).law(seen, np.array([size]))[1][0]
        up, down = (law(name).law(seen, np.array([size * s]))[0] for s in (1 + 1e-4, 1 - 1e-4))
        np.testing.assert_allclose(
            slope, (up - down) / (2e-4 * size), rtol=1e-5, atol=1e-6 * np.abs(slope).max()
        )


def test_torque_goes_on_at_the_ends_of_what_the_equation_knows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beyond them friction is taken off, too: a step there is one that a damped joint would answer to."""
    plan = of_groups(make_plan("planar-2r"))
    friction = EffectValue("coulomb_friction", "joint2", {"coulomb": 6.0})
    effects = (friction, EffectValue("joint_damping", "joint2", {"damping": 8.0}))
    plan = replace(plan, model=replace(plan.model, effects=effects))
    runs = simulate_plan(plan)
    measurements = read_set(write_plan(plan, runs, tmp_path / "set"))
    layout = layout_of(measurements, [e.text for e in effects])
    refinement = FitContext(measurements, layout).two_band.with_layout(layout)
    wide = refinement.wide
    coulomb, scales = law("coulomb_friction"), []
    plain = coulomb.law

    def spied(seen: JointMotion, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        scales.append(seen.torque_scale)
        return plain(seen, values)

    monkeypatch.setattr(coulomb, "law", spied)
    seen = wide.at(layout.vector(plan.model))
    rms = np.sqrt(np.mean(wide.signals.tau[0, :, 1] ** 2))
    assert scales and all(0.5 * rms < s < 2 * rms for s in scales)  # laws may divide by it
    for made, block in zip(seen.context.motions(1), refinement.blocks, strict=True):
        run = runs[wide.signals.groups[block.group].name]
        exact = np.interp(made.time, run.time, run.tau_joint[:, 1])
        time = wide.signals.time[block.rows]
        begin, end = np.searchsorted(made.time, [time[0], time[-1]])
        for edge in (begin, end):
            around = made.torque[edge - 3 : edge + 4]
            assert np.abs(np.diff(around)).max() < 1.0  # Nm; the friction is 6 Nm
        near = np.abs(made.time[:, None] - [time[0], time[-1]]).min(axis=1) < 0.2
        beyond = near & ((made.time < time[0]) | (made.time > time[-1]))
        assert beyond.sum() > 100
        assert np.sqrt(np.mean((made.torque - exact)[beyond] ** 2)) < 0.6


def test_notes_do_not_outlive_their_motion() -> None:
    torque = 40.0 * np.cos(2.0 * TIME)
    present = {"stiffness_hardening": (9e5,), "joint_damping": (12.0,)}
    seen = motion(torque, **present)
    first = law("stiffness_hardening").law(seen, np.array([9e5]))[0]
    assert seen.notes and not replace(seen, torque=2 * torque).notes
    again = law("stiffness_hardening").law(replace(seen, torque=torque), np.array([9e5]))[0]
    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize("cubic", [0.0, 1e-20, 1.0, 1e6, 1e12])
def test_hardened_spring_in_closed_form(cubic: float) -> None:
    torque = np.array([-300.0, -1e-3, 0.0, 1e-9, 2.0, 500.0])
    x = hardened(torque, STIFFNESS, cubic)
    np.testing.assert_allclose(STIFFNESS * x + cubic * x**3, torque, rtol=1e-11, atol=1e-300)
    joint = DampedSpring(torque, STEP, STIFFNESS, cubic, 0.0)
    np.testing.assert_array_equal(joint.deflection, x)


@pytest.mark.slow
def test_both_are_identified_on_one_joint(tmp_path: Path) -> None:
    hidden = ["stiffness_hardening:joint1:cubic_stiffness=256000", "joint_damping:joint1:damping=8"]
    wanted = ["stiffness_hardening:joint1", "joint_damping:joint1"]
    measurements = planar_set(tmp_path / "set", hidden, seed=3, start="moving")
    result = identify(measurements, effects=wanted, bandwidth=2 * np.pi * 5, refine=True)
    assert result["stiffness_hardening.cubic_stiffness", "joint1"].value == pytest.approx(256e3, rel=3e-3)
    assert result["joint_damping.damping", "joint1"].value == pytest.approx(8.0, rel=3e-3)
    assert result["stiffness", "joint1"].value == pytest.approx(1000.0, rel=1e-3)


@pytest.mark.parametrize("seconds", [0.02, 0.04, 0.08])
@pytest.mark.parametrize("steady", [1.0, 0.6, 0.2])
@pytest.mark.parametrize("towards", [1.0, -1.0])
def test_a_gap_is_crossed_in_free_flight(seconds: float, steady: float, towards: float) -> None:
    """The spring unwinds, motor and link accelerate apart, and the other flank stops them."""
    b, stiffness = 5e-3, 700.0
    speed = steady * 2 * b / seconds  # with which a flank is left; acceleration does the rest
    acceleration = (1 - steady) * 4 * b / seconds**2
    inside = np.clip(TIME - 4.0, 0.0, seconds)
    truth = -towards * b + towards * (speed * inside + 0.5 * acceleration * inside**2)
    unwound, wound = (np.clip(away, 0.0, 0.02) for away in (4.0 - TIME, TIME - 4.0 - seconds))
    torque = -towards * stiffness * (speed * unwound - (speed + acceleration * seconds) * wound)
    seen = replace(motion(torque), stiffness=stiffness, present={"backlash": (b,)})
    u, slope = law("backlash").law(seen, np.array([b]))
    # the flank counts as reached when the torque is an eighth of the largest one near by
    late = 0.12 * 0.02 + 2 * STEP
    assert np.max(np.abs(u + truth)) < late * (speed + acceleration * seconds)
    np.testing.assert_array_equal(u, b * slope[0])
    evenly = law("backlash").law(replace(seen, present={}), np.array([b]))[0]
    if seconds == 0.08 and steady < 1:
        assert np.sum((u + truth) ** 2) < 0.5 * np.sum((evenly + truth) ** 2)
    undecided = law("backlash").undecided(seen, np.array([b]))
    assert undecided is not None
    assert undecided[0][(inside > STEP) & (inside < seconds - STEP)].all()
    assert not undecided[0][(unwound == 0.02) | (wound > 0.01)].any()


@pytest.mark.parametrize("torque, flank", [(0.0, 0.0), (5.0, 1.0), (-5.0, -1.0)])
def test_a_load_that_never_changes_sign_stays_on_its_flank(torque: float, flank: float) -> None:
    u, slope = law("backlash").law(motion(np.full_like(TIME, torque)), np.array([1e-3]))
    np.testing.assert_array_equal(u, -1e-3 * flank)
    np.testing.assert_array_equal(slope, -flank)


@pytest.mark.parametrize("ringing", [0.0, 1.0])
def test_a_torque_that_jumps_over_a_gap_is_on_either_flank(ringing: float) -> None:
    torque = 40 * np.sign(TIME - 4.0) + ringing * np.sin(2 * np.pi * 20 * (TIME - 4.0))
    seen = replace(motion(torque), present={"backlash": (1e-3,)})
    u = law("backlash").law(seen, np.array([1e-3]))[0]
    away = np.abs(TIME - 4.0) > 2 * STEP
    np.testing.assert_array_equal(u[away], -1e-3 * np.sign(TIME - 4.0)[away])
