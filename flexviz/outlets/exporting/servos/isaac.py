"""Isaac Lab's actuators as Python text, with the 95 % intervals for randomisation.

Joints without a delay are implicit actuators; those with one are delayed PD actuators, one group per delay.
"""

from __future__ import annotations

from dataclasses import dataclass

from flexviz.outlets.exporting.identified import FormatFiles, IdentifiedRobot
from flexviz.outlets.exporting.servo_values import ServoJoint, servo_joints

PHYSICS_STEP = 0.005  # [s] of Isaac Lab's examples, for delays in whole steps
DELAY = "goal_delay.delay"
KEYS = {  # what is randomised -> parameter of a joint, unit
    "stiffness": ("gain", "Nm/rad"),
    "armature": ("motor_inertia", "kg m²"),
    "viscous_friction": ("motor_viscous_friction", "Nm s/rad"),
    "friction": ("coulomb_friction.coulomb", "Nm"),
    "effort_limit": ("torque_limit.limit", "Nm"),
    "delay": (DELAY, "s"),
}
ABOUT = (
    "damping is 0: viscous friction acts behind the torque limit, a drive's damping before it.",
    "friction and dynamic_friction [Nm] as of Isaac Sim 5.0; before that friction was a share of the load,",
    "and viscous_friction did not exist: give it as damping there.",
    "INTERVALS: 95 % intervals for randomisation, None where the data do not determine a value. Where",
    "stiffness has none, torques are known in ratio to it only: scale all rows of that joint by one factor.",
)


@dataclass(frozen=True, eq=False)
class _Group:
    """Joints of one actuator configuration; `delay` [s]."""

    name: str
    joints: list[ServoJoint]
    delay: float

    @property
    def kind(self) -> str:
        return "DelayedPDActuatorCfg" if self.delay else "ImplicitActuatorCfg"

    def lines(self) -> list[str]:
        """Its entry in the dictionary of actuators."""
        rows = {
            "stiffness": {j.name: j.get("gain") for j in self.joints},
            "damping": {j.name: 0.0 for j in self.joints},
            "armature": {j.name: j.get("motor_inertia") for j in self.joints},
            "friction": {j.name: _at_rest(j) for j in self.joints},
            "dynamic_friction": {j.name: j.get("coulomb_friction.coulomb") for j in self.joints},
            "viscous_friction": {j.name: j.get("motor_viscous_friction") for j in self.joints},
        }
        limits = {j.name: j.get("torque_limit.limit") for j in self.joints if j.has("torque_limit")}
        if limits:
            rows["effort_limit" if self.delay else "effort_limit_sim"] = limits
        out = [
            f"    {self.name!r}: {self.kind}(",
            f"        joint_names_expr={[j.name for j in self.joints]},",
        ]
        for key, values in rows.items():
            out.append(f"        {key}={{{', '.join(f'{name!r}: {v:.6g}' for name, v in values.items())}}},")
        if self.delay:
            low, high = self.joints[0].intervals[DELAY] or (self.delay, self.delay)
            out.append(f"        min_delay=math.floor({low:.6g} / PHYSICS_STEP),")
            out.append(f"        max_delay=math.ceil({high:.6g} / PHYSICS_STEP),")
        return [*out, "    ),"]


def isaac_lab(identified: IdentifiedRobot) -> FormatFiles:
    """One Python file."""
    joints, missing = servo_joints(identified), identified.left_out("isaac")
    groups = _groups(identified.name, joints)
    kinds = sorted({group.kind for group in groups})
    lines = [f"# {line}" for line in (*identified.heading, *(f"NOT CONTAINED: {x}" for x in missing), *ABOUT)]
    lines += ["", "import math", "", f"from isaaclab.actuators import {', '.join(kinds)}", ""]
    lines += [f"PHYSICS_STEP = {PHYSICS_STEP}  # [s]: set the simulation's own", ""]
    lines += [
        "ACTUATORS = {",
        *(line for group in groups for line in group.lines()),
        "}",
        "",
        "INTERVALS = {",
    ]
    for key, (parameter, unit) in KEYS.items():
        found = {j.name: j.intervals[parameter] for j in joints if parameter in j.intervals}
        if found:
            values = ", ".join(f"{name!r}: {_interval(x)}" for name, x in found.items())
            lines.append(f"    {key!r}: {{{values}}},  # [{unit}]")
    return FormatFiles({f"{identified.name}_actuators.py": "\n".join([*lines, "}", ""]).encode()}, missing)


def _groups(robot: str, joints: list[ServoJoint]) -> list[_Group]:
    """The joints by their delay."""
    delays = dict.fromkeys(j.get(DELAY) for j in joints)
    return [
        _Group(
            robot if len(delays) == 1 else f"{robot}_{k}", [j for j in joints if j.get(DELAY) == delay], delay
        )
        for k, delay in enumerate(delays)
    ]


def _at_rest(joint: ServoJoint) -> float:
    return joint.get("coulomb_friction.coulomb") + joint.get("stribeck_friction.stribeck")


def _interval(interval: tuple[float, float] | None) -> str:
    return "None" if interval is None else f"({interval[0]:.4g}, {interval[1]:.4g})"
