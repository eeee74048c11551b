"""The effect library: complete descriptions, laws equal to the simulator's own, slopes, pages, command."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from benchmarks.effect_pages.pages import FOLDER, files
from benchmarks.effect_pages.pictures import LINE_COLOURS, PICTURES, PLACE
from flexviz.content.charts import FILE
from flexviz.content.wording import bounds_text, effect_json, simulated_text
from flexviz.model.effects import EFFECT_NAMES, EFFECTS, Effect
from flexviz.model.effects.base_tilt import tilted_gravity
from flexviz.model.effects.law import LawEffect
from flexviz.model.effects.terms import JointState, Scope, Where
from flexviz.model.effects.trial import TrialMotion, TrialSignal
from flexviz.model.equation.reversal_nuisance import undecided
from flexviz.model.simulation import check_effect, laws
from flexviz.model.simulation import tilted_gravity as simulated_gravity
from flexviz.model.simulation.effect_laws import LAWS
from flexviz.model.simulation.laws import Dahl, ElasticJoint
from flexviz.outlets.terminal import main
from flexviz.robot.model import EffectValue

MOTOR_LAWS = (
    "coulomb_friction", "stribeck_friction", "quadratic_friction", "directional_friction",
    "thinning_friction", "load_dependent_friction", "driving_friction", "friction_drift", "torque_ripple",
    "torque_offset",
)  # fmt: skip
LINK_LAWS = ("link_coulomb_friction", "cable_spring", "gravity_compensator")
VALUES = {
    "coulomb_friction": (3.0,),
    "stribeck_friction": (1.5, 0.3),
    "quadratic_friction": (0.7,),
    "directional_friction": (-0.4,),
    "thinning_friction": (0.9, 0.15),
    "load_dependent_friction": (0.08,),
    "driving_friction": (0.06, 0.11),
    "presliding_hysteresis": (200.0, 2.0),
    "startup_friction": (1.8, 0.03),
    "friction_drift": (0.8, 2.5),
    "temperature_friction": (0.03, -0.02),
    "torque_ripple": (1.2, 3.3, 0.4),
    "torque_offset": (-2.0,),
    "torque_gain": (0.1,),
    "torque_delay": (0.002,),
    "torque_limit": (45.0,),
    "stiffness_hardening": (2e6,),
    "backlash": (0.002,),
    "joint_damping": (12.0,),
    "transmission_error": (0.004, 2.2, 0.7),
    "link_coulomb_friction": (2.5,),
    "cable_spring": (3.0, 0.2),
    "gravity_compensator": (6.0, -2.5),
    "payload_error": (0.15,),
    "base_tilt": (0.05, -0.03),
    "external_contact": (2.0, 1.5107, 2.4713),
    "motor_coupling": (0.2,),
    "coupled_friction": (1.5, 0.8),
}
MOTION = TrialMotion(
    np.linspace(0.0, 6.0, 3001),
    motor=TrialSignal(((0.6, 1.3, 0.2), (0.3, 3.1, 1.0)), constant=0.4),
    torque=TrialSignal(((40.0, 1.1, 0.5), (25.0, 4.3, 2.0)), constant=5.0),
    neighbour=TrialSignal(((0.5, 2.0, 0.3),)),
    stiffness=1500.0,
    motor_viscous=0.9,
)
LAW_EFFECTS = [name for name, effect in EFFECTS.items() if isinstance(effect, LawEffect)]


def named(name: str) -> dict[str, float]:
    return {p.name: v for p, v in zip(EFFECTS[name].parameters, VALUES[name], strict=True)}


def value(
    name: str, made: TrialMotion = MOTION, values: tuple[float, ...] | np.ndarray | None = None
) -> np.ndarray:
    """u on joint 0, shape (N,)."""
    p = np.array(VALUES[name] if values is None else values, dtype=float)
    return EFFECTS[name].terms(made, PLACE, p).value[0, :, 0]


# -- what a class says about its effect


def test_names_are_the_canonical_ones_in_order() -> None:
    assert tuple(EFFECTS) == EFFECT_NAMES == tuple(LAWS)
    assert tuple(VALUES) == EFFECT_NAMES and set(PICTURES) == set(EFFECT_NAMES)
    assert len({effect.title for effect in EFFECTS.values()}) == len(EFFECTS)


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)
def test_everything_is_said(effect: Effect) -> None:
    for attribute in ("name", "title", "explanation", "equation", "signature", "confirm", "reference"):
        text = getattr(effect, attribute)
        assert isinstance(text, str) and text == text.strip() != "", attribute
        assert "  " not in text.replace(",  ", ", "), attribute
    for attribute in ("explanation", "signature", "confirm"):
        assert getattr(effect, attribute).endswith("."), attribute
    assert simulated_text(effect).endswith(".")
    assert re.search(r"\b(19|20)\d\d$", effect.reference), "authors, title, where, year"
    assert type(effect).__doc__ and effect.where in get_args(Where) and effect.scope in get_args(Scope)
    for other in (effect.beside, effect.replaces, *effect.twins):
        assert other is None or other in EFFECTS
    assert all(effect.name in EFFECTS[twin].twins for twin in effect.twins)


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)
def test_parameters_are_those_of_the_simulator(effect: Effect) -> None:
    values = dict(zip(effect.units, VALUES[effect.name], strict=True))
    check_effect(EffectValue(effect.name, None, values), ("joint1",))
    law = LAWS[effect.name]
    assert {*law.positive, *law.not_negative} <= set(effect.units)
    for p, example in zip(effect.parameters, VALUES[effect.name], strict=True):
        assert p.lower < p.upper and p.lower <= example <= p.upper and p.explanation
        assert p.symbol in effect.equation


# -- laws against the simulator's, which share no code with them


@pytest.mark.parametrize("name", MOTOR_LAWS)
def test_motor_law(name: str) -> None:
    extra = {"viscous": MOTION.motor_viscous} if name == "friction_drift" else {}
    law = getattr(laws, name)(**named(name), **extra)
    columns = (MOTION.time, MOTION.theta(0)[0], MOTION.theta(0)[1], MOTION.tau(0)[0])
    expected = [law(*row) for row in zip(*(c.tolist() for c in columns), strict=True)]
    np.testing.assert_allclose(value(name), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", LINK_LAWS)
def test_link_law(name: str) -> None:
    law = getattr(laws, name)(**named(name))
    columns = (MOTION.time, *MOTION.link_state(0)[:2])
    expected = [law(*row) for row in zip(*(c.tolist() for c in columns), strict=True)]
    np.testing.assert_allclose(value(name), expected, rtol=1e-12, atol=1e-12)


def test_presliding_follows_the_simulators_state() -> None:
    law = Dahl(**named("presliding_hysteresis"))
    z, step, torque = 0.0, float(MOTION.time[1]), [0.0]
    for time in MOTION.time[:-1]:
        for k in range(20):  # Euler's midpoint rule on a fine grid
            now = time + step * (k + np.array([0.0, 0.5])) / 20
            speed = MOTION.motor.at(now, 2)[1]
            half = z + 0.5 * step / 20 * law.pull(JointState(0, 0, float(speed[0]), 0, 0, 0, [z])).rates[0]
            z += step / 20 * law.pull(JointState(0, 0, float(speed[1]), 0, 0, 0, [half])).rates[0]
        torque.append(law.pull(JointState(0, 0, 0, 0, 0, 0, [z])).motor)
    # at a reversal the path within one sample is not seen: a few thousandths of the friction
    np.testing.assert_allclose(value("presliding_hysteresis"), torque, atol=5e-3 * law.coulomb)


def carried(
    law: ElasticJoint, deflection: np.ndarray, rate: np.ndarray | None = None
) -> tuple[np.ndarray, ...]:
    """θ along the motion, q = θ − deflection, and the torque the simulator's joint carries there."""
    theta, speed = MOTION.theta(0)[:2]
    rates = np.zeros_like(deflection) if rate is None else rate
    q, link_speed = theta - deflection, speed - rates
    rows = zip(theta.tolist(), q.tolist(), speed.tolist(), link_speed.tolist(), strict=True)
    return theta, q, np.array([law.torque(*row) for row in rows])


