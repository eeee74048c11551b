"""What each effect's picture shows: its u along a motion in which it is easy to see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flexviz.content.charts import COLOURS, DASHES, FILE, Chart, ChartAxis, ChartSeries, draw_svg
from flexviz.model.effects import EFFECTS, Effect, EffectTarget
from flexviz.model.effects.trial import Array, TrialMotion, TrialSignal

PLACE = EffectTarget(joint=0, group="g1", payload="p1")
LINE_COLOURS = (COLOURS.measured, COLOURS.playhead, COLOURS.residual)  # seen on light and dark pages
HEIGHT = 250  # [pixels]
CYCLE = np.linspace(0.0, 2 * np.pi, 1601)  # [s] one turn of a motion at 1 rad/s


@dataclass(frozen=True)
class Curve:
    """An effect along a motion: its parameters, and what to call it where there are several."""

    made: TrialMotion
    values: tuple[float, ...]
    label: str = ""


@dataclass(frozen=True)
class Picture:
    """u against something.

    Attributes:
        against: text of the horizontal axis, with unit.
        x: that quantity, shape (N,), from the motion.
        curves: what is drawn.
        motion: which motion it is, for the caption.
    """

    against: str
    x: Callable[[TrialMotion], Array]
    curves: tuple[Curve, ...]
    motion: str


def wave(size: float, phase: float = 0.0, omega: float = 1.0) -> TrialSignal:
    return TrialSignal(((size, omega, phase),))


def swing(size: float = 1.0, load: float = 0.0, lead: float = 0.0) -> TrialMotion:
    """The motor swings by ±size [rad] at 1 rad/s under a load that swings `lead` [rad] before it."""
    return TrialMotion(CYCLE, wave(size), wave(load, lead))


def sweep(speed: float) -> TrialMotion:
    """The motor's speed goes once from −speed to speed [rad/s]."""
    return TrialMotion(np.linspace(-np.pi / 2, np.pi / 2, 3201), wave(speed, -np.pi / 2))


def at_temperature(degrees: float) -> TrialMotion:
    """A sweep of the speed in a run at that temperature [°C]."""
    return replace(sweep(1.5), temperature=degrees)


def loaded(speed: float) -> TrialMotion:
    """The torque goes once from −60 to 60 Nm at a steady speed [rad/s]."""
    return TrialMotion(np.linspace(-np.pi / 2, np.pi / 2, 1601), TrialSignal(slope=speed), wave(60.0))


def turn() -> TrialMotion:
    """One steady turn of the motor."""
    return TrialMotion(np.linspace(-np.pi, np.pi, 1601), TrialSignal(slope=1.0), TrialSignal())


def creeping() -> TrialMotion:
    """Back and forth about two positions by a few hundredths of a radian."""
    path = TrialSignal(((0.08, 1.0, 0.0), (0.05, 5.0, 0.0)))
    return TrialMotion(np.linspace(0.0, 3 * np.pi, 4001), path)


def later(seconds: float, omega: float, size: float = 1.0, samples: int = 3001) -> TrialMotion:
    """A swing over `seconds`."""
    return TrialMotion(np.linspace(0.0, seconds, samples), wave(size / omega, 0.0, omega))


def theta(made: TrialMotion) -> Array:
    return made.theta(0)[0]


def velocity(made: TrialMotion) -> Array:
    return made.theta(0)[1]


def torque(made: TrialMotion) -> Array:
    return made.tau(0)[0]


def torque_rate(made: TrialMotion) -> Array:
    return made.tau(0)[1]


def link_angle(made: TrialMotion) -> Array:
    return made.link_state(0)[0]


def time(made: TrialMotion) -> Array:
    return made.time


VELOCITY, POSITION = "motor velocity θ̇ [rad/s]", "motor position θ [rad]"
LINK_VELOCITY, LINK_POSITION = "link velocity q̇ [rad/s]", "link position q [rad]"
LOAD, LOAD_RATE = "transmitted torque s [Nm]", "transmitted torque's rate ṡ [Nm/s]"
SWEEP, TURN = "a sweep of the speed", "a steady turn"
LOADING = "a sweep of the torque"

