"""Parts of the equation by their formulas, to rounding: pulses, parts of records, wide-band motion, grids."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from flexviz.model.effects import EFFECTS, ChosenEffect, LawEffect, LinearEffect
from flexviz.model.equation import Equation, Layout, build_signals, pulses, reversal_nuisance
from flexviz.model.equation import fine_signals as module
from flexviz.model.equation.chain import Chain
from flexviz.model.equation.context import EffectContext
from flexviz.model.equation.fine_signals import FineBands, FineSignals, torque_band
from flexviz.model.equation.reversal_nuisance import _jumps, parts_of, undecided
from flexviz.model.observers import ButterworthZeroPhase
from flexviz.robot.robot import Robot
from tests.model.test_equation import made_up_set, point
from tests.model.test_equation_parts import moving, total
from tests.model.test_equation_truth import all_columns, at_the_truth

LATE = 4.0  # [s] start of a record


@pytest.mark.parametrize("length", [1, 3, 10, 200])
@pytest.mark.parametrize("where", ["first", "middle", "last"])
def test_instants_and_sizes_of_pulses(where: str, length: int) -> None:
    """Every 10 ms, from 5 ms before to 5 ms after, 30 at most, on the fine grid, within the record."""
    time = LATE + np.arange(1001) / 512.0  # exact in binary
    motion, count = replace(moving(np.zeros(1001)), time=time), len(time)
    a = {"first": 0, "middle": 400, "last": count - length}[where]
    region = np.zeros(count, bool)
    region[a : a + length] = True
    size = 2.0 + np.sin(np.arange(count))
    law: Any = SimpleNamespace(undecided=lambda *_: (region, size))
    times, sizes = undecided(law, motion, np.ones(1))
    ends = time[a] - 0.005, time[a + length - 1] + 0.005
    number = min(int(np.ceil(round((ends[1] - ends[0]) / 0.01, 9))) + 1, 30)
    grid = np.linspace(*ends, number)
    kept = grid[(grid > time[0]) & (grid < time[-1])]
    np.testing.assert_allclose(times, np.round(kept * 512) / 512, rtol=1e-12)
    np.testing.assert_allclose(sizes, 0.15 * size[a : a + length].max() * (grid[1] - grid[0]), rtol=1e-9)


@pytest.mark.parametrize("signal", ["velocity", "link_velocity", "torque"])
def test_where_a_law_is_between_both_sides_of_a_jump(signal: str) -> None:
    scale = 50.0 if signal == "torque" else 1.0

    class Law(LinearEffect):
        where, parameters = "motor", ()

        def columns(self, motion: Any) -> np.ndarray:
            return np.tanh(getattr(motion, signal) / (0.03 * scale))[None]

    values = 0.1 * np.sin(np.arange(2000) / 77.0)
    motion = replace(moving(np.zeros(2000)), torque_scale=50.0, **{signal: scale * values})
    region, size = _jumps(Law(), motion, np.array([3.0]))
    here, up, down = (3 * np.tanh((values + change) / 0.03) for change in (0.0, 0.02, -0.02))
    steep = up - down > 0.5 * np.abs(here).max()
    between = np.minimum(up - here, here - down) > 0.01 * (up - down)
    np.testing.assert_array_equal(region, steep & between)
    np.testing.assert_allclose(size, np.where(steep, up - down, 0.0))
    assert 0.1 < region.mean() < 0.9
    none, zero = _jumps(Law(), motion, np.zeros(1))
    assert not none.any() and not zero.any()


# the last stretch is short: whole in the first case, and over before the pulses in the second
@pytest.mark.parametrize(
    ("limits", "blocks"), [({"LONGEST": 3.0, "PART": 1.5}, {0, 1, 2}), ({"MOST": 300}, {0, 1})]
)
def test_parts_of_a_record_have_the_pulses_that_reach_them(
    monkeypatch: pytest.MonkeyPatch, limits: dict[str, float], blocks: set[int]
) -> None:
    """Of 0.4 s either side, led up to by 1 s; together those of the whole, each effect its own."""
    hidden: Any = {("coulomb_friction", 0): (2.0,), ("coulomb_friction", 1): (3.0,)}
    equation, x = at_the_truth(hidden | {("payload_error", None): (0.1,)}, 8.0, 0.8)
    point, chain = equation.at(x), total(equation, x)
    start = equation.signals.time[0]
    times, sizes = start + np.arange(0.0, 3.2, 0.01), 1.0 + np.arange(320) % 5
    monkeypatch.setattr(reversal_nuisance, "undecided", lambda *_: (times, sizes))
    monkeypatch.setattr(reversal_nuisance, "MOST", 2 * len(times))
    whole = {one.block: one for one in pulses(point, x, point.link_terms(x))}
    for name, value in limits.items():
        monkeypatch.setattr(reversal_nuisance, name, value)
    found = pulses(point, x, point.link_terms(x))
    assert {one.block for one in found} == blocks and len(whole) == 3
    for index, block in enumerate(equation.signals.blocks):
        time = equation.signals.time[block.rows]
        step, columns = time[1] - time[0], all_columns(whole[index])
        motion = point.context.motions(0)[index]
        at = np.searchsorted(motion.time, times)
        for joint, own in enumerate((columns[:, :, :320], columns[:, :, 320:])):
            u = point.context.pulses_block(index, at, joint, 3) * (sizes / motion.step)[:, None, None]
            direct = chain.rows(block.rows).column("torque", (joint,), u[5][:, :, None])
            np.testing.assert_allclose(own[:, :, 5], direct, rtol=1e-9)
        for one in (p for p in found if p.block == index):
            if one.rows.stop - one.rows.start == len(time):
                continue  # a short stretch stays whole
            near = (times > time[one.rows.start] - 0.4) & (times < time[one.rows.stop - 1] + 0.4)
            begin = max(one.rows.start - int(np.ceil(1.0 / step)), 0)
            assert near.any() and min(group.first for group in one.groups) >= begin
            both = np.concatenate((near, near))
            exact = columns[begin : one.rows.stop][:, :, both]
            np.testing.assert_allclose(all_columns(one, begin), exact, rtol=1e-9)
            for joint in range(2):
                own = columns[one.rows, joint][:, both]
                np.testing.assert_allclose(one.dense(joint), own, rtol=1e-9)
        last = max((p.rows.start for p in found if p.block == index), default=0)
        assert last == 0 or time[last] < times[-1] + 0.4  # none where no pulse reaches


@pytest.mark.parametrize(("stiffness", "starts"), [(40.0, 1), (4.0, 2), (4e-4, 3)])
def test_a_state_is_unknown_as_long_as_it_lasts(
    monkeypatch: pytest.MonkeyPatch, stiffness: float, starts: int
) -> None:
    """Of a long stretch taken apart, those parts have a column that it reaches before motion wipes it out."""
    plain, x = at_the_truth({}, 8.0, 0.8)
    layout = Layout(plain.layout.joints, (ChosenEffect("presliding_hysteresis", 0),))
    equation, x = Equation(plain.robot, plain.signals, layout), np.r_[x, stiffness, 2.0]
    monkeypatch.setattr(reversal_nuisance, "LONGEST", 3.0)
    monkeypatch.setattr(reversal_nuisance, "PART", 2.0)
    monkeypatch.setattr(reversal_nuisance, "undecided", lambda *_: (np.zeros(0), np.zeros(0)))
    found = pulses(equation.at(x), x, equation.at(x).link_terms(x))
    parts = [parts_of(plain.signals.time[block.rows])[:starts] for block in plain.signals.blocks]
    assert [(p.block, p.rows, p.count) for p in found] == [(k, p, 1) for k in range(3) for p in parts[k]]


def own_friction(equation: Equation, x: np.ndarray, motion: Any, joint: int) -> np.ndarray:
    out = np.zeros(len(motion.time))
    for effect, where in equation.layout.effect_slices():
        law = EFFECTS[effect.effect]
        if isinstance(law, LawEffect) and law.entry == "torque" and effect.joint == joint:
            out += law.law(motion, x[where])[0]
    return out


@pytest.mark.parametrize("sharp", [False, True])
@pytest.mark.parametrize("friction", [False, True])
def test_wide_band_motion_with_the_torque_of_the_equation(friction: bool, sharp: bool) -> None:
    """s of the equation where it is known, if sharp as a difference in its band; else wide-band torque."""
    hidden: Any = {("cable_spring", 0): (3.0, 0.2), ("stiffness_hardening", 0): (2e4,)}
    hidden |= {("quadratic_friction", 0): (3.0,)} if friction else {}
    equation, x = at_the_truth(hidden, 14.0, 1.2)
    lay, signals = equation.layout, replace(equation.signals, sharp=sharp)
    shared: dict[object, Any] = {"noise": (np.full(2, 2e-6), np.full(2, 2e-5))}
    seen = Equation(equation.robot, signals, lay, shared).at(x).context
    bare = EffectContext(equation.link, signals, lay, shared, x, np.zeros((3, signals.count, 2)))
    c, b, viscous = (x[where][0] for where in (lay.compliance, lay.motor_inertia, lay.motor_viscous))
    torques = []
    for block, fine, base, motion in zip(
        signals.blocks, bare.fine(), bare.motions(0), seen.motions(0), strict=True
    ):
        assert len(fine.theta) == 4 and len(fine.tau) == 2
        theta, tau = fine.theta[:, :, 0], fine.tau[:, :, 0]
        torque, rate = (tau[k] - b * theta[k + 2] - viscous * theta[k + 1] for k in (0, 1))
        np.testing.assert_allclose(base.torque, torque, rtol=1e-9)
        np.testing.assert_allclose(base.link_position, fine.position[:, 0] - c * torque, rtol=1e-9)
        np.testing.assert_allclose(base.link_velocity, fine.velocity[:, 0] - c * rate, rtol=1e-9)
        if friction:
            band = ButterworthZeroPhase(2 * np.pi * float(fine.torque_hertz[0]))
            slow = band.derivatives(own_friction(equation, x, base, 0)[:, None], fine.step, 2)[:, :, 0]
            torque, rate = torque - slow[0], rate - slow[1]
        assert seen.s is not None
        slow = signals.observer.derivatives(torque[:, None], fine.step, 1)[0, :, 0]
        time = signals.time[block.rows]
        at = np.searchsorted(fine.time, time - 1e-9)
        known = CubicSpline(time, seen.s[block.rows, 0] - (slow[at] if sharp else 0.0))
        inside = (motion.time > time[0] - 1e-9) & (motion.time < time[-1] + 1e-9)
        first, last = np.flatnonzero(inside)[[0, -1]]
        near = round(0.2 / fine.step)
        gap = known(motion.time[inside]) - (0.0 if sharp else torque[inside])
        torque[:first] += np.median(gap[:near])
        torque[last + 1 :] += np.median(gap[-near:])
        torque[inside] += gap
        rate[inside] = known(motion.time[inside], 1) + (rate[inside] if sharp else 0.0)
        close = 1e-7 * np.abs(torque).max() if friction else 1e-10
        np.testing.assert_allclose(motion.torque, torque, atol=close)
        np.testing.assert_allclose(motion.link_position, motion.position - c * motion.torque, rtol=1e-9)
        np.testing.assert_allclose(motion.link_velocity, motion.velocity - c * rate, atol=1e-6)
        torques.append(motion.torque)
    scale = np.sqrt(np.mean(np.concatenate(torques) ** 2))
    assert [m.torque_scale for m in seen.motions(0)] == pytest.approx([scale] * 3)


def test_masses_are_felt_along_the_tilted_gravity() -> None:
    """∂r/∂Γ of a robot on a tilted base, by finite differences of the residual."""
    equation, x = at_the_truth({("base_tilt", None): (0.3, -0.2)}, 8.0, 1.2)
    point = equation.at(x)
    jacobian, steps = point.evaluate(x).jacobian, 1e-4 * np.eye(len(x))
    for k in range(equation.layout.compliance.start):
        change = (point.residual(x + steps[k]) - point.residual(x - steps[k])) / 2e-4
        np.testing.assert_allclose(jacobian[:, :, k], change, atol=1e-6 * max(1.0, np.abs(change).max()))
    level = x.copy()
    level[equation.layout.effect_start :] = 0.0
    assert np.abs(point.residual(x)).max() < 0.05 * np.abs(point.residual(level)).max()
    ((_, term),) = point.terms(x)  # what a design of experiments sees of it
    np.testing.assert_allclose(term.value[0], point.residual(level) - point.residual(x), atol=1e-9)


def test_coarser_grids_fold_nothing_into_the_band() -> None:
    robot = Robot.load("robots:planar_2r")
    measurements = made_up_set(robot, "link2", seconds=9.0)
    observer = ButterworthZeroPhase(2 * np.pi * 2)
    signals = build_signals(measurements, measurements.groups, observer, sample_step=0.048)
    layout = Layout(robot.joints)
    context = Equation(robot, signals, layout).at(point(layout, robot)).context
    block, fine = signals.blocks[0], context.fine()[0]
    many = round(block.stride * block.segment.step / fine.step)
    assert many == 24
    chosen = set()
    for depth in (1, 2, 3):
        band = observer.cutoff(depth - 1)
        for highest in np.geomspace(20.0, 2000.0, 12):
            fits = [d for d in range(1, 25) if 24 % d == 0 and 2 * np.pi / (d * fine.step) >= band + highest]
            assert context.decimation(0, depth, highest) == [max(fits, default=1)] * 2
            chosen.add(max(fits, default=1))
    assert len(chosen) > 4


def test_the_torque_band_has_limits() -> None:
    def band(noise: float, limit: float) -> float:
        one = np.ones(1)
        return float(torque_band(0 * one, noise * one, one, 1e9 * one, 40 * one, limit)[0])

    assert band(1.0, 150.0) == 2.0 and band(1e-9, 150.0) == pytest.approx(150.0, rel=1e-12)
    assert band(1e-9, 1.5) == 1.5
    low = 0.2 / np.sqrt(2 * 2.5)  # torque noise that is 0.5 % of 40 Nm up to 2.5 Hz
    assert 2.3 < band(low, 150.0) <= 2.5
    assert band(low, 2.4) == pytest.approx(2.4)


def test_signals_of_few_bands_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of long records as many as fit, at least one, whatever cache they are in; the oldest go first."""

    def made(*_: Any) -> FineSignals:
        shapes = (10, 2), (10, 2), (4, 10, 2), (2, 10, 2)
        position, velocity, theta, tau = (np.zeros(shape) for shape in shapes)
        return FineSignals(np.zeros(10), 2e-3, position, velocity, theta, tau, np.zeros(2))

    monkeypatch.setattr(module, "_filtered", made)
    signals: Any = SimpleNamespace(blocks=(None, None), torque_hold=0.0)
    size = 2 * 8 * 10 * 2 * 8  # two stretches of 8 series of 10 samples, 2 joints, 8 bytes
    monkeypatch.setattr(module, "KEPT", 4)
    for most, left in ((1e8, 4), (3.5 * size, 3), (1.5 * size, 1), (0.5 * size, 1)):
        monkeypatch.setattr(module, "KEPT_BYTES", most)
        caches: list[dict[object, Any]] = [{}, {}]
        for k in range(8):
            bands = FineBands(("fine", k), [np.ones(2)] * 2, [np.ones(2)] * 2)
            new = module.fine_signals(signals, bands, caches[k % 2])
            assert len(new) == 2 and module.fine_signals(signals, bands, caches[k % 2]) is new
        kept = [k for k in range(8) if caches[k % 2][("fine", k)]._part is not None]
        assert kept == list(range(8 - left, 8))


