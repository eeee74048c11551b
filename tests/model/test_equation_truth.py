"""The equation is zero where the physics is: motion prescribed, torques by inverse dynamics on paper.

The link moves along sines that repeat after a period. Its torque is Pinocchio's own `rnea`; deflection, motor
and sensor follow by Fourier series, which differentiate exactly. Nothing of the equation or effects is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.data.measurements import Group, MeasurementSet, Segment
from flexviz.model.effects import ChosenEffect
from flexviz.model.equation import Equation, Layout, LinkDynamics, Pulses, build_signals
from flexviz.model.equation.context import EffectContext
from flexviz.model.observers import FlatZeroPhase
from flexviz.model.simulation import laws
from flexviz.robot._pinocchio import pin
from flexviz.robot.robot import PayloadBody, Robot

PERIOD, STEP, HOLD = 8.0, 1e-3, 1e-3
TIME = STEP * np.arange(round(PERIOD / STEP))
Offered = tuple[Equation, EffectContext]
Hidden = dict[tuple[str, int | None], tuple[float, ...]]
SMOOTH: Hidden = {  # effect and joint → parameters
    ("quadratic_friction", 0): (0.7,),
    ("directional_friction", 1): (0.4,),
    ("thinning_friction", 1): (0.9, 0.15),
    ("friction_drift", 0): (0.8, 2.5),
    ("temperature_friction", 1): (0.03, 0.0),
    ("torque_ripple", 0): (1.2, 3.0, 0.4),
    ("torque_offset", 1): (2.0,),
    ("torque_gain", 0): (0.1,),
    ("transmission_error", 1): (0.004, 2.0, 0.7),
    ("cable_spring", 0): (3.0, 0.2),
    ("gravity_compensator", 1): (6.0, -2.5),
    ("payload_error", None): (0.15,),
    ("motor_coupling", 0): (0.2,),
    ("coupled_friction", 0): (0.0, 0.8),
}
SHARP: Hidden = {
    ("stribeck_friction", 0): (1.5, 0.3),
    ("coulomb_friction", 1): (2.0,),
    ("load_dependent_friction", 1): (0.08,),
    ("temperature_friction", 1): (0.03, 0.02),
    ("base_tilt", None): (0.05, -0.03),
    ("torque_delay", None): (0.002,),
}
DAMPED: Hidden = {
    ("joint_damping", 0): (12.0,),
    ("stiffness_hardening", 0): (2e4,),
    ("quadratic_friction", 0): (0.7,),
    ("torque_ripple", 0): (1.2, 3.0, 0.4),
}
FEW: Hidden = {("cable_spring", 0): (3.0, 0.2), ("torque_offset", 1): (2.0,)}
STIFFNESS, INERTIA = np.array([1000.0, 1400.0]), np.array([1.3, 0.8])
LINK_VISCOUS, MOTOR_VISCOUS = np.array([0.9, 1.6]), np.array([0.7, 1.1])
PAYLOAD = PayloadBody("link2", 1.5, [0.1, 0.02, 0.05], [0.01, 0.02, 0.03, 0, 0, 0])
DEGREES = np.array([35.0, 48.0])


def rate(y: np.ndarray) -> np.ndarray:
    """ẏ of what repeats after the period, shape (N, …); above 60 Hz there is nothing but rounding."""
    omega = 2j * np.pi * np.fft.rfftfreq(len(y), STEP)
    omega[np.abs(omega) > 2 * np.pi * 60] = 0.0
    return np.fft.irfft(np.fft.rfft(y, axis=0) * omega.reshape(-1, *[1] * (y.ndim - 1)), len(y), axis=0)


def later(y: np.ndarray, seconds: float) -> np.ndarray:
    """y(t + seconds) of what repeats after the period."""
    omega = 2j * np.pi * np.fft.rfftfreq(len(y), STEP)
    return np.fft.irfft(np.fft.rfft(y) * np.exp(omega * seconds), len(y))


def link_motion(seed: int, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    q = np.zeros((len(TIME), n))
    for k in (1, 2, 3, 5, 8):
        q += 0.5 / k**0.5 * np.sin(2 * np.pi * k / PERIOD * TIME[:, None] + rng.uniform(0, 6, n))
    return q, rate(q), rate(rate(q))


def rnea(model: Any, rows: Sequence[np.ndarray]) -> np.ndarray:
    data = model.createData()
    return np.array([pin.rnea(model, data, *row) for row in zip(*rows, strict=True)])


def recorded(robot: Robot, bodies: tuple[PayloadBody, ...], hidden: Hidden, seed: int) -> Segment:
    """θ and τ of one run with hidden effects of `TRUTH`."""

    def values(name: str, joint: int | None) -> tuple[float, ...]:
        return hidden.get((name, joint), (0.0, 0.0, 0.0))

    q, v, _ = motion = link_motion(seed, robot.n)
    error = 1 + values("payload_error", None)[0]
    heavier = [replace_mass(body, error) for body in bodies]
    model = robot.model_with(robot.cad_parameters, heavier)
    tilt_x, tilt_y = values("base_tilt", None)[:2]
    turned = pin.utils.rotate("y", tilt_y) @ pin.utils.rotate("x", tilt_x)
    model.gravity.linear = turned.T @ model.gravity.linear
    load = rnea(model, motion) + LINK_VISCOUS * v
    for j in range(robot.n):
        for name in ("cable_spring", "gravity_compensator"):
            if (name, j) in hidden:
                law = getattr(laws, name)(*hidden[name, j])
                load[:, j] += [law(*row) for row in zip(TIME, q[:, j], v[:, j], strict=True)]
    omega = 2j * np.pi * np.fft.rfftfreq(len(TIME), STEP)
    theta, tau = np.empty_like(q), np.empty_like(q)
    for j in range(robot.n):
        cubic, damping = values("stiffness_hardening", j)[0], values("joint_damping", j)[0]
        x = np.zeros(len(TIME))
        for _ in range(40):
            x = np.fft.irfft(
                np.fft.rfft(load[:, j] - cubic * x**3) / (STIFFNESS[j] + omega * damping), len(x)
            )
        amplitude, order, phase = values("transmission_error", j)
        theta[:, j] = q[:, j] + x
        for _ in range(40):
            theta[:, j] = q[:, j] + x - amplitude * np.sin(order * theta[:, j] + phase)
    speed, push = rate(theta), rate(rate(theta))
    for j in range(robot.n):
        tau[:, j] = INERTIA[j] * push[:, j] + MOTOR_VISCOUS[j] * speed[:, j] + load[:, j]
        tau[:, j] += values("motor_coupling", j)[0] * push[:, 1 - j]
        more = {"friction_drift": (MOTOR_VISCOUS[j],), "temperature_friction": (DEGREES[j],)}
        rows = [column.tolist() for column in (TIME, theta[:, j], speed[:, j], load[:, j])]
        for (name, joint), size in hidden.items():
            if name == "coupled_friction":
                law = laws.coupled_friction(*size)
                tau[:, j] += [law(*row) for row in speed.tolist()]
            elif joint == j and name.endswith(("friction", "drift", "ripple", "offset")):
                law = getattr(laws, name)(*size, *more.get(name, ()))
                tau[:, j] += [law(*row) for row in zip(*rows, strict=True)]
        tau[:, j] /= 1 + values("torque_gain", j)[0]
        tau[:, j] = later(tau[:, j], values("torque_delay", None)[0] + HOLD / 2)
    return Segment(TIME, theta, tau, STEP)


def replace_mass(body: PayloadBody, factor: float) -> PayloadBody:
    return PayloadBody(body.link, factor * body.mass, body.com, factor * np.asarray(body.inertia))


def exact_set(robot: Robot, hidden: Hidden) -> MeasurementSet:
    """Two groups, the second with a payload and a gap in its record."""
    groups = []
    for k, bodies in enumerate(((), (PAYLOAD,))):
        whole = recorded(robot, bodies, hidden, k)
        cuts = (0, len(TIME)) if k == 0 else (0, 3990, len(TIME))
        parts = [slice(*cut) for cut in pairwise(cuts)]
        segments = tuple(Segment(TIME[p], whole.theta[p], whole.tau[p], STEP) for p in parts)
        names = f"g{k}", f"t{k}", f"p{k}"
        groups.append(Group(*names, bodies, False, Path("none"), segments, TIME, temperature=DEGREES))
    payloads = {group.payload: group.bodies for group in groups}
    return MeasurementSet(
        Path("none"),
        "exact",
        robot,
        robot.joints,
        HOLD,
        None,
        None,
        None,
        None,
        (),
        payloads,
        tuple(groups),
        True,
    )


def all_columns(pulses_: Pulses, begin: int = 0) -> np.ndarray:
    """Of the samples of a stretch from `begin` to the last one in which they count, (N, n, M)."""
    out = np.zeros((pulses_.rows.stop - begin, 2, pulses_.count))
    at = 0
    for group in pulses_.groups:
        count = group.columns.shape[2]
        out[group.first - begin :][: len(group.columns), :, at : at + count] = group.columns
        at += count
    return out


def at_the_truth(hidden: Hidden, hertz: float, drop: float) -> tuple[Equation, np.ndarray]:
    """The equation of a set with hidden effects, and their true parameter vector."""
    robot = Robot.load("robots:planar_2r")
    measurements = exact_set(robot, hidden)
    payload = {"payload_error": "p1"}
    layout = Layout(robot.joints, tuple(ChosenEffect(e, j, payload=payload.get(e)) for e, j in hidden))
    observer = FlatZeroPhase(2 * np.pi * hertz)
    signals = build_signals(measurements, measurements.groups, observer, sample_step=0.02, drop=(drop, drop))
    x = np.zeros(layout.size)
    x[layout.inertial] = robot.cad_parameters.ravel()
    x[layout.compliance], x[layout.motor_inertia] = 1 / STIFFNESS, INERTIA
    x[layout.link_viscous], x[layout.motor_viscous] = LINK_VISCOUS, MOTOR_VISCOUS
    for effect, where in layout.effect_slices():
        x[where] = hidden[effect.effect, effect.joint]
    return Equation(robot, signals, layout), x


@pytest.mark.parametrize(
    ("hidden", "hertz", "drop", "share"),
    [(SMOOTH, 14.0, 1.2, 1e-3), (SHARP, 5.0, 1.6, 0.05), (DAMPED, 14.0, 0.6, 0.01)],
    ids=["smooth", "sharp", "damped"],
)
def test_zero_at_the_truth(hidden: Hidden, hertz: float, drop: float, share: float) -> None:
    """A wrong sign, unit or place of one effect would bias every parameter that is identified with it."""
    equation, x = at_the_truth(hidden, hertz, drop)
    found = equation.evaluate(x)
    left = np.abs(found.residual).max()
    for effect, where in equation.layout.effect_slices():
        size = np.abs(found.jacobian[:, :, where] @ x[where]).max()  # without it, about so much would be left
        assert left < share * size, effect


@pytest.fixture(scope="module")
def offered() -> Offered:
    """What effects are offered at the truth of a set that hides an offset and a cable spring."""
    equation, x = at_the_truth(FEW, 14.0, 1.2)
    return equation, equation.at(x).context


def runs() -> list[tuple[np.ndarray, ...]]:
    """Of every stretch, exact θ (5), τ (4), q (3) with derivatives, and load along the period."""
    out = []
    robot = Robot.load("robots:planar_2r")
    for k, bodies in enumerate(((), (PAYLOAD,))):
        segment = recorded(robot, bodies, FEW, k)
        theta, tau = [segment.theta], [np.stack([later(y, -HOLD / 2) for y in segment.tau.T], axis=1)]
        for levels, count in ((theta, 5), (tau, 4)):
            while len(levels) < count:
                levels.append(rate(levels[-1]))
        q = np.stack(link_motion(k, robot.n))
        load = tau[0] - INERTIA * theta[2] - MOTOR_VISCOUS * theta[1]
        out.append((np.stack(theta), np.stack(tau), q, load))
    return [out[0], out[1], out[1]]


def test_signals_are_the_motion_and_its_derivatives(
    offered: Offered,
) -> None:
    """Time, stretches and levels, per joint: everything that is identified starts from them."""
    equation, context = offered
    signals = equation.signals
    assert (context.count(), context.joints()) == (signals.count, 2) == (len(signals.time), 2)
    assert [b.group for b in signals.blocks] == [0, 1, 1] and signals.blocks[-1].rows.stop == signals.count
    for block, (theta, tau, q, _) in zip(signals.blocks, runs(), strict=True):
        time = signals.time[block.rows]
        np.testing.assert_allclose(np.diff(time), 8e-3)  # 2π/(8 · 88 rad/s), whole fine steps
        own = block.segment.time
        assert time[0] - own[0] == pytest.approx(1.2, abs=0.02) == pytest.approx(own[-1] - time[-1], abs=0.02)
        np.testing.assert_allclose(own[:: block.stride][signals.kept(block)], time)
        at = np.round(time / STEP).astype(int)
        for j in range(2):
            late = np.stack([later(level, -0.003) for level in tau[:, :, j]])
            seen = [
                (context.theta(j), theta[:, at, j]), (context.tau(j), tau[:, at, j]),
                (context.delayed_tau(j, 0.003), late[:, at]), (context.link_state(j), q[:, at, j]),
            ]  # fmt: skip
            for found, exact in seen:
                for k, level in enumerate(exact):
                    np.testing.assert_allclose(found[k, block.rows], level, atol=2e-4 * np.abs(level).max())
        assert context.in_group(f"g{block.group}")[block.rows].all()
        assert not context.in_group(f"g{1 - block.group}")[block.rows].any()


def test_wide_band_motion_is_the_motion(offered: Offered) -> None:
    """Friction is evaluated along it: its torque, speed and scale have to be those of the joint."""
    context = offered[1]
    for j in range(2):
        motions, squares = context.motions(j), []
        for motion, (theta, _, q, load) in zip(motions, runs(), strict=True):
            at = np.round(motion.time / STEP).astype(int)
            assert motion.step == pytest.approx(2e-3) and motion.temperature == DEGREES[j]
            assert motion.stiffness == pytest.approx(STIFFNESS[j])
            assert motion.motor_viscous == MOTOR_VISCOUS[j]
            inner = slice(610, -610)  # where the equation has samples
            offset = 2.0 if j else 0.0  # friction is not transmitted where the equation knows it
            exact = {
                "position": theta[0], "velocity": theta[1], "torque": load - offset,
                "link_position": q[0], "link_velocity": q[1],
            }  # fmt: skip
            for name, signal in exact.items():
                wanted = signal[at, j]
                found = getattr(motion, name)[inner]
                np.testing.assert_allclose(
                    found, wanted[inner], atol=1e-3 * np.abs(wanted).max(), err_msg=name
                )
            squares.append(motion.torque**2)
        assert motions[0].torque_scale == pytest.approx(np.sqrt(np.mean(np.concatenate(squares))))
        assert {name for name in motions[0].present} == ({"torque_offset"} if j else {"cable_spring"})


def test_weights_offered_to_effects(offered: Offered) -> None:
    """The payload's torque in the runs that carry it, and the torque of gravity from any side."""
    equation, context = offered
    robot, cad = equation.robot, equation.robot.cad_parameters
    none = (0.0, 0.0, 0.0)
    for block in equation.signals.blocks:
        bodies = (PAYLOAD,) if block.group else ()
        motion = [context._q[k, block.rows] for k in range(3)]
        rest = [motion[0], 0 * motion[0], 0 * motion[0]]
        carried = rnea(robot.model_with(cad, bodies), motion) - rnea(robot.model_with(cad), motion)
        np.testing.assert_allclose(context.payload_torque("p1")[block.rows], carried, atol=1e-9)
        for axis, unit in enumerate(np.eye(3)):
            pulled, free = (rnea(robot.model_with(cad, bodies, g), rest) for g in (unit.tolist(), none))
            weight = pulled - free
            np.testing.assert_allclose(context.gravity_torque(axis)[block.rows], weight, atol=1e-9)
    assert np.abs(context.gravity_torque(0)).max() > 0.1 and np.abs(context.payload_torque("p1")).max() > 1.0
    for model in (equation.link._model, equation.link._many):
        np.testing.assert_array_equal(model.gravity.linear, robot.model.gravity.linear)


