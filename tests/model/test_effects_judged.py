"""What a search and a verdict ask an effect: traits, limits of what could be real, starts, sizes."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest

from benchmarks.effect_pages.pictures import PLACE
from flexviz.base.errors import InputError
from flexviz.model.effects import (
    CURVES,
    EFFECTS,
    ChosenEffect,
    Effect,
    EffectEvidence,
    EffectTarget,
    JointMotion,
    JointScale,
    LawEffect,
    LinearEffect,
    ParameterSpec,
    choose_effects,
)
from flexviz.model.effects.base_tilt import BaseTilt
from flexviz.model.effects.elastic_joint import hardened
from flexviz.model.effects.trial import TrialMotion
from flexviz.robot.model import EffectValue
from flexviz.robot.mounting import GRAVITY
from tests.model.test_effects import MOTION, VALUES, value

FRICTION = {"coulomb_friction", "stribeck_friction", "quadratic_friction", "load_dependent_friction"}
HAVING = {  # trait → the effects that have it, all others do not
    "common": {"coulomb_friction", "link_coulomb_friction", "torque_offset"},
    "usual": FRICTION | {"torque_offset", "cable_spring"},
    "hidden_state": {"presliding_hysteresis", "link_coulomb_friction"},
    "damps_deflection": {"joint_damping"},
    "after_rest": {"startup_friction"},
    "joint_optional": {"torque_delay"},
    "limits_torque": {"torque_limit"},
    "absorbed_by_stiffness": {"stiffness_hardening", "backlash", "joint_damping"},
    "underrated": {
        "stiffness_hardening",
        "backlash",
        "joint_damping",
        "load_dependent_friction",
        "driving_friction",
    },
    "stopgap": set(),
}
SAYING = {  # attribute → what an effect says there, all others its usual value
    "beside": (None, {"stribeck_friction": "coulomb_friction", "startup_friction": "coulomb_friction"}),
    "replaces": (
        None,
        {"presliding_hysteresis": "coulomb_friction", "driving_friction": "load_dependent_friction"},
    ),
    "instead_of": (
        None,
        {
            "gravity_compensator": "cable_spring",
            "driving_friction": "load_dependent_friction",
            "thinning_friction": "coulomb_friction",
        },
    ),
    "offset_parameter": (None, {"cable_spring": "rest_angle"}),
    "fewest_joints": (1, {"motor_coupling": 2, "coupled_friction": 2}),
    "expected": ({}, {"torque_gain": {"gain_error": 0.05}}),
}


def rms(y: np.ndarray) -> float:
    return float(np.sqrt(np.mean(y**2)))


def law(name: str) -> LawEffect:
    effect = EFFECTS[name]
    assert isinstance(effect, LawEffect)
    return effect


class Plain(Effect):
    """An effect with nothing but parameters, bounded on neither, one, the other and both sides."""

    name, where = "plain", "motor"
    parameters = (
        ParameterSpec("free", "Nm"),
        ParameterSpec("above", "Nm", lower=2.0),
        ParameterSpec("below", "Nm", upper=-3.0),
        ParameterSpec("between", "Nm", 4.0, 5.0),
        ParameterSpec("positive", "Nm", lower=0.0, symbol="p"),
    )
    example: ClassVar[tuple[float, ...]] = ()

    def terms(self, context, place, values):
        raise NotImplementedError


# -- traits


def test_traits_are_those_the_search_relies_on() -> None:
    """A trait lost moves an effect to another list, another phase of the search or another threshold."""
    assert {trait: {e.name for e in EFFECTS.values() if getattr(e, trait)} for trait in HAVING} == HAVING
    for attribute, (usual, said) in SAYING.items():
        found = {name: getattr(effect, attribute) for name, effect in EFFECTS.items()}
        assert found == {name: said.get(name, usual) for name in EFFECTS}, attribute
    assert all(c.stopgap and not c.common and not c.usual for c in CURVES)


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_without_its_size_is_absent(name: str) -> None:
    """`size_at` decides whether an interval includes zero: with those parameters zero nothing is left."""
    effect, full = EFFECTS[name], np.array(VALUES[name])
    none = full.copy()
    none[list(effect.size_at) or [0]] = 0.0  # a limit has no size that grows with it, but zero is none
    most = np.abs(value(name)).max()
    assert np.abs(value(name, values=none)).max() < 1e-6 * most
    for k in effect.size_at:
        only = none.copy()
        only[k] = full[k]
        assert np.abs(value(name, values=only)).max() > 1e-3 * most


@pytest.mark.parametrize("name", EFFECTS)
def test_traits_that_a_law_shows(name: str) -> None:
    """Constant, relative to friction, by temperature, with memory, linear; moved by what is identified."""
    effect, u = EFFECTS[name], value(name)
    assert effect.constant == (np.ptp(u) == 0.0)
    other = value(name, replace(MOTION, temperature=MOTION.temperature + 7.0))
    assert effect.by_temperature == (not np.array_equal(u, other))
    stiffer = replace(MOTION, stiffness=1.2 * MOTION.stiffness, motor_viscous=1.3 * MOTION.motor_viscous)
    if name not in (
        "load_dependent_friction",
        "driving_friction",
        "backlash",
    ):  # they follow the torque, which is prescribed
        assert effect.state == (not np.array_equal(u, value(name, stiffer)))
    assert not effect.relative or np.allclose(value(name, stiffer), 1.3 * u, rtol=1e-12)
    if effect.linear:
        np.testing.assert_allclose(value(name, values=2 * np.array(VALUES[name])), 2 * u, rtol=1e-12)
    assert isinstance(effect, LinearEffect) <= effect.linear
    if isinstance(effect, LawEffect):
        before = effect.unknown(MOTION.motions(0)[0], np.array(VALUES[name]))
        assert effect.memory == bool(len(before)) and before.shape[1] == MOTION.count()
        assert effect.depth == (1 if effect.where in ("link", "load") else 3)
    link_side = "residual" if effect.gravity(np.array(VALUES[name]), np.array(GRAVITY)) is None else "gravity"
    entry = {"motor": "torque", "sensing": "torque", "joint": "deflection"}.get(effect.where, link_side)
    assert effect.terms(MOTION, PLACE, np.array(VALUES[name])).entry == effect.entry == entry


def test_linear_effects_say_so() -> None:
    """Their columns are made once for a fit, and a search scores them exactly."""
    linear = set()
    for name, effect in EFFECTS.items():
        one, other = np.array(VALUES[name]), 0.7 * np.array(VALUES[name])[::-1] + 0.1
        parts = [effect.terms(MOTION, PLACE, values).slopes for values in (one, other)]
        linear |= {name} if np.allclose(*parts, rtol=1e-9, atol=1e-12) else set()
    assert linear - {"payload_error"} == {e.name for e in EFFECTS.values() if e.linear}


def test_places_in_text() -> None:
    pair = ("a", "b")
    assert len(choose_effects(["coupled_friction", "motor_coupling"], pair)) == 3
    many = choose_effects(
        ["payload_error", "presliding_hysteresis:b", "coulomb_friction"], pair, ["p1", "p2"]
    )
    assert [e.text(pair) for e in many] == [
        "payload_error:p1", "payload_error:p2", "presliding_hysteresis:b", "coulomb_friction:a",
    ]  # fmt: skip
    assert [e.place for e in many][1:3] == [EffectTarget(payload="p2"), EffectTarget(1)]
    (delay,) = choose_effects(["torque_delay"], pair)
    assert delay.place == EffectTarget() and delay.value(pair).joint is None
    for text, words in (
        ("base_tilt:b", 'belongs to no joint; write "base_tilt"'),
        ("torque_delay:c", 'joint "c" is not in the set'),
        ("payload_error:p3", 'payload "p3" is not carried'),
        ("torque_offset:c", 'joint "c" is not in the set'),
        ("torque_offset:b@g1", 'acts in every group of the set; write "torque_offset:b"'),
        ("external_contact:b", "name the group, as in"),
        ("external_contact:b@g1", 'group "g1" is not in the set'),
        ("external_contact", 'as in "external_contact:a@group"'),
    ):
        with pytest.raises(InputError, match=words):
            choose_effects([text], pair, ["p1"])
    with pytest.raises(InputError, match='joint "z" is not in the set'):
        ChosenEffect.of(EffectValue("torque_offset", "z", {}), pair)


def test_places_in_a_robot() -> None:
    """Where a search tries an effect: every joint, every payload, the set, nowhere for episodes."""
    joints = [EffectTarget(0), EffectTarget(1), EffectTarget(2)]
    wanted = {"joint": joints, "set": [EffectTarget()], "episode": []}
    wanted["payload"] = [EffectTarget(payload="p1"), EffectTarget(payload="p2")]
    for effect in EFFECTS.values():
        found = effect.targets(3, ("p1", "p2"))
        found = found[:1] if effect.joint_optional else found  # then each joint: test_torque_delay.py
        assert found == (joints[:-1] if effect.name == "coupled_friction" else wanted[effect.scope]), effect
        assert bool(effect.targets(1, ())) == (effect.fewest_joints == 1 and effect.scope in ("joint", "set"))


# -- what could be real


@pytest.mark.parametrize("effect", [*EFFECTS.values(), Plain()], ids=lambda e: e.name)
def test_a_search_that_ends_at_a_bound_has_found_nothing(effect: Effect) -> None:
    inside = effect.sizes()
    quiet = EffectEvidence(np.full(9, 1e-9), 1e-9, viscous=np.inf)
    for k, p in enumerate(effect.parameters):
        assert p.lower < inside[k] < p.upper
        for edge in (p.lower, p.upper):
            values = inside.copy()
            values[k] = edge
            wrong = bool(np.isfinite(edge) and edge != 0.0 and not (edge == p.lower and p.lower_occurs))
            assert effect.at_bound(values) == wrong
            assert not (wrong and effect.credible(values, quiet))
            if wrong:
                values[k] = edge * (1 + 1e-7)
                assert effect.at_bound(values)
                values[k] = edge + 1e-5 * (inside[k] - edge)
                assert effect.at_bound(values) == (abs(values[k] - edge) < 1e-6 * abs(edge))
    assert not effect.at_bound(inside)


def test_sizes_that_are_too_small_or_too_large_are_not_believed() -> None:
    """Artefacts of time stamps, of the torque's hold, of other errors; what drives hardly are costs."""
    evidence = EffectEvidence(np.array([3.0, -4.0, 5.0]) * 1e3, record_step=1e-3)
    delay, contact, gain = (EFFECTS[n] for n in ("torque_delay", "external_contact", "torque_gain"))
    for sign in (1, -1):
        seen = [delay.credible(np.array([sign * d]), evidence) for d in (9e-5, 1.1e-4, 9e-2, 0.1)]
        assert seen == [False, True, True, False]
        least = 3e-5 * rms(evidence.torque)
        seen = [contact.credible(np.array([sign * s * least, 1.0, 2.0]), evidence) for s in (0.9, 1.1)]
        assert seen == [False, True]
        assert gain.surprise(np.array([sign * 0.1])) == pytest.approx(2.0)  # twice what a drive may be off
        assert gain.surprise(np.array([sign * 0.5])) == pytest.approx(50.0)
    seen = [gain.credible(np.array([g]), evidence) for g in (-0.8, -0.79, 0.5, 3.9, 4.0)]
    assert seen == [False, True, True, True, False]
    stribeck = EFFECTS["stribeck_friction"]
    seen = [stribeck.credible(np.array([1.0, v]), replace(evidence, top_speed=2.0)) for v in (0.9, 1.1)]
    assert seen == [True, False] and stribeck.credible(np.array([1.0, 1.1]), evidence)
    assert contact.possible(np.array([1.0, 2.0, 2.0])) and not contact.possible(np.array([1.0, 2.0, 1.9]))
    assert all(e.possible(np.array(VALUES[n])) for n, e in EFFECTS.items())


