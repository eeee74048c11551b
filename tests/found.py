"""A diagnosis made by hand that carries everything one can carry, for the small set."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexviz.analysis.diagnosis import BandwidthCheck, Diagnosis, Evidence, Finding, ParameterCurve, Step
from flexviz.base.facts import Fact
from flexviz.content.records import (
    Absorbed,
    Decoys,
    EffectEntry,
    EffectParameter,
    Family,
    FreeCurve,
    Grade,
    GroupError,
    Move,
    ParameterEstimate,
    ResidualLocation,
    ResidualMap,
    Tie,
)
from flexviz.robot.model import FlexibleModel

JOINTS = ("joint1", "joint2")
TIME = np.linspace(0.0, 4.0, 200)
STEPS = 3.0 * np.sign(np.cos(2 * TIME))
TIE = Tie("link_coulomb_friction", "joint2", 0.97, "A payload twice as heavy would tell the two apart.")
ABSORBED = Absorbed("motor_viscous_friction", "joint2", 12.0, 10.1, "Nm s/rad", 30.0)
EVIDENCE = Evidence(
    "joint2", (("g1", 0, 200), ("g2", 200, 400)), np.tile(TIME, 2),
    np.tile(STEPS + 0.1 * np.sin(40 * TIME), 2), np.tile(STEPS, 2),
)  # fmt: skip
COULOMB = Finding(
    effect="coulomb_friction", joint="joint2", score=0.62, confidence=0.98,
    parameters={"coulomb": EffectParameter(3.0, 0.01, "Nm")}, inseparable_from=(TIE,), gain=400.0,
    absorbed=(ABSORBED,), evidence=EVIDENCE,
)  # fmt: skip
OFFSET = Finding(
    effect="torque_offset", joint="joint1", score=0.11, confidence=0.02,
    parameters={"offset": EffectParameter(0.4, 0.2, "Nm")}, gain=12.0,
)  # fmt: skip
MODEL = FlexibleModel(
    JOINTS, np.array([2000.0, 1500.0]), np.array([1.5, 1.0]), np.ones(2), np.ones(2), np.zeros((2, 10))
)
BEFORE = Step(
    None, (2.0, 1.0), (2.2, 1.1), (
        GroupError("g1", (2.0, 1.0), False), GroupError("g2", (2.0, 1.0), False),
        GroupError("g3", (2.2, 1.1), True),
    ), (0.01, 0.02), MODEL, verdict="missing",
)  # fmt: skip
AFTER = replace(
    BEFORE,
    added=COULOMB,
    rms=(0.02, 0.03),
    rms_validation=(0.021, 0.031),
    verdict="unknown",
    groups=(
        GroupError("g1", (0.02, 0.03), False),
        GroupError("g2", (0.02, 0.03), False),
        GroupError("g3", (0.021, 0.031), True),
    ),
)
GRADED: tuple[tuple[str, float, float, str, Grade, tuple[str, ...]], ...]


def values_of(joint: str) -> list[tuple[str, float, float, str, Grade, tuple[str, ...]]]:
    """Name, value, standard error, unit, grade and ties of a joint's parameters."""
    return [
        ("mass", 4.0, 3.0, "kg", "no", ("mx:joint1",)),
        ("izz", 1.2, 0.01, "kg m²", "yes", ()),
        ("stiffness", 1987.3, 2.1, "Nm/rad", "yes", ()),
        ("motor_inertia", 1.499, 0.0021, "kg m²", "yes", ()),
        ("link_viscous_friction", 0.9, float("inf"), "Nm s/rad", "no", ()),
        ("motor_viscous_friction", 1.1, 0.4, "Nm s/rad", "weak", (f"link_viscous_friction:{joint}",)),
    ]


PARAMETERS = (
    *(
        ParameterEstimate(name, joint, value, std, unit, identifiable, value, tied)
        for joint in JOINTS
        for name, value, std, unit, identifiable, tied in values_of(joint)
    ),
    ParameterEstimate("coulomb_friction.coulomb", "joint2", 3.0, 0.01, "Nm", "yes", 0.0),
)


