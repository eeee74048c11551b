"""Parts of the equation in closed form: unknown friction at reversals and at the start, bands, layout."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from flexviz.base.errors import InputError
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS, ChosenEffect, JointMotion, LawEffect, LinearEffect
from flexviz.model.equation import Equation, Layout, build_signals, layout_of, pulses
from flexviz.model.equation.chain import Chain
from flexviz.model.equation.fine_signals import (
    LINK_VELOCITY_NOISE,
    TORQUE_NOISE,
    _sign_band,
    fine_bands,
    fine_signals,
    torque_band,
)
from flexviz.model.equation.initial_state import RIDGE, initial_states
from flexviz.model.equation.motions import _ends
from flexviz.model.equation.reversal_nuisance import parts_of, undecided
from flexviz.model.observers import FlatZeroPhase, make_observer
from tests.model.test_equation_truth import HOLD, LINK_VISCOUS, all_columns, at_the_truth, link_motion, rnea

COULOMB, OFFSET = ("coulomb_friction", 1), ("torque_offset", 1)


def law(name: str) -> LawEffect:
    effect = EFFECTS[name]
    assert isinstance(effect, LawEffect)
    return effect


def moving(velocity: np.ndarray) -> JointMotion:
    """Along a velocity, with no torque."""
    none, time = np.zeros_like(velocity), np.arange(len(velocity)) / 500.0
    return JointMotion(
        np.asarray(time, np.float64), none, velocity, none, none, none + 1.0, 1000.0, 1.0, torque_scale=1.0
    )


def total(equation: Equation, x: np.ndarray) -> Chain:
    link = equation.at(x).link_terms(x)
    return Chain(x[equation.layout.compliance], x[equation.layout.link_viscous], link)


# -- friction at reversals


def test_friction_is_unknown_while_it_turns_round() -> None:
    """|v| < 0.0115 rad/s, where tanh(v / 0.005) has settled on neither side to 1 %; too little biases K."""
    motion = moving(0.5 * (2e-3 * np.arange(1001) - 1.003))
    times, sizes = undecided(law("coulomb_friction"), motion, np.array([2.0]))
    half = 0.005 * np.arctanh(0.98) / 0.5 + 0.005  # [s], and half a spacing beyond
    assert times[0] == pytest.approx(1.003 - half, abs=3e-3) and times[-1] == pytest.approx(
        1.003 + half, abs=3e-3
    )
    assert len(times) == 7 and np.ptp(np.diff(times)) < 5e-3
    spacing = (times[-1] - times[0]) / 6
    assert 0.007 < spacing <= 0.01
    np.testing.assert_allclose(sizes, 0.15 * 4.0 * np.tanh(4.0) * spacing, rtol=0.08)
    assert not len(undecided(law("coulomb_friction"), motion, np.zeros(1))[0])
    forward = moving(np.full(1001, 0.5))
    assert not len(undecided(law("coulomb_friction"), forward, np.array([2.0]))[0])


@pytest.mark.parametrize("signal", ["velocity", "link_velocity", "torque"])
def test_any_signal_at_which_a_law_jumps(signal: str) -> None:
    """0.02 rad/s either side of a jump with a velocity, 2 % of the rms with a torque."""

    class Step(LinearEffect):
        where, parameters = "motor", ()

        def columns(self, motion: JointMotion) -> np.ndarray:
            return np.tanh(getattr(motion, signal) / (0.01 * scale))[None]

    scale = 50.0 if signal == "torque" else 1.0
    ramp = scale * 0.5 * (np.arange(1001) / 500.0 - 1.0031)
    motion = replace(moving(np.zeros(1001)), torque_scale=50.0, **{signal: ramp})
    times, sizes = undecided(Step(), motion, np.array([2.0]))
    s = np.abs(ramp) / scale
    up, here, down = (np.tanh((s + small) / 0.01) for small in (0.02, 0.0, -0.02))
    between = np.minimum(up - here, here - down) > 0.01 * (up - down)
    wide = 2e-3 * np.count_nonzero(between & (up - down > 0.5 * np.tanh(np.abs(s).max() / 0.01)))
    assert len(times) and abs(times.mean() - 1.0031) < 4e-3
    assert np.ptp(times) == pytest.approx(wide + 0.01, abs=5e-3)
    np.testing.assert_allclose(sizes, 0.15 * 4.0 * np.tanh(2.0) * np.ptp(times) / (len(times) - 1), rtol=0.05)


def test_a_rest_costs_thirty_pulses_and_none_lies_outside_the_record() -> None:
    still = np.where(np.arange(1001) < 600, 0.0, 0.5)
    times, sizes = undecided(law("coulomb_friction"), moving(still), np.array([2.0]))
    assert len(times) == 29 and times[0] > 0.0 and times[-1] == pytest.approx(1.2, abs=0.01)  # one before 0
    np.testing.assert_allclose(sizes, sizes[0])
    ends, _ = undecided(law("coulomb_friction"), moving(still[::-1].copy()), np.array([2.0]))
    assert len(ends) == 29 and ends[-1] < 2.0


def test_parts_of_a_long_stretch() -> None:
    for seconds, count in ((12.0, 1), (29.9, 1), (30.5, 3), (44.0, 4), (104.0, 10)):
        time: Any = 5.0 + 0.02 * np.arange(round(seconds / 0.02) + 1)
        parts = parts_of(time)
        assert len(parts) == count and parts[0].start == 0 and parts[-1].stop == len(time)
        assert all(a.stop == b.start for a, b in pairwise(parts))
        assert np.ptp([p.stop - p.start for p in parts]) <= 1
    time = 0.02 * np.arange(500)
    assert [len(parts_of(time, count)) for count in (0, 500, 501, 4048)] == [1, 1, 2, 9]


@pytest.mark.parametrize(
    "elastic, values", [("", 0.0), ("joint_damping", 20.0), ("stiffness_hardening", 2e5)]
)
@pytest.mark.parametrize("sharp", [False, True])
def test_a_pulse_is_what_friction_would_have_to_be(
    monkeypatch: pytest.MonkeyPatch, elastic: str, values: float, sharp: bool
) -> None:
    """Friction that is higher by one standard deviation during one fine sample moves r by its column."""
    hidden: Any = {COULOMB: (2.0,), OFFSET: (1.0,)}
    equation, x = at_the_truth(hidden | ({(elastic, 1): (values,)} if elastic else {}), 8.0, 1.2)
    equation = Equation(equation.robot, replace(equation.signals, sharp=sharp), equation.layout)
    point, coulomb = equation.at(x), EFFECTS["coulomb_friction"]
    assert isinstance(coulomb, LinearEffect)
    found = pulses(point, x, point.link_terms(x))
    assert [(p.block, p.rows.start) for p in found] == [(0, 0), (1, 0), (2, 0)]
    plain, before = coulomb.columns, point.residual(x)
    none = x.copy()
    none[equation.layout.effect_start :] = 0.0
    assert pulses(equation.at(none), none, equation.at(none).link_terms(none)) == []
    for one in found[:2]:
        rows = equation.signals.blocks[one.block].rows
        motion = point.context.motions(1)[one.block]
        times, sizes = undecided(coulomb, motion, np.array([2.0]))
        columns, k = all_columns(one), len(times) // 2
        assert columns.shape == (rows.stop - rows.start, 2, len(times))

        def higher(
            seen: JointMotion, at: float = times[k], area: float = sizes[k], n: int = len(motion.time)
        ):
            here = (np.abs(seen.time - at) < 1e-6) & (len(seen.time) == n)
            return plain(seen) + 1e-3 * here * area / seen.step / 2.0  # of Coulomb friction of 2 Nm

        monkeypatch.setattr(coulomb, "columns", higher)
        moved = Equation(equation.robot, equation.signals, equation.layout).at(x).residual(x) - before
        monkeypatch.undo()
        column = 1e-3 * columns[:, :, k]
        np.testing.assert_allclose(moved[rows], column, atol=0.02 * np.abs(column).max())


# -- unknown initial states


def test_an_unknown_initial_state_is_projected_out() -> None:
    """r − C (CᵀC + λ)⁻¹ Cᵀ r in every stretch, C: r's answer to friction wound up at its start."""
    plain, x = at_the_truth({}, 8.0, 0.8)
    chosen = (ChosenEffect("presliding_hysteresis", 0), ChosenEffect("startup_friction", 1))
    equation = Equation(plain.robot, plain.signals, Layout(plain.layout.joints, chosen))
    x = np.r_[x, 4.0, 2.0, 0.9, 0.4]
    point, chain, signals = equation.at(x), total(equation, x), equation.signals
    effects = [(effect, x[where]) for effect, where in equation.layout.effect_slices()]
    found = initial_states(point.context, signals, effects, chain)
    assert [state.rows for state in found] == [block.rows for block in signals.blocks]
    rng = np.random.default_rng(0)
    for index, state in enumerate(found):
        count = state.rows.stop - state.rows.start
        assert state.columns.shape == (2 * count, 2)
        for k, (effect, values) in enumerate(effects):
            motion = point.context.motions(effect.joint or 0)[index]
            unknown = law(effect.effect).unknown(motion, values)
            u = point.context.filtered_block(index, unknown, effect.joint or 0, 3)[0]
            column = chain.rows(state.rows).column("torque", (effect.joint or 0,), u[:, :, None])
            np.testing.assert_allclose(
                state.columns[:, k], (column / np.abs(unknown).max()).ravel(), atol=1e-12
            )
        r = rng.standard_normal((signals.count, 2, 3))
        c, kept = state.columns, r.copy()
        state.remove_from(r)
        flat = kept[state.rows].reshape(2 * count, 3)
        left = flat - c @ np.linalg.solve(c.T @ c + RIDGE**2 * np.eye(2), c.T @ flat)
        np.testing.assert_allclose(r[state.rows].reshape(2 * count, 3), left, atol=1e-9)
        outside = np.ones(signals.count, bool)
        outside[state.rows] = False
        np.testing.assert_array_equal(r[outside], kept[outside])
    # and the equation uses them, with pulses of the same columns at the beginning of a record
    alone = Equation(equation.robot, signals, equation.layout).at(x)
    again = alone.residual(x)
    for state in alone._initial or []:
        np.testing.assert_allclose(
            state.columns.T @ again[state.rows].ravel(), 0.0, atol=1e-3 * np.abs(again).max()
        )
    np.testing.assert_allclose(alone.residual(x), again, atol=1e-9 * np.abs(again).max())  # without J
    assert len(alone._initial or []) == 3 and RIDGE == 0.01
    pulsed = pulses(point, x, point.link_terms(x))
    for one in pulsed:
        motions = [point.context.motions(j)[one.block] for j in (0, 1)]
        many = [len(undecided(law(e.effect), m, v)[0]) for (e, v), m in zip(effects, motions, strict=True)]
        assert one.count == sum(many) + 2