def test_a_joint_may_be_in_its_gap_where_its_torque_is_faint() -> None:
    """Below 6 % of the largest torque within 60 ms, for the observer rings, and 1 % of the rms."""
    time: Any = 2e-3 * np.arange(1001)
    still = np.zeros_like(time)
    for faint, gap in ((6.05, True), (6.15, False), (-6.05, True)):
        torque = np.where(time == time[500], faint, 100.0)
        motion = JointMotion(time, still, still, torque, still, still, 1500.0, 1.0, torque_scale=10.0)
        idle, size = law("backlash").undecided(motion, np.array([-0.003]))  # type: ignore[misc]
        assert idle[500] == gap and not np.delete(idle, 500).any()
        np.testing.assert_array_equal(size, np.full(1001, 0.006))
    fallen = replace(motion, torque=np.where(time < 1.0, 100.0, 3.0))
    idle = law("backlash").undecided(fallen, np.array([0.003]))[0]  # type: ignore[index]
    assert time[idle][[0, -1]] == pytest.approx([1.0, 1.058], abs=3e-3) and idle.sum() == pytest.approx(
        30, abs=1
    )


# -- starts


def test_a_gap_that_the_compliance_has_absorbed() -> None:
    """Least squares of q's loss c s + b sign(s) on s alone; the starts undo it."""
    backlash, s = EFFECTS["backlash"], MOTION.torque.at(MOTION.time, 1)[0]
    c, b = 1e-3, 0.012
    fitted = float((c * s + b * np.sign(s)) @ s / (s @ s))
    own = ("backlash", "load_dependent_friction", "driving_friction", "stiffness_hardening")
    starts = backlash.hidden_starts(s, fitted, c)
    assert starts[-1].values == pytest.approx((b,)) and starts[-1].compliance == pytest.approx(c)
    shares = [start.values[0] / (fitted * rms(s)) for start in starts[:-1]]
    assert shares == sorted(shares) and 0.05 < shares[0] < 0.2 and 0.5 < shares[-1] < 1.0
    for start in starts:
        left = fitted - start.values[0] * np.mean(np.abs(s)) / np.mean(s**2)
        assert start.compliance == pytest.approx(max(left, 0.2 * fitted))
    near_rigid = backlash.hidden_starts(s, fitted, 0.05 * c)[-1]  # a gap takes most of it, but not all
    assert near_rigid.compliance == pytest.approx(0.2 * fitted)
    stiffer = backlash.hidden_starts(s, c, 2 * c)  # a joint stiffer than the rough value has absorbed none
    assert len(stiffer) == len(starts) - 1 and all(start.values[0] > 0 for start in stiffer)
    assert all(not e.hidden_starts(s, fitted, c) for e in EFFECTS.values() if e.name not in own)