def test_place_of_an_effect_beside_others() -> None:
    """Chain: what enters as torque, deflection or residual, at several joints at once."""
    rng = np.random.default_rng(3)
    link: Any = SimpleNamespace(**{name: rng.standard_normal((6, 2, 2)) for name in ("dq", "dv", "mass")})
    c, damping = rng.uniform(1, 2, 2), rng.uniform(1, 2, 2)
    u = rng.standard_normal((3, 6, 2))
    chain = Chain(c, damping, link)
    levels = (link.dq, link.dv + np.diag(damping), link.mass)

    def moved(q: np.ndarray) -> np.ndarray:
        return np.sum([m @ q[k][:, :, None] for k, m in enumerate(levels)], axis=0)[:, :, 0]

    np.testing.assert_allclose(chain.column("deflection", (0, 1), u), -moved(u))
    np.testing.assert_allclose(chain.column("torque", (0, 1), u), -moved(c * u) - u[0])
    np.testing.assert_allclose(chain.column("residual", (0, 1), u), -u[0])
    np.testing.assert_allclose(
        chain.rows(slice(2, 5)).column("torque", (1, 0), u[:, 2:5, ::-1]),
        chain.column("torque", (0, 1), u)[2:5],
    )


def test_what_is_offered_to_effects_that_ask_for_nothing() -> None:
    """q = θ − (τ − Bθ̈ − f_mv θ̇)/K with two derivatives; motions of an earlier point if they are the same."""
    equation, x = at_the_truth({("torque_offset", 1): (2.0,)}, 8.0, 1.2)
    lay, signals = equation.layout, equation.signals
    first = equation.at(x).context
    assert len(signals.theta) == 5 and len(signals.tau) == 3 and first.delayed_tau(0, 0.001).shape[0] == 4
    for j in (0, 1):
        theta, tau = signals.theta[:, :, j], signals.tau[:, :, j]
        c, b, viscous = (x[where][j] for where in (lay.compliance, lay.motor_inertia, lay.motor_viscous))
        torque = np.array([tau[k] - b * theta[k + 2] - viscous * theta[k + 1] for k in range(3)])
        np.testing.assert_allclose(first.link_state(j), theta[:3] - c * torque, rtol=1e-9, atol=1e-12)
    motions = first.motions(0)
    same, other = (first.seeing(x, first._q, None) for _ in range(2))
    loaded = first.seeing(x, first._q, signals.tau[0])
    same.take_motions(first)
    assert same.motions(0) is motions
    loaded.take_motions(first)
    assert loaded.motions(0) is not motions
    other._bands = replace(first._bands, key=("fine", "others")) if first._bands else None
    other.take_motions(first)
    assert other.motions(0) is not motions
    empty = first.seeing(x, first._q, None)
    empty.take_motions(same.seeing(x, first._q, None))  # which has none
    assert empty.motions(0) is not motions


def test_the_torque_that_is_typical_limits_the_band() -> None:
    """0.5 % of the rms torque of each joint, whose noise is told."""
    equation, _ = at_the_truth({}, 8.0, 1.2)
    signals, one = equation.signals, np.ones(2)
    rms = np.sqrt(np.mean(np.square(signals.tau[0]), axis=0))
    step = signals.blocks[0].segment.step
    noise = 5e-3 * rms / np.sqrt(2 * 20.0 * step)  # that of s reaches it at 20 Hz
    bands = module.fine_bands(signals, one, 1e9 * one, {"noise": (0 * one, noise)})
    for found in bands.narrow:
        assert (found <= 20.0).all() and (found > 18.0).all()
