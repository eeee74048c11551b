"""Friction under the names of BAM's models (github.com/Rhoban/bam), one document per joint.

    m1 dry, m2 + Stribeck, m5 + load:   F = friction_base + |load_friction_external e − load_friction_motor m|

e is gravity's torque, m the motor's. In slow motion m = −e ± F; a friction of μ_m of the load while the motor
drives and of μ_l while the load drives is then

    load_friction_motor = (μ_m − μ_l)/(μ_m + μ_l),   load_friction_external = 2 μ_m μ_l/(μ_m + μ_l) − the same
"""

from __future__ import annotations

import json
from typing import Any

from flexviz.outlets.exporting.identified import FormatFiles, IdentifiedRobot
from flexviz.outlets.exporting.servo_values import ServoJoint, servo_joints

TO_ADD = {  # what a recording without current and voltage does not show
    "actuator": "BAM's name of the servo",
    "kt": "motor constant [Nm/A] of the data sheet",
    "R": "resistance of the winding [Ohm] of the data sheet",
    "kp, error_gain, vin": "kp · error_gain · vin · kt / R is the gain [Nm/rad] in `identified`",
    "max_pwm": "max_pwm · vin · kt / R is the torque limit [Nm] in `identified`",
    "friction_viscous": "here with the motor's back-EMF: subtract kt² / R [Nm s/rad]",
}


def bam(identified: IdentifiedRobot) -> FormatFiles:
    """One JSON file."""
    missing = identified.left_out("bam")
    joints = {joint.name: parameters(joint) for joint in servo_joints(identified)}
    document = {
        "about": identified.heading, "to_add": TO_ADD, "not_contained": missing, "joints": joints,
    }  # fmt: skip
    text = json.dumps(document, indent=1, ensure_ascii=False) + "\n"
    return FormatFiles({f"{identified.name}_bam.json": text.encode()}, missing)


def parameters(joint: ServoJoint) -> dict[str, Any]:
    """All parameters of the simplest of BAM's models that has the joint's effects."""
    get = joint.get
    mean = get("load_dependent_friction.coefficient")
    forth, back = (mean + get(f"driving_friction.{side}") for side in ("motor_driving", "load_driving"))
    out: dict[str, Any] = {
        "model": "m5" if forth + back else "m2" if joint.has("stribeck_friction") else "m1",
        "armature": get("motor_inertia"),
        "friction_base": get("coulomb_friction.coulomb"),
        "friction_viscous": get("motor_viscous_friction"),
        "command_delay": get("goal_delay.delay"),
        "q_offset": 0.0,
    }
    if out["model"] != "m1":  # flexviz has a bell of the speed, alpha = 2
        out |= {"friction_stribeck": get("stribeck_friction.stribeck"), "alpha": 2.0}
        out["dtheta_stribeck"] = get("stribeck_friction.velocity") or 1.0
    if out["model"] == "m5":
        motor = (forth - back) / (forth + back)
        out["load_friction_motor"] = motor
        out["load_friction_external"] = 2.0 * forth * back / (forth + back) - motor
        out |= {"load_friction_motor_stribeck": 0.0, "load_friction_external_stribeck": 0.0}
    limit = joint.values.get("torque_limit.limit")
    return out | {"identified": {"gain": get("gain"), "torque_limit": limit}}