def test_a_cubic_stiffness_that_the_compliance_has_absorbed() -> None:
    """At the rms torque the joint deflects as it does with the fitted compliance alone."""
    s, fitted = MOTION.torque.at(MOTION.time, 1)[0], 1e-3
    shares = []
    for start in EFFECTS["stiffness_hardening"].hidden_starts(s, fitted, 0.5 * fitted):
        deflection = hardened(np.array([rms(s)]), 1 / start.compliance, start.values[0])[0]
        assert deflection == pytest.approx(fitted * rms(s), rel=1e-6)
        shares.append(start.values[0] * deflection**3 / rms(s))
    assert shares == sorted(shares) and 0.1 < shares[0] < 0.4 and 0.5 < shares[-1] < 0.9


def test_one_effect_starts_from_another() -> None:
    """A sine wave from a spring, presliding from Coulomb, a spring that takes the offset beside it."""
    compensator, spring = EFFECTS["gravity_compensator"], EFFECTS["cable_spring"]
    sine, cosine = compensator.refining(np.array([3.0, 0.2]))
    q = 1e-4
    assert sine * np.sin(q) + cosine * np.cos(q) == pytest.approx(3.0 * (q - 0.2), rel=1e-6)
    stiffness, coulomb = EFFECTS["presliding_hysteresis"].refining(np.array([2.0]))
    assert coulomb == 2.0 and coulomb / stiffness == pytest.approx(0.01)
    moved = spring.with_constant(np.array([3.0, 0.2]), 1.5)
    np.testing.assert_allclose(value("cable_spring", values=moved), value("cable_spring") + 1.5)
    np.testing.assert_array_equal(spring.with_constant(np.array([0.0, 0.2]), 1.5), [0.0, 0.2])
    for effect in EFFECTS.values():
        if effect is not spring:
            np.testing.assert_array_equal(effect.with_constant(np.ones(3), 1.5), np.ones(3))
        seconds = effect.time_constant(np.array([12.0]), 1e-3)
        assert seconds == (pytest.approx(0.012) if effect.damps_deflection else 0.0)
    assert EFFECTS["joint_damping"].time_constant(np.array([-1.0]), 1e-3) == 0.0
    np.testing.assert_array_equal(EFFECTS["backlash"].refining(np.ones(1)), EFFECTS["backlash"].sizes())


