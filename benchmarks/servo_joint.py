"""A servo that swings a pendulum, for `benchmarks.measuring_stick`.

One quasi-rigid joint with Coulomb and load-dependent friction, without any payload of known mass; the drawing
of its link is 10 % wrong. Two sets:

    friction   its torque is right
    scale      its torque is 1.6 times too large, as from a wrong torque constant

Without a known mass a torque scale has only the drawing to stand against. DIR/cases are the sets, DIR/truth
what is hidden in them; the simulator integrates forward dynamics and shares no law with the estimator.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.diagnosis_study.motions import random_motion
from benchmarks.diagnosis_study.robots import from_urdf, stiff_groups
from benchmarks.robotlike_study.cases import RobotCase
from benchmarks.robotlike_study.making import integration_step, write_case
from benchmarks.running import is_made, say
from flexviz.model.simulation import PDController, Plan, Reference, Sensors, perturbed
from flexviz.robot.model import EffectValue, FlexibleModel

JOINT = "servo"
STIFFNESS = 600.0  # [Nm/rad] a deflection of 1 mrad
MOTOR_INERTIA = 0.012  # [kg m²] behind the gear
MASS, CENTRE, INERTIA = 0.55, 0.14, 0.002  # of the pendulum [kg], [m], [kg m²] about its centre of mass
LINK_VISCOUS, MOTOR_VISCOUS = 0.004, 0.03  # [Nm s/rad]
COULOMB = 0.06  # [Nm]
LOAD_COEFFICIENT = 0.12  # share of the transmitted torque
SCALE = 1.6  # recorded over acting torque
MIDDLE, REACH = -1.2, 1.2  # of the motion [rad]; it hangs at −π/2
CYCLE = 0.002  # [s] of the controller
HERTZ = 5.0  # of the controller
ENCODER_STEP = 2 * np.pi / 2**14  # [rad]
TORQUE_NOISE, TORQUE_STEP = 0.005, 0.003  # [Nm]
CAD_ERROR = 0.1
KINDS = ("friction", "scale")


def pendulum_urdf() -> str:
    """One link on a horizontal axis, stretched out at zero."""
    i = f"{INERTIA:.9g}"
    return f"""<?xml version="1.0"?>
<robot name="servo">
  <link name="base"/>
  <joint name="{JOINT}" type="revolute"><parent link="base"/><child link="pendulum"/>
    <axis xyz="0 -1 0"/><limit lower="-4" upper="1" effort="10" velocity="12"/></joint>
  <link name="pendulum"><inertial><origin xyz="{CENTRE:.9g} 0 0"/><mass value="{MASS:.9g}"/>
    <inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial></link>
</robot>
"""


def plan_of(case: RobotCase, kind: str) -> Plan:
    """The joint with its motions and what is hidden in it."""
    rng = case.rng("servo")
    robot, source, files = from_urdf(pendulum_urdf())
    effects = [
        EffectValue("coulomb_friction", JOINT, {"coulomb": COULOMB}),
        EffectValue("load_dependent_friction", JOINT, {"coefficient": LOAD_COEFFICIENT}),
    ]
    if kind == "scale":
        effects.append(EffectValue("torque_gain", JOINT, {"gain_error": 1 / SCALE - 1}))
    model = FlexibleModel(
        robot.joints,
        np.array([STIFFNESS]),
        np.array([MOTOR_INERTIA]),
        np.array([LINK_VISCOUS]),
        np.array([MOTOR_VISCOUS]),
        perturbed(robot.cad_parameters, CAD_ERROR, rng),
        tuple(effects),
    )
    centre, reach = np.array([MIDDLE]), np.array([REACH])

    def motion() -> Reference:
        return random_motion(robot, rng, centre=centre, reach=reach, duration=case.duration)

    load, pulse = MOTOR_INERTIA + INERTIA + MASS * CENTRE**2, 2 * np.pi * HERTZ
    plan = Plan(
        name=case.robot,
        robot=robot,
        source=source,
        model=model,
        payloads={"none": ()},
        groups=stiff_groups(motion, case.duration, "none"),
        controller=PDController(np.array([load * pulse**2]), np.array([1.6 * load * pulse]), CYCLE),
        sensors=Sensors(torque_noise=TORQUE_NOISE, resolution=ENCODER_STEP, torque_resolution=TORQUE_STEP),
        initial_stiffness=np.array([STIFFNESS * float(np.exp(rng.uniform(-0.5, 0.5)))]).round(),
        initial_motor_inertia=np.array([MOTOR_INERTIA * float(np.exp(rng.uniform(-0.3, 0.3)))]).round(4),
        extra=False,
        files=files,
    )
    return replace(plan, step=integration_step(plan))


def make(work: Path, seed: int) -> None:
    """Simulate and write the sets that are not there."""
    for kind in KINDS:
        case = RobotCase(f"servo{seed}-{kind}", "servo", seed)
        if not is_made(work, case.name):
            write_case(work, case, plan_of(case, kind))
        say(case.name)