# -- operating points


def test_the_operating_point_follows_what_matters_to_the_effects() -> None:
    """Evaluated again after a change of 0.2 % of K, B or friction, and of nothing else: a fit's time."""
    equation, x = at_the_truth(
        {("cable_spring", 0): (3.0, 0.2), ("stiffness_hardening", 1): (2e4,)}, 8.0, 1.2
    )
    point = equation.at(x)
    for k in range(20, len(x)):
        little, much = x.copy(), x.copy()
        little[k] *= 1.0018
        much[k] *= 1.0025
        assert not point.left_behind(little) and point.left_behind(much)
    heavier = x.copy()
    heavier[:20] *= 1.5
    assert equation.at(heavier, point) is point and equation.has_state
    moved = x.copy()
    moved[20:28] *= 1.05
    again, fresh = equation.at(moved, point), equation.at(moved)
    np.testing.assert_allclose(again.residual(moved), fresh.residual(moved), atol=1e-3)
    assert np.abs(point.residual(moved) - fresh.residual(moved)).max() > 1e-2
    plain, x = at_the_truth({OFFSET: (1.0,)}, 8.0, 1.2)
    here = plain.at(x)
    assert not plain.has_state and plain.at(2 * x, here) is here


def test_jacobian_that_lets_the_load_move() -> None:
    """Friction that follows the load: ∂r/∂x with the operating point renewed, against differences."""
    plain, x = at_the_truth({OFFSET: (2.0,), ("torque_ripple", 1): (1.8, 2.0, 0.4)}, 5.0, 1.6)
    curve = ChosenEffect("free_curve_load", 1)
    layout = Layout(plain.layout.joints, (*plain.layout.effects, curve))
    equation = Equation(plain.robot, plain.signals, layout)
    x = np.r_[x, EFFECTS["free_curve_load"].sizes()]
    x[layout.effect_slice(curve).start + np.arange(2)] = -40.0, 60.0
    x[layout.link_viscous] = 40.0  # and the rate of s is felt, too
    moving_, still = (equation.at(x).evaluate(x, moving=m).jacobian for m in (True, False))
    columns = [layout.motor_inertia.start + 1, layout.motor_viscous.start + 1, 28, 29, 30, 31]
    for k in columns:
        h = 0.03 * x[k]  # s is iterated to 1e-5 of its largest value
        ends = []
        for sign in (1, -1):
            other = x.copy()
            other[k] += sign * h
            ends.append(equation.at(other).residual(other))
        slope = (ends[0] - ends[1]) / (2 * h)
        error, ignored = (np.sqrt(np.mean((j[:, :, k] - slope) ** 2)) for j in (moving_, still))
        assert error < 0.05 * ignored and ignored > 0.05 * np.sqrt(np.mean(slope**2)), k
    same = [k for k in range(layout.size) if k not in columns]
    np.testing.assert_array_equal(moving_[:, :, same], still[:, :, same])