SHAPES = {  # parameter that a search tries on a grid, and whether its true value is there or between
    "stribeck_friction": (1, np.geomspace(0.04, 0.8, 9)),
    "thinning_friction": (1, np.geomspace(0.03, 0.5, 9)),
    "startup_friction": (1, np.geomspace(0.006, 0.1, 9)),
    "friction_drift": (1, np.geomspace(0.6, 8.0, 9)),
    "presliding_hysteresis": (0, 2.0 / np.geomspace(0.006, 0.18, 9)),
    "torque_ripple": (1, np.arange(1.0, 40.0, 3.0)),
}


@pytest.mark.parametrize("name", SHAPES)
def test_a_search_over_a_grid_meets_what_is_between(name: str) -> None:
    """Whatever the shape, some guess explains nearly all of u, and its parameters are near the true ones."""
    at, tried = SHAPES[name]
    guesses = EFFECTS[name].guesses(MOTION, PLACE)
    for shape in tried:
        true = np.array(VALUES[name])
        true[at] = shape
        u, best = value(name, values=true), (0.0, np.zeros(0))
        for guess in guesses:
            columns = guess.columns[:, 0, :, 0]
            sizes: Any = np.linalg.lstsq(columns.T, u, rcond=None)[0]
            share = 1 - np.sum((u - sizes @ columns) ** 2) / np.sum(u**2)
            if share > best[0]:
                best = (share, guess.to_values(sizes))
        assert best[0] > 0.94, (shape, best)
        assert 0.4 < best[1][at] / shape < 2.5
        assert np.allclose(best[1], true, rtol=1.5)