def deflection_at(name: str, torque: np.ndarray) -> np.ndarray:
    """u of a joint effect where the joint carries `torque`, shape (N,)."""
    effect = EFFECTS[name]
    assert isinstance(effect, LawEffect)
    motion = replace(MOTION.motions(0)[0], torque=torque, torque_scale=float(np.sqrt(np.mean(torque**2))))
    return effect.law(motion, np.array(VALUES[name]))[0]


@pytest.mark.parametrize("cubic", [1.0, 2e6, 5e9])
def test_hardening_is_what_the_link_side_gains(cubic: float) -> None:
    stiffness = MOTION.stiffness
    deflection = 0.03 * np.sin(1.7 * MOTION.time)
    theta, q, torque = carried(ElasticJoint(stiffness, cubic=cubic), deflection)
    effect = EFFECTS["stiffness_hardening"]
    assert isinstance(effect, LawEffect)
    u = effect.law(replace(MOTION.motions(0)[0], torque=torque), np.array([cubic]))[0]
    np.testing.assert_allclose(theta - torque / stiffness + u, q, atol=1e-12)
    x = torque / stiffness - u
    np.testing.assert_allclose(stiffness * x + cubic * x**3, torque, rtol=1e-9, atol=1e-9)


def test_backlash_is_what_the_link_side_gains() -> None:
    b = VALUES["backlash"][0]
    theta, q, torque = carried(ElasticJoint(MOTION.stiffness, half_width=b), 0.03 * np.sin(1.7 * MOTION.time))
    u = deflection_at("backlash", torque)
    assert np.all(np.abs(u) <= b)
    outside = np.abs(torque) > 0.1 * np.sqrt(np.mean(torque**2))  # within the gap the law has no answer
    assert outside.mean() > 0.8
    np.testing.assert_allclose((theta - torque / MOTION.stiffness + u)[outside], q[outside], atol=1e-12)