# -- bands, ends, layout


def test_bands_follow_the_noise(demo: MeasurementSet) -> None:
    """70 Hz for the sign of the velocity at 2e-5 rad and 1 ms, lower with noise^⅔, never beyond the grid."""
    signals = build_signals(demo, demo.groups[:1], FlatZeroPhase(2 * np.pi * 8))
    block = signals.blocks[0]
    for factor in (1.0, 8.0, 1e4, 1e-4):
        per_sample = factor * 2e-5 * np.sqrt(1e-3 / block.segment.step)
        limit = 0.3 / 2e-3
        wanted = np.clip(70.0 / factor ** (2 / 3), 4.0, limit)
        np.testing.assert_allclose(_sign_band(block, np.array([per_sample])), wanted, rtol=1e-4)
    shared: dict[object, Any] = {}
    inertia, stiffness = np.ones(2), np.full(2, 1000.0)
    bands = fine_bands(signals, inertia, stiffness, shared)
    assert fine_bands(signals, 1.0001 * inertia, stiffness, shared) is bands
    root, scale = np.sqrt(block.segment.step), np.sqrt(np.mean(signals.tau[0] ** 2, axis=0))
    theta, tau = (root * level for level in shared["noise"])
    exact = torque_band(theta, tau, inertia, stiffness, scale, 150.0)
    np.testing.assert_allclose(bands.narrow[0], exact, rtol=1e-6)
    wider = fine_bands(signals, 0.2 * inertia, stiffness, shared)
    assert wider.key != bands.key and (wider.narrow[0] > bands.narrow[0]).all()
    np.testing.assert_array_equal(wider.wide[0], bands.wide[0])