@pytest.mark.parametrize("name", ["torque_ripple", "transmission_error"])
def test_waves_keep_all_they_contain_and_fit_from_any_phase(name: str) -> None:
    """Decimated no further than 40 cycles per turn at the highest speed allow; a and φ of sine and cosine."""
    asked: list[float] = []

    class Asked(TrialMotion):
        def decimation(self, joint: int, depth: int, highest: float) -> list[int]:
            asked.append(highest)
            return [1]

    made = Asked(MOTION.time, MOTION.motor, MOTION.torque)
    guesses = EFFECTS[name].guesses(made, PLACE)
    (highest,) = asked
    fastest = 40 * np.abs(MOTION.theta(0)[1]).max()
    assert fastest < highest < 2 * fastest and len(guesses) == 40
    for order in (1, 7, 40):
        columns = guesses[order - 1].columns
        angle = order * MOTION.theta(0)[0]
        np.testing.assert_allclose(columns[:, 0, :, 0], [np.sin(angle), np.cos(angle)], atol=1e-9)
        amplitude, n, phase = guesses[order - 1].to_values(np.array([-0.6, 0.8]))
        assert (amplitude, n) == pytest.approx((1.0, order)) and np.cos(phase) == pytest.approx(-0.6)
        assert np.sin(phase) == pytest.approx(0.8)


