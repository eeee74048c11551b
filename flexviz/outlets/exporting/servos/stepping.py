"""The Python file next to a MuJoCo model: how to begin, and what MJCF cannot say of its servos.

A joint with a dead band, and one whose goal has both a low-pass and a speed limit, get their goals from this
file alone: the dead band comes last, and needs the joint's position.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flexviz.model.effects import STEPPED
from flexviz.outlets.exporting.identified import IdentifiedRobot
from flexviz.outlets.exporting.servo_values import ServoJoint

MARK = "# code:\n"
LOADED = ("load_dependent_friction", "driving_friction")
BESIDE = ("goal_delay", "goal_lag", "goal_speed_limit")  # of the goal, before the dead band


@dataclass(frozen=True, eq=False)
class Stepping:
    """The file, if the model needs it, and what it contains in place of the model, one line each."""

    files: dict[str, bytes]
    left_out: list[str]


def goals_in_python(joint: ServoJoint) -> bool:
    """Whether the goals of a joint are made in Python."""
    return joint.has("dead_band") or (joint.has("goal_lag") and joint.has("goal_speed_limit"))


def loaded(joint: ServoJoint) -> bool:
    """Whether its dry friction has to be set in every step."""
    return any(joint.has(effect) for effect in LOADED)


def stepping(identified: IdentifiedRobot, joints: list[ServoJoint]) -> Stepping:
    """The file of a robot; none for servos that begin at rest and that MJCF describes."""
    moved = [
        f"{effect}:{joint.name}: MJCF has no "
        f"{'dead band behind it' if joint.has('dead_band') else 'low-pass with a speed limit'}; {STEPPED}"
        for joint in joints
        if goals_in_python(joint)
        for effect in BESIDE
        if joint.has(effect)
    ]
    if not any(loaded(j) or any(j.has(effect) for effect in (*BESIDE, "dead_band")) for j in joints):
        return Stepping({}, moved)
    code = Path(__file__).with_name("template.py").read_text(encoding="utf-8").split(MARK)[1]
    name = f"{identified.name}_servos"
    about = [
        *identified.heading, "",
        f"Servos of {identified.name}.xml in MuJoCo: what the model cannot say, added in every step.", "",
        f"    servos = {name}.Servos(model, data, goals)  # data.qpos is where the motion begins",
        "    servos.step(goals)                          # instead of mujoco.mj_step", "",
        "SPDX-License-Identifier: Apache-2.0",
    ]  # fmt: skip
    text = "\n".join(about).replace("\\", "\\\\").replace('"', "'")
    arrays = "\n".join(f"{key} = np.array({values!r})  # [{unit}]" for key, unit, values in _arrays(joints))
    head = (
        f'"""{text}\n"""\n\nfrom __future__ import annotations\n\nfrom typing import Any\n\n'
        f"import mujoco\nimport numpy as np\nfrom numpy import inf\n\n"
    )
    names = tuple(joint.name for joint in joints)
    return Stepping({f"{name}.py": f"{head}JOINTS = {names!r}\n{arrays}\n{code}".encode()}, moved)


def _arrays(joints: list[ServoJoint]) -> list[tuple[str, str, list[float]]]:
    """Name, unit and values (n,) of what the code reads."""

    def goal(parameter: str, absent: float = 0.0) -> list[float]:
        return [j.values.get(parameter, absent) if goals_in_python(j) else absent for j in joints]

    mean = [j.get("load_dependent_friction.coefficient") for j in joints]
    forth, back = (
        [m + j.get(f"driving_friction.{side}") for m, j in zip(mean, joints, strict=True)]
        for side in ("motor_driving", "load_driving")
    )
    dry = [0.0 if j.has("stribeck_friction") else j.get("coulomb_friction.coulomb") for j in joints]
    return [
        ("DELAY", "s", goal("goal_delay.delay")),
        ("TIME_CONSTANT", "s", goal("goal_lag.time_constant")),
        ("SPEED", "rad/s", goal("goal_speed_limit.speed", np.inf)),
        ("HALF_WIDTH", "rad", goal("dead_band.half_width")),
        ("COULOMB", "Nm", dry),
        ("MOTOR_DRIVING", "-", forth),
        ("LOAD_DRIVING", "-", back),
    ]