def residual_map(joint: str, variable: str, unit: str, explained: float) -> ResidualMap:
    """A map with the shape that the diagnosis gives it."""
    names = {"position × direction": ("forward", "backward"), "frequency": ("residual", "noise floor")}
    curves = names.get(variable, ("",))
    centres = np.tile(np.linspace(0.5 if variable == "frequency" else -1.0, 6.0, 24), (len(curves), 1))
    mean = 0.02 * np.tanh(centres) + 0.01 * np.arange(1, len(curves) + 1)[:, None]
    mean[:, 3] = np.nan  # an empty bin
    return ResidualMap(
        joint, variable, unit, curves, centres, mean, np.full_like(mean, 0.004), np.full(mean.shape, 50),
        explained, 0.02, {"g1": explained}, (0.2, 1.0),
    )  # fmt: skip


VARIABLES = (
    ("position", "rad"), ("velocity", "rad/s"), ("acceleration", "rad/s²"), ("load", "Nm"),
    ("position × direction", "rad"), ("time", "s"), ("group", "-"), ("frequency", "Hz"),
)  # fmt: skip
MAPS = tuple(
    residual_map(
        joint, variable, unit, 0.31 if (joint, variable) == ("joint2", "velocity") else 0.01 * number
    )
    for joint in JOINTS
    for number, (variable, unit) in enumerate(VARIABLES)
)
PLACES = (
    ResidualLocation("joint2", "velocity", 0.31, (-1.0, 1.0)),
    ResidualLocation("joint1", "load", 0.03, (2.0, 9.0)),
)
CURVE = FreeCurve(
    "joint2", "velocity", "rad/s", ("",), np.linspace(-1, 1, 81), np.tanh(np.linspace(-3, 3, 81))[None],
    np.full((1, 81), 0.05), 0.4, 0.03, 1.0, Fact("curve-not-physics"),
)  # fmt: skip
NOTE = Fact("unexplained", values={"text": "what stays unexplained (Nm): joint2 0.03 (2 times the noise)"})
BANDWIDTHS = np.array([26.0, 48.0, 88.0])
GUARD = BandwidthCheck(
    BANDWIDTHS, 2, JOINTS, np.full((3, 2), 0.01), np.array([0.01, 0.02]),
    np.array([[0.0, 0.2], [0.0, 0.1], [0.0, 0.0]]), 26.0, np.array([False, True]),
    (
        ParameterCurve(
            "stiffness", "joint1", "Nm/rad", None, np.array([1980.0, 1985.0, 1987.3]), np.full(3, 2.1), 3.5,
            True,
        ),
        ParameterCurve(
            "stiffness", "joint2", "Nm/rad", None, np.array([1400.0, np.nan, 1987.3]), np.full(3, 2.1), 280.0,
            False,
        ),
    ),
    1.5,
)  # fmt: skip
TRACE = (
    Move("add", ("coulomb_friction:joint2",), (), 400.0, 12.0, True, "coarse"),
    Move("add", ("torque_offset:joint1",), (), 1.5, 1.0, False, "fine", "within its error"),
    Move(
        "swap", ("link_coulomb_friction:joint2",), ("coulomb_friction:joint2",), -3.0, 2.0, False, "fine",
        "worse",
    ),
)  # fmt: skip
FRICTION = Family("dry_friction", True, ("coulomb_friction", "link_coulomb_friction"), 0.97)
DIAGNOSIS = Diagnosis(
    set_name="small",
    verdict="missing",
    findings=(COULOMB, OFFSET),
    where=PLACES,
    steps=(BEFORE, AFTER),
    effects=(EffectEntry("coulomb_friction", {"coulomb": EffectParameter(3.0, 0.01, "Nm")}, "joint2"),),
    parameters=PARAMETERS,
    seconds=3.0,
    notes=(NOTE,),
    model=MODEL,
    maps=MAPS,
    free_curve=CURVE,
    guard=GUARD,
)
# the same data, which do not tell the two kinds of dry friction apart
TIED = replace(COULOMB, confidence=0.4, family=FRICTION)
TIED_DIAGNOSIS = replace(
    DIAGNOSIS,
    findings=(TIED, OFFSET),
    steps=(BEFORE, replace(AFTER, added=TIED)),
    trace=TRACE,
    decoys=Decoys(0, 40),
)
