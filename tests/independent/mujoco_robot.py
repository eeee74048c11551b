"""The link side in MuJoCo: one arm for every run, all in one world, so that one call moves them all."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np

from independent.arms import Arm, Array, Body, text

mujoco: Any = import_module("mujoco")  # without types


class Links:
    """Rigid arms, one a run, each with its own payload; they do not touch one another.

    Joint vectors have shape (runs · n,), run after run.
    """

    def __init__(
        self,
        arm: Arm,
        payloads: Sequence[Sequence[Body]],
        tilt: tuple[float, float] = (0.0, 0.0),
        mounted: tuple[float, float] = (0.0, 0.0),
        rotors: Sequence[float] | Array = (),
    ) -> None:
        """
        Args:
            arm: the links.
            payloads: for each run the bodies on the last link.
            tilt: the base is turned about x, then about the world's y [rad].
            mounted: the same, before that: a wall is a quarter turn, a ceiling half a turn.
            rotors: inertia that turns with each joint [kg m²], none by default.
        """
        arms = "".join(
            f'<body pos="{5 * i} 0 0" euler="{tilt[0]} {tilt[1]} 0">'
            f'<body euler="{mounted[0]} {mounted[1]} 0">{_chain(arm, 0, bodies)}</body></body>'
            for i, bodies in enumerate(payloads)
        )
        off = " ".join(
            f'{k}="disable"' for k in ("contact", "constraint", "spring", "damper", "actuation", "sensor")
        )
        # eulerseq: capitals are turns about fixed axes, as in URDF
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><compiler angle="radian" eulerseq="XYZ" balanceinertia="false"/>'
            f'<option gravity="0 0 -9.81"><flag {off} energy="enable"/></option>'
            f"<worldbody>{arms}</worldbody></mujoco>"
        )
        self.data = mujoco.MjData(self.model)
        assert self.model.nv == len(payloads) * len(arm.links)
        if len(rotors):
            self.model.dof_armature[:] = np.tile(rotors, len(payloads))

    def acceleration(self, q: Array, velocity: Array, torque: Array) -> Array:
        """q̈ [rad/s²] under joint torques [Nm]. The array is MuJoCo's own: use it before the next call."""
        data = self.data
        data.qpos[:] = q
        data.qvel[:] = velocity
        data.qfrc_applied[:] = torque
        mujoco.mj_forward(self.model, data)
        return data.qacc

    def torque(self, q: Array, velocity: Array, acceleration: Array) -> Array:
        """Joint torques [Nm] that a motion takes."""
        data = self.data
        data.qpos[:], data.qvel[:], data.qacc[:] = q, velocity, acceleration
        mujoco.mj_inverse(self.model, data)
        return data.qfrc_inverse.copy()

    def lightest(self, q: Array) -> Array:
        """Inertia that each joint feels with all others free, the diagonal of M⁻¹ inverted [kg m²]."""
        self.data.qpos[:], self.data.qvel[:] = q, 0.0
        mujoco.mj_forward(self.model, self.data)
        mass = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, mass)
        return 1.0 / np.diag(np.linalg.inv(mass))

    def energy(self, q: Array, velocity: Array) -> float:
        """Kinetic and potential energy of all arms [J]."""
        self.acceleration(q, velocity, np.zeros_like(q))
        return float(self.data.energy.sum())


def _chain(arm: Arm, k: int, payload: Sequence[Body]) -> str:
    if k == len(arm.links):
        return ""
    link = arm.links[k]
    on_it = "".join(f"<body>{_inertial(b)}</body>" for b in payload) if k + 1 == len(arm.links) else ""
    return (
        f'<body pos="{text(link.xyz)}" euler="{text(link.rpy)}">'
        f'<joint type="hinge" axis="{text(link.axis)}"/>{_inertial(link.body)}{on_it}'
        f"{_chain(arm, k + 1, payload)}</body>"
    )


def _inertial(body: Body) -> str:
    return f'<inertial pos="{text(body.com)}" mass="{body.mass!r}" fullinertia="{text(body.inertia)}"/>'