def test_transmission_error_is_what_the_link_side_gains() -> None:
    a, n, phase = VALUES["transmission_error"]
    joint = ElasticJoint(MOTION.stiffness, errors=((a, n, phase),))
    theta, q, torque = carried(joint, 0.03 * np.sin(1.7 * MOTION.time))
    u = deflection_at("transmission_error", torque)
    np.testing.assert_allclose(theta - torque / MOTION.stiffness + u, q, atol=1e-12)


def test_damping_is_what_the_link_side_gains() -> None:
    damping, count, omega = VALUES["joint_damping"][0], 2000, 2 * np.pi * 4
    time = (np.arange(count) + 0.5) * (1.0 / count)  # whole half-waves: even about both ends
    phase = np.arctan2(omega * damping, MOTION.stiffness)
    size = 50.0 / np.hypot(MOTION.stiffness, omega * damping)
    deflection, rate = size * np.cos(omega * time - phase), -size * omega * np.sin(omega * time - phase)
    joint = ElasticJoint(MOTION.stiffness, damping=damping)
    torque = np.array([joint.torque(d, 0.0, r, 0.0) for d, r in zip(deflection, rate, strict=True)])
    effect = EFFECTS["joint_damping"]
    assert isinstance(effect, LawEffect)
    motion = replace(MOTION.motions(0)[0], time=time, torque=torque)
    u = effect.law(motion, np.array([damping]))[0]
    assert np.abs(u).max() > 0.1 * size  # the damping is there
    np.testing.assert_allclose(torque / MOTION.stiffness - u, deflection, atol=1e-9 * size)


def test_applied_torque() -> None:
    recorded = MOTION.tau(0)[0]
    np.testing.assert_allclose(recorded - value("torque_gain"), 1.1 * recorded, rtol=1e-12)
    np.testing.assert_allclose(recorded - value("torque_limit"), np.clip(recorded, -45.0, 45.0), rtol=1e-12)
    late = MOTION.torque.at(MOTION.time - VALUES["torque_delay"][0], 1)[0]
    np.testing.assert_allclose(recorded - value("torque_delay"), late, rtol=1e-12, atol=1e-12)