PICTURES: dict[str, Picture] = {
    "coulomb_friction": Picture(VELOCITY, velocity, (Curve(sweep(0.5), (2.0,)),), SWEEP),
    "stribeck_friction": Picture(
        VELOCITY,
        velocity,
        (Curve(sweep(0.5), (1.5, 0.1), "velocity 0.1 rad/s"), Curve(sweep(0.5), (1.5, 0.2), "0.2 rad/s")),
        SWEEP,
    ),
    "quadratic_friction": Picture(VELOCITY, velocity, (Curve(sweep(2.0), (0.8,)),), SWEEP),
    "directional_friction": Picture(VELOCITY, velocity, (Curve(sweep(2.0), (0.4,)),), SWEEP),
    "thinning_friction": Picture(
        VELOCITY, velocity,
        (Curve(sweep(1.5), (0.5, 0.05), "velocity 0.05 rad/s"), Curve(sweep(1.5), (0.5, 0.3), "0.3 rad/s")),
        SWEEP,
    ),
    "load_dependent_friction": Picture(
        LOAD,
        torque,
        (Curve(loaded(0.3), (0.05,), "forwards"), Curve(loaded(-0.3), (0.05,), "backwards")),
        LOADING + " in both directions",
    ),
    "driving_friction": Picture(
        LOAD,
        torque,
        (Curve(loaded(0.3), (0.05, 0.12), "forwards"), Curve(loaded(-0.3), (0.05, 0.12), "backwards")),
        LOADING + " in both directions",
    ),
    "presliding_hysteresis": Picture(
        POSITION, theta, (Curve(creeping(), (200.0, 2.0)),), "a motion with small turns back, from rest"
    ),
    "startup_friction": Picture(
        POSITION, theta, (Curve(TrialMotion(CYCLE / 4, wave(0.15, -np.pi / 2, 4.0)), (2.0, 0.02)),),
        "a quick swing that begins at rest",
    ),
    "friction_drift": Picture(
        "time in the group t [s]", time, (Curve(later(40.0, 2 * np.pi / 4), (1.0, 10.0)),),
        "a steady swing, f_mv 2 Nm s/rad",
    ),
    "temperature_friction": Picture(
        VELOCITY, velocity,
        tuple(Curve(at_temperature(t), (0.04, 0.02), f"{t:g} °C") for t in (10.0, 30.0, 50.0)),
        SWEEP + " in runs at three temperatures",
    ),
    "torque_ripple": Picture(POSITION, theta, (Curve(turn(), (1.0, 6.0, 0.5)),), TURN),
    "torque_offset": Picture(POSITION, theta, (Curve(swing(np.pi), (1.5,)),), "a swing"),
    "torque_gain": Picture("recorded torque τ [Nm]", torque, (Curve(swing(1.0, 60.0), (0.05,)),), "a swing"),
    "torque_delay": Picture(
        "recorded torque's rate τ̇ [Nm/s]", torque_rate,
        (Curve(TrialMotion(CYCLE / 5, wave(1.0, 0.0, 5.0), wave(60.0, 0.0, 5.0)), (0.002,)),),
        "a swing at 5 rad/s",
    ),
    "torque_limit": Picture("recorded torque τ [Nm]", torque, (Curve(swing(1.0, 60.0), (45.0,)),), "a swing"),
    "stiffness_hardening": Picture(LOAD, torque, (Curve(loaded(0.3), (2e7,)),), LOADING + ", K 5000 Nm/rad"),
    "backlash": Picture(LOAD, torque, (Curve(loaded(0.3), (0.001,)),), LOADING),
    "joint_damping": Picture(
        LOAD_RATE, torque_rate, (Curve(swing(1.0, 60.0, np.pi / 2), (20.0,)),),
        "a swing at 1 rad/s, K 5000 Nm/rad",
    ),
    "transmission_error": Picture(POSITION, theta, (Curve(turn(), (0.0005, 4.0, 0.5)),), TURN),
    "link_coulomb_friction": Picture(
        LINK_VELOCITY, lambda made: made.link_state(0)[1], (Curve(sweep(0.5), (2.0,)),), SWEEP
    ),
    "cable_spring": Picture(LINK_POSITION, link_angle, (Curve(swing(np.pi / 2), (3.0, 0.5)),), "a swing"),
    "gravity_compensator": Picture(LINK_POSITION, link_angle, (Curve(turn(), (12.0, 5.0)),), "a slow turn"),
    "payload_error": Picture(
        LINK_POSITION, link_angle, (Curve(turn(), (0.1,)),), "a slow turn, payload's weight moment 1.5 kg m"
    ),
    "base_tilt": Picture(
        LINK_POSITION,
        link_angle,
        (Curve(turn(), (0.0, 0.05), "tilt_y 0.05 rad"), Curve(turn(), (0.0, -0.03), "−0.03 rad")),
        "a slow turn of an arm (4 kg m) that swings from the base's x to its z",
    ),
    "external_contact": Picture(
        "time in the group t [s]", time, (Curve(later(10.0, 1.0, samples=5001), (8.0, 4.0, 5.5)),),
        "any motion",
    ),
    "motor_coupling": Picture(
        "neighbouring motor's acceleration [rad/s²]", lambda made: made.theta(1)[2],
        (Curve(TrialMotion(CYCLE, TrialSignal(), wave(0.0), wave(3.0)), (0.2,)),),
        "a swing of the neighbour alone",
    ),
    "coupled_friction": Picture(
        "sum of both motors' velocities [rad/s]", lambda made: made.theta(0)[1] + made.theta(1)[1],
        (Curve(replace(sweep(0.3), neighbour=wave(0.2, -np.pi / 2)), (1.5, 1.0)),),
        "a sweep of both speeds",
    ),
}  # fmt: skip


def curve(effect: Effect, wanted: Curve) -> Array:
    """u along the motion, shape (N,)."""
    return effect.terms(wanted.made, PLACE, np.array(wanted.values)).value[0, :, 0]


def draw(name: str) -> str:
    """The picture of an effect as SVG text."""
    effect, shown = EFFECTS[name], PICTURES[name]
    scale, unit = (1e3, "mrad") if effect.entry == "deflection" else (1.0, "Nm")
    series = [
        ChartSeries(c.label, colour, shown.x(c.made), scale * curve(effect, c), 2.0, dash)
        for c, colour, dash in zip(shown.curves, LINE_COLOURS, DASHES, strict=False)
    ]
    title = f"{effect.title}: u against {shown.against}"
    chart = Chart(
        name, title, ChartAxis(shown.against), ChartAxis("u", unit), tuple(series), description=caption(name),
        height=HEIGHT,
    )  # fmt: skip
    return draw_svg(chart, name, FILE)


def caption(name: str) -> str:
    """Under the picture: the motion and the parameters drawn."""
    effect, shown = EFFECTS[name], PICTURES[name]
    parts = []
    for k, parameter in enumerate(effect.parameters):
        drawn = dict.fromkeys(f"{c.values[k]:g}".replace("-", "−") for c in shown.curves)
        unit = "" if parameter.unit == "-" else f" {parameter.unit}"
        parts.append(f"{parameter.name} {' and '.join(drawn)}{unit}")
    return f"u along {shown.motion}: {', '.join(parts)}."