def test_fine_signals_have_the_gain_of_their_bands() -> None:
    """A vibration above the motion, in θ and τ: Butterworth of the velocity's and of the torque's band."""
    plain, _ = at_the_truth({}, 8.0, 1.2)
    block, hertz = plain.signals.blocks[0], 40.0
    segment = block.segment
    shared: dict[object, Any] = {"noise": (np.full(2, 2e-6), np.full(2, 2e-5))}
    shake = np.sin(2 * np.pi * hertz * segment.time)[:, None]
    wave = replace(segment, theta=1e-3 * shake * [1, 1], tau=shake * [1, 1])
    signals = replace(plain.signals, blocks=(replace(block, segment=wave, torque=wave.tau),))
    bands = fine_bands(signals, np.ones(2), np.full(2, 1000.0), shared)
    (fine,) = fine_signals(signals, bands, shared)
    assert (bands.wide[0] > 50).all() and (bands.narrow[0] < 70).all() and fine.step == 2e-3
    np.testing.assert_array_equal(fine.torque_hertz, bands.narrow[0])
    middle, at = slice(500, -500), segment.time[::2]
    w, late = 2 * np.pi * hertz, 2 * np.pi * hertz * HOLD / 2
    wide, narrow = (1 / (1 + (hertz / b[0][0]) ** 8) for b in (bands.wide, bands.narrow))
    for k, phase in enumerate(np.pi / 2 * np.arange(4)):
        exact = [(fine.theta[k], 1e-3 * narrow, 0.0)]
        if k < 2:
            exact += [((fine.position, fine.velocity)[k], 1e-3 * wide, 0.0), (fine.tau[k], narrow, late)]
        for found, gain, delay in exact:
            wanted = gain * w**k * np.sin(w * at + phase - delay)
            np.testing.assert_allclose(found[middle, 1], wanted[middle], atol=0.02 * gain * w**k)
    assert (TORQUE_NOISE, LINK_VELOCITY_NOISE) == (5e-3, 4e-3)  # of the rms torque; [rad/s]