@pytest.mark.parametrize(
    "names", [None, ["elbow_joint", "wrist_1_joint", "shoulder_lift_joint"], ["elbow_joint"]]
)
def test_link_torques_are_those_of_pinocchio(names: list[str] | None) -> None:
    """In the order of the set's joints, whatever the order of the chain."""
    robot = Robot.load("example-robot-data:ur5", names)
    link, rng = LinkDynamics(robot), np.random.default_rng(1)
    count = 29  # no whole number of as many as are evaluated at a time
    rows: Any = tuple(rng.uniform(-2, 2, (3, count, robot.n)))
    data, model = robot.model.createData(), robot.model_with(robot.cad_parameters)
    rnea_rows = zip(*(robot.to_pin(level) for level in rows), strict=True)
    exact = robot.from_pin(np.array([pin.rnea(model, data, *row) for row in rnea_rows]))
    regressor = np.empty((count, robot.n, 10 * robot.n))
    blocks = [(slice(0, 2), 2 * robot.cad_parameters), (slice(2, count), robot.cad_parameters)]
    terms = link.evaluate(blocks, rows[0], rows[1], rows[2], regressor)
    for part in (slice(5), slice(1), slice(0)):
        torque = link.torque(robot.cad_parameters, *(row[part] for row in rows))
        np.testing.assert_allclose(torque, exact[part], atol=1e-9)
    np.testing.assert_allclose(regressor @ robot.cad_parameters.ravel(), exact, atol=1e-9)
    np.testing.assert_allclose(link.regressor(*rows), regressor, atol=1e-12)
    for level, slopes in enumerate((terms.dq, terms.dv, terms.mass)):
        for j in range(robot.n):
            moved = []
            for sign in (1, -1):
                other = [row.copy() for row in rows]
                other[level][:, j] += sign * 1e-6
                moved.append(link.torque(robot.cad_parameters, *other))
            slope = (moved[0] - moved[1]) / 2e-6
            slope[:2] *= 2  # of bodies twice as heavy
            np.testing.assert_allclose(slopes[:, :, j], slope, atol=1e-6)
    empty = link.torque(np.zeros((robot.n, 10)), *rows)
    assert not empty.any()  # a body without mass