def test_load_effects() -> None:
    np.testing.assert_allclose(tilted_gravity(0.05, -0.03)[0], simulated_gravity(0.05, -0.03))
    angle = MOTION.link_state(0)[0]
    x, _, z = simulated_gravity(*VALUES["base_tilt"])
    tilted, level = MOTION.arm * (x * np.sin(angle) - z * np.cos(angle)), MOTION.arm * 9.81 * np.cos(angle)
    np.testing.assert_allclose(value("base_tilt"), tilted - level, atol=1e-12)
    weight = MOTION.payload_torque("p1")[:, 0]
    np.testing.assert_allclose(value("payload_error"), 0.15 * weight, rtol=1e-12)
    torque, start, end = VALUES["external_contact"]
    step = MOTION.time[1]
    inside = (MOTION.time > start + step) & (MOTION.time < end - step)
    outside = (MOTION.time < start - step) | (MOTION.time > end + step)
    u = value("external_contact")
    assert np.all(u[inside] == -torque) and np.all(u[outside] == 0.0)
    assert -u.sum() * step == pytest.approx(torque * (end - start), rel=1e-9)
    np.testing.assert_allclose(value("motor_coupling"), 0.2 * MOTION.theta(1)[2], rtol=1e-12)


# -- slopes, flags and starts


@pytest.mark.parametrize("name", EFFECTS)
def test_slopes_against_finite_differences(name: str) -> None:
    values = np.array(VALUES[name])
    slopes = EFFECTS[name].terms(MOTION, PLACE, values).slopes[:, 0, :, 0]
    assert slopes.shape == (len(values), MOTION.count())
    for k, slope in enumerate(slopes):
        h = 1e-5 * abs(values[k])
        up, down = values.copy(), values.copy()
        up[k] += h
        down[k] -= h
        measured = (value(name, values=up) - value(name, values=down)) / (2 * h)
        np.testing.assert_allclose(slope, measured, rtol=1e-5, atol=1e-6 * np.abs(slope).max() + 1e-12)


@pytest.mark.parametrize("name", EFFECTS)
def test_linear_ones_are(name: str) -> None:
    values = np.array(VALUES[name])
    terms = EFFECTS[name].terms(MOTION, PLACE, values)
    equal = np.allclose(values @ terms.slopes[:, 0, :, 0], terms.value[0, :, 0], rtol=1e-12, atol=1e-12)
    assert equal or not EFFECTS[name].linear


@pytest.mark.parametrize("name", LAW_EFFECTS)
def test_state_says_whether_u_depends_on_what_is_identified(name: str) -> None:
    effect = EFFECTS[name]
    assert isinstance(effect, LawEffect)
    motion = MOTION.motions(0)[0]
    other = replace(
        motion,
        torque=0.8 * motion.torque + 1.0,
        torque_scale=0.8 * motion.torque_scale,
        link_position=motion.link_position + 0.01,
        link_velocity=motion.link_velocity + 0.01,
        stiffness=1.2 * motion.stiffness,
        motor_viscous=1.2 * motion.motor_viscous,
    )
    values = np.array(VALUES[name])
    assert effect.state != np.array_equal(effect.law(motion, values)[0], effect.law(other, values)[0])


@pytest.mark.parametrize("name", LAW_EFFECTS)
def test_smooth_ones_leave_nothing_undecided(name: str) -> None:
    effect = EFFECTS[name]
    assert isinstance(effect, LawEffect)
    times, _ = undecided(effect, MOTION.motions(0)[0], np.array(VALUES[name]))
    assert not (effect.smooth and len(times))
    assert effect.smooth or len(times) or effect.memory


def test_friction_of_a_velocity_that_only_touches_zero_is_undecided() -> None:
    """As far as 0.5 mrad/s of noise in the velocity, a tenth of the sign's width, moves friction."""
    effect, motion = EFFECTS["coulomb_friction"], MOTION.motions(0)[0]
    assert isinstance(effect, LawEffect)
    for least, noticed in ((0.002, True), (0.0115, True), (0.02, False)):
        dip = replace(motion, velocity=-least - 3.0 * (motion.time - 3.0) ** 2)
        moved = effect.law(replace(dip, velocity=dip.velocity + 5e-4), np.ones(1))[0]
        assert (np.ptp(moved - effect.law(dip, np.ones(1))[0]) > 2e-3) == noticed
        times, sizes = undecided(effect, dip, np.ones(1))
        assert bool(len(times)) == noticed and (sizes > 0).all()
        assert not noticed or np.abs(times - 3.0).max() < 0.1


# guesses of a limit are whole ones: tests/model/test_torque_limit.py
SMALL = [n for n, e in EFFECTS.items() if e.scope != "episode" and not e.limits_torque]