def test_guesses_of_rest_angle_and_tilt() -> None:
    (spring,) = EFFECTS["cable_spring"].guesses(MOTION, PLACE)
    np.testing.assert_allclose(spring.to_values(np.array([3.0, -0.6])), [3.0, 0.2])
    np.testing.assert_array_equal(spring.to_values(np.array([0.0, -0.6])), [0.0, 0.0])
    (tilt,) = BaseTilt().guesses(MOTION, PLACE)
    np.testing.assert_allclose(tilt.to_values(np.array([9.0, -0.3])), [0.5, -0.3])
    assert EFFECTS["external_contact"].guesses(MOTION, PLACE) == []


# -- sizes of simulated effects

UNITS = ((r"^(Nm|kg m²)", (1, 0)), (r"kg m²| s²", (0, 2)), (r"( |^)s(?!²)", (0, 1)), (r"/s$", (0, -1)))


@pytest.mark.parametrize("name", EFFECTS)
def test_typical_sizes_are_visible_and_have_the_units_of_their_parameters(name: str) -> None:
    """Hidden in a simulation without values, an effect has to be seen, and not to be all there is."""
    effect, torque = EFFECTS[name], rms(MOTION.tau(0)[0])
    deflection, inertias = torque / MOTION.stiffness, (1.2, 0.8)
    scale = JointScale(
        torque, rms(MOTION.theta(0)[1]), deflection, MOTION.stiffness, *inertias, 0.4, 6.0, 1.8
    )
    values = effect.typical(scale)
    terms = effect.terms(MOTION, PLACE, np.array(values))
    share = rms(terms.value[0, :, 0]) * (MOTION.stiffness if terms.entry == "deflection" else 1) / torque
    assert 0.004 < share < 0.45
    a, b = 3.0, 1.7  # other units of torque and time
    changed = {"torque": a, "speed": 1 / b, "stiffness": a, "duration": b, "viscous": a * b}
    changed |= dict.fromkeys(("motor_inertia", "neighbour_inertia"), a * b**2)
    other = replace(scale, **{field: factor * getattr(scale, field) for field, factor in changed.items()})
    for p, size, in_other in zip(effect.parameters, values, effect.typical(other), strict=True):
        powers = np.sum([power for pattern, power in UNITS if re.search(pattern, p.unit)] or [(0, 0)], axis=0)
        later = 1.0 if name in ("torque_delay", "joint_damping") else b ** powers[1]  # some milliseconds
        assert in_other == pytest.approx(size * a ** powers[0] * later), p.name
        assert p.lower <= size <= p.upper
    still = effect.typical(replace(scale, deflection=1e-9))
    assert name not in ("backlash", "transmission_error") or still[0] > 1e-4  # above an encoder's step


def test_examples_come_first_else_a_place_between_the_bounds() -> None:
    plain = Plain()
    np.testing.assert_allclose(plain.sizes(), [0.8, 2.8, -3.8, 4.3, 0.8])
    assert plain.typical(None) == pytest.approx((0.8, 2.8, -3.8, 4.3, 0.8))  # type: ignore[arg-type]
    plain.example = (1.0, 2.0, -4.0, 4.5, 0.1)  # type: ignore[misc]
    np.testing.assert_array_equal(plain.sizes(), plain.example)
    assert [p.symbol for p in plain.parameters] == ["free", "above", "below", "between", "p"]
    assert plain.units == dict.fromkeys(("free", "above", "below", "between", "positive"), "Nm")