def test_the_slope_of_friction_that_follows_the_torque(monkeypatch: pytest.MonkeyPatch) -> None:
    """∂u/∂s ∂s/∂x where the operating point follows x; without it a fit overshoots and never ends."""
    monkeypatch.setattr("flexviz.model.equation.residual.MAX_STATE_ITERATIONS", 60)
    monkeypatch.setattr("flexviz.model.equation.residual.STATE_TOLERANCE", 1e-12)
    equation, x = at_the_truth({("load_dependent_friction", 1): (0.4,)}, 8.0, 1.2)
    layout, seen = equation.layout, equation.at(x)
    moving, fixed = (seen.evaluate(x, moving=each).jacobian for each in (True, False))
    for k in (layout.motor_inertia.start + 1, layout.motor_viscous.start + 1):
        ends = []
        for side in (1.0, -1.0):
            there = x.copy()
            there[k] += side * 1e-4 * x[k]
            assert equation.at(there, seen) is seen and equation.at(there, seen, moving=True) is not seen
            ends.append(equation.at(there, seen, moving=True).residual(there))
        slope = (ends[0] - ends[1]) / (2e-4 * x[k])
        of_moving, of_fixed = (np.linalg.norm(each[:, :, k] - slope) for each in (moving, fixed))
        # products of filtered signals stand for filtered products
        assert of_moving < 0.2 * np.linalg.norm(slope) and of_fixed > 0.4 * np.linalg.norm(slope)