def test_link_velocity_of_the_wide_band() -> None:
    """Of effects that ask for nothing identified: q̇ = θ̇ − ṡ/K with s without any effect."""
    equation, x = at_the_truth({OFFSET: (2.0,)}, 8.0, 1.2)
    motion = equation.at(x).context.motions(0)[0]
    exact = link_motion(0, 2)[1][::2, 0]  # a wide band rings in the jerk of a record without noise
    middle = slice(1500, -1500)
    np.testing.assert_allclose(motion.link_velocity[middle], exact[middle], atol=1e-2 * np.abs(exact).max())


@pytest.mark.parametrize(
    ("head", "tail", "reach"),
    [(100, 900, 50), (100, 240, 70), (0, 1000, 30), (200, 700, 249), (200, 700, 800)],
)
def test_ends_of_a_record(head: int, tail: int, reach: int) -> None:
    """Both ends, each once, within stretches that reach as far as the filter remembers."""
    seen = np.zeros(1000, int)
    for used, taken in _ends(head, tail, 1000, reach):
        part = np.arange(1000)[taken]
        seen[part[used]] += 1
        if taken != slice(0, 1000):
            assert len(part) == (head if part[0] == 0 else 1000 - tail) + reach
    outside = np.r_[np.ones(head), np.zeros(tail - head), np.ones(1000 - tail)].astype(bool)
    assert (seen[outside] == 1).all() and (head + reach >= tail - reach or not seen[~outside].any())


def test_wide_band_motion_beyond_what_the_equation_knows() -> None:
    """Torque and link velocity of a joint with friction go on to the ends of a record."""
    equation, x = at_the_truth(
        {("quadratic_friction", 0): (3.0,), ("cable_spring", 0): (3.0, 0.2)}, 14.0, 1.2
    )
    shared: dict[object, Any] = {"noise": (np.full(2, 2e-6), np.full(2, 2e-5))}  # its bands do not ring
    motion = Equation(equation.robot, equation.signals, equation.layout, shared).at(x).context.motions(0)[0]
    q, v, a = (level[::2] for level in link_motion(0, 2))
    load = rnea(equation.robot.model_with(equation.robot.cad_parameters), (q, v, a))[:, 0]
    load += LINK_VISCOUS[0] * v[:, 0] + 3.0 * (q[:, 0] - 0.2)
    for part in (slice(150, 590), slice(-590, -150), slice(610, -610)):
        np.testing.assert_allclose(motion.torque[part], load[part], atol=0.01 * np.abs(load).max())
        np.testing.assert_allclose(motion.link_velocity[part], v[part, 0], atol=6e-3 * np.abs(v).max())