@pytest.mark.parametrize("name", SMALL)
def test_guesses_are_small_versions_of_the_effect(name: str) -> None:
    guesses = EFFECTS[name].guesses(MOTION, PLACE)
    assert guesses
    for guess in guesses:
        columns = guess.columns[:, 0, :, 0]
        top = np.abs(columns).max(axis=1)
        size = np.where(top > 0, 1e-6 / np.where(top > 0, top, 1.0), 0.0)
        c = size * np.linspace(1.0, 0.6, len(size))
        u = value(name, values=guess.to_values(c))  # type: ignore[operator]
        rest = value(name, values=guess.to_values(0 * c))  # type: ignore[operator]
        np.testing.assert_allclose(u - rest, c @ columns, atol=1e-8, err_msg=name)


# -- the pages


def test_pages_are_those_of_the_classes() -> None:
    wanted = files()
    there = {path.name: path.read_bytes() for path in FOLDER.glob("*")}
    assert sorted(there) == sorted(wanted)
    stale = [name for name, text in wanted.items() if there[name] != text.encode()]
    assert not stale, "run: python -m benchmarks.effect_pages --write"


def test_pages_link_to_files() -> None:
    for page in FOLDER.glob("*.md"):
        links = re.findall(r"\]\(([^)#\s]+)\)", page.read_text(encoding="utf-8"))
        assert links and all((page.parent / link).is_file() for link in links), page.name


@pytest.mark.parametrize("name", EFFECTS)
def test_picture_is_an_svg_with_units(name: str) -> None:
    text = (FOLDER / f"{name}.svg").read_text(encoding="utf-8")
    root = ElementTree.fromstring(text)
    labels = [node.text or "" for node in root.iter("{http://www.w3.org/2000/svg}text")]
    assert sum(label.endswith("]") for label in labels) == 2
    curves = list(root.iter("{http://www.w3.org/2000/svg}polyline"))
    assert curves and len(text) < 15_000
    assert set(re.findall(r"#[0-9a-fA-F]{6}", text)) <= {FILE.ink, *LINE_COLOURS}


@pytest.mark.parametrize("colour", [FILE.ink, *LINE_COLOURS])
def test_colours_are_seen_on_light_and_dark_pages(colour: str) -> None:
    def luminance(text: str) -> float:
        share = np.array([int(text[k : k + 2], 16) / 255 for k in (1, 3, 5)])
        return float(np.where(share > 0.04045, ((share + 0.055) / 1.055) ** 2.4, share / 12.92) @ WEIGHTS)

    for page in ("#ffffff", "#0d1117"):
        low, high = sorted((luminance(colour), luminance(page)))
        assert (high + 0.05) / (low + 0.05) > 3.0, page


WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


# -- the command


def test_command_lists_all(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects"]) == 0
    out = capsys.readouterr().out
    words = " ".join(out.split())
    for effect in EFFECTS.values():
        assert effect.name in words and effect.title in words
        for p in effect.parameters:
            assert p.name in words
    assert [name for name in re.findall(r"(?m)^ ?(\w+)  ", out) if name in EFFECTS] == list(EFFECTS)


def test_command_in_a_narrow_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("flexviz.outlets.terminal.terminal.PIPE_WIDTH", 80)
    assert main(["effects"]) == 0
    out = capsys.readouterr().out
    assert "…" not in out and max(len(line) for line in out.splitlines()) <= 80
    assert all(effect.title in out and effect.where in out for effect in EFFECTS.values())


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)
def test_command_shows_one(effect: Effect, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects", effect.name]) == 0
    words = " ".join(capsys.readouterr().out.split())
    texts = (effect.title, effect.explanation, simulated_text(effect), effect.signature, effect.confirm)
    assert all(" ".join(text.split()) in words for text in (*texts, effect.reference))
    for p in effect.parameters:
        assert f"{p.symbol}: {p.name} [{p.unit}], {bounds_text(p)}: {p.explanation}" in words


def test_command_writes_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects", "--json", "-"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == {"format": 1, "effects": [effect_json(effect) for effect in EFFECTS.values()]}
    file = tmp_path / "effects.json"
    assert main(["effects", "backlash", "--json", str(file)]) == 0
    assert "Backlash" in capsys.readouterr().out
    assert json.loads(file.read_text(encoding="utf-8"))["effects"] == [effect_json(EFFECTS["backlash"])]