def test_ten_samples_are_enough_and_nine_are_not(demo: MeasurementSet) -> None:
    group = demo.groups[0]
    whole, observer = group.segments[0], FlatZeroPhase(2 * np.pi * 8)
    for seconds, there in ((0.18, True), (0.16, False)):
        part = slice(0, round(seconds / whole.step) + 1)
        cut = replace(whole, time=whole.time[part], theta=whole.theta[part], tau=whole.tau[part])
        groups = [replace(group, segments=(whole, cut))]
        options: dict[str, Any] = {"sample_step": 0.02, "exact_step": True, "drop": (0.0, 0.0)}
        signals = build_signals(demo, groups, observer, **options)
        assert len(signals.blocks) == 1 + there
        assert signals.blocks[-1].rows.stop - signals.blocks[-1].rows.start >= 10
    eso = build_signals(demo, [group], make_observer("eso", 40.0))
    context = Equation(demo.robot, eso, Layout(demo.joints)).at(np.ones(28)).context
    assert context.decimation(0, 3, 1.0) == [1]  # it passes all frequencies


def test_every_entry_of_the_vector_has_a_name_a_unit_and_a_label(demo: MeasurementSet) -> None:
    effects = (ChosenEffect("payload_error", payload="p2"), ChosenEffect("external_contact", 1, "g1"))
    layout = Layout(("a", "b"), effects)
    moments = ["mass", "mx", "my", "mz", "ixx", "ixy", "iyy", "ixz", "iyz", "izz"]
    rest = ["stiffness", "motor_inertia", "link_viscous_friction", "motor_viscous_friction"]
    labels = [f"{m}:{j}" for j in "ab" for m in moments] + [f"{name}:{j}" for name in rest for j in "ab"]
    labels += ["payload_error.relative_mass_error:p2"]
    labels += [f"external_contact.{p}:b:g1" for p in ("torque", "start", "end")]
    assert layout.labels() == labels and layout.size == len(labels) == 32
    units = [unit for _, _, unit in layout.names()]
    assert units[:10] == ["kg", *["kg m"] * 3, *["kg m²"] * 6] == units[10:20]
    assert units[20:] == ["Nm/rad"] * 2 + ["kg m²"] * 2 + ["Nm s/rad"] * 4 + ["-", "Nm", "s", "s"]
    assert [joint for _, joint, _ in layout.names()][28:] == [None, "b", "b", "b"]
    assert [layout.effect_slice(e) for e in effects] == [slice(28, 29), slice(29, 32)]
    found = layout_of(replace(demo, effects=("torque_offset:joint2",)), ["coulomb_friction:joint1"])
    assert [e.text(demo.joints) for e in found.effects] == ["torque_offset:joint2", "coulomb_friction:joint1"]


def test_what_is_dropped_at_the_ends(demo: MeasurementSet) -> None:
    """The observer's transients, or what is asked for, and no more than a share of the shortest record."""
    observer = FlatZeroPhase(2 * np.pi * 8)
    group = demo.groups[0]
    begin, end = group.segments[0].time[[0, -1]]
    options: dict[str, Any]
    for options, before, after in (
        ({}, *observer.settling()),
        ({"drop": (0.3, 0.7)}, 0.3, 0.7),
        ({"drop": (3.0, 4.0), "longest_edge": 0.1}, 0.1 * (end - begin), 0.1 * (end - begin)),
    ):
        signals = build_signals(demo, [group], observer, **options)
        step = np.diff(signals.time)[0]
        assert 0 <= signals.time[0] - begin - before < step + 1e-9
        assert -1e-9 <= end - after - signals.time[-1] < step + 1e-9
    with pytest.raises(InputError, match=r"longest group has .* s, .* needs 30 s to settle"):
        build_signals(demo, [group], observer, drop=(10.0, 20.0))
    wide = build_signals(demo, [group], FlatZeroPhase([10.0, 20.0]))
    assert [wide.observer_of(j).bandwidth for j in (0, 1)] == [10.0, 20.0]


def test_temperatures_are_required_only_where_an_effect_needs_them(demo: MeasurementSet) -> None:
    signals = build_signals(demo, demo.groups[:1], FlatZeroPhase(2 * np.pi * 8))
    Equation(demo.robot, signals, Layout(demo.joints, (ChosenEffect("coulomb_friction", 0),)))
    with pytest.raises(InputError, match=r'"temperature_friction" needs the temperature .* group "'):
        Equation(demo.robot, signals, Layout(demo.joints, (ChosenEffect("temperature_friction", 0),)))
