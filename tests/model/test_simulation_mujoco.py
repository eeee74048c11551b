"""The simulator against MuJoCo, with the arm written down independently.

The links come from the XML of the URDF (not through Pinocchio). Each motor is a wheel of its own, tied to its
joint by a spring: a fixed tendon of length θ − q with stiffness K.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest

from flexviz.model.simulation import PDController, Reference, Run, Sinusoid, make_plan, simulate_run
from flexviz.robot.model import EffectValue, FlexibleModel
from flexviz.robot.robot import PayloadBody, Robot

mujoco = pytest.importorskip("mujoco")

H = 0.00025


def numbers(element: ElementTree.Element | None, key: str, default: str = "0 0 0") -> list[float]:
    return [float(x) for x in (default if element is None else element.get(key, default)).split()]


def text(values: object) -> str:
    return " ".join(repr(float(x)) for x in np.ravel(values))  # type: ignore[call-overload]


def body_of(root: ElementTree.Element, link: str, joints: tuple[str, ...], payload: list[PayloadBody]) -> str:
    """MJCF of a link and everything that hangs on it."""
    element = next(e for e in root.findall("link") if e.get("name") == link)
    parts = []
    inertial = element.find("inertial")
    mass = inertial.find("mass") if inertial is not None else None
    if inertial is not None and mass is not None and float(mass.get("value", 0)) > 0:
        tensor = inertial.find("inertia")
        assert tensor is not None
        i = [float(tensor.get(k, 0)) for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")]
        assert not any(numbers(inertial.find("origin"), "rpy"))
        com = text(numbers(inertial.find("origin"), "xyz"))
        parts.append(f'<inertial pos="{com}" mass="{mass.get("value")}" fullinertia="{text(i)}"/>')
    for body in payload:
        if body.link == link:
            parts.append(
                f'<body pos="0 0 0"><inertial pos="{text(body.com)}" mass="{body.mass}" '
                f'fullinertia="{text(body.inertia)}"/></body>'
            )
    for joint in root.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        assert parent is not None and child is not None
        if parent.get("link") != link:
            continue
        origin = joint.find("origin")
        pose = f'pos="{text(numbers(origin, "xyz"))}" euler="{text(numbers(origin, "rpy"))}"'
        name = joint.get("name", "")
        axis = text(numbers(joint.find("axis"), "xyz", "1 0 0"))
        hinge = f'<joint name="{name}" type="hinge" axis="{axis}"/>' if name in joints else ""
        inside = body_of(root, child.get("link", ""), joints, payload)
        parts.append(f"<body {pose}>{hinge}{inside}</body>")
    return "".join(parts)


def mujoco_model(
    robot: Robot, model: FlexibleModel, payload: list[PayloadBody], base_euler: tuple[float, float, float]
) -> object:
    root = ElementTree.parse(robot.urdf_path).getroot()
    children = {e.find("child").get("link") for e in root.findall("joint")}  # type: ignore[union-attr]
    base = next(e.get("name", "") for e in root.findall("link") if e.get("name") not in children)
    motors, tendons, actuators = [], [], []
    for i, joint in enumerate(robot.joints):
        b, damping = model.motor_inertia[i], model.motor_viscous_friction[i]
        motors.append(
            f'<body pos="0 {5 + i} 0"><inertial pos="0 0 0" mass="1" diaginertia="{b} {b} {b}"/>'
            f'<joint name="m_{joint}" type="hinge" axis="0 0 1" damping="{damping}"/></body>'
        )
        tendons.append(
            f'<fixed stiffness="{model.stiffness[i]}" springlength="0"><joint joint="m_{joint}" coef="1"/>'
            f'<joint joint="{joint}" coef="-1"/></fixed>'
        )
        actuators.append(f'<motor joint="m_{joint}"/>')
    xml = f"""<mujoco><compiler angle="radian" eulerseq="XYZ" balanceinertia="false"/>
      <option timestep="{H}" integrator="RK4" gravity="0 0 -9.81"><flag contact="disable"/></option>
      <worldbody><body euler="{text(base_euler)}">{body_of(root, base, robot.joints, payload)}</body>
      {"".join(motors)}</worldbody>
      <tendon>{"".join(tendons)}</tendon><actuator>{"".join(actuators)}</actuator></mujoco>"""
    compiled = mujoco.MjModel.from_xml_string(xml)
    for i, joint in enumerate(robot.joints):
        compiled.dof_damping[compiled.joint(joint).dofadr[0]] = model.link_viscous_friction[i]
    return compiled


def mujoco_run(
    robot: Robot,
    model: FlexibleModel,
    ours: Run,
    reference: Reference,
    controller: PDController,
    payload: list[PayloadBody],
    base_euler: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> tuple[np.ndarray, np.ndarray]:
    """θ and q (N, n) as MuJoCo has them, from the same state, with its own controller."""
    compiled = mujoco_model(robot, model, payload, base_euler)
    data = mujoco.MjData(compiled)
    at_q = [compiled.joint(j).qposadr[0] for j in robot.joints]  # type: ignore[attr-defined]
    at_m = [compiled.joint("m_" + j).qposadr[0] for j in robot.joints]  # type: ignore[attr-defined]
    data.qpos[at_q], data.qpos[at_m] = ours.q[0], ours.theta[0]
    data.qvel[at_q], data.qvel[at_m] = ours.q_velocity[0], ours.theta_velocity[0]
    position, velocity = reference.sample(ours.time)
    theta, q = np.empty_like(ours.theta), np.empty_like(ours.q)
    for k in range(len(ours.time)):
        theta[k], q[k] = data.qpos[at_m], data.qpos[at_q]
        data.ctrl[:] = controller.kp * (position[k] - theta[k]) + controller.kd * (
            velocity[k] - data.qvel[at_m]
        )
        mujoco.mj_step(compiled, data)
    return theta, q


@pytest.mark.parametrize("start", ["rest", "moving"])
def test_planar_arm(start: str) -> None:
    plan = make_plan("paper-b")
    model = replace(plan.model, inertial=plan.robot.cad_parameters)
    payload = [PayloadBody("link2", 1.5, [0.7, 0.1, 0.0], [0.01, 0.02, 0.025, 0.001, 0.002, -0.001])]
    reference = Sinusoid(0.7, 2.0)
    ours = simulate_run(
        plan.robot,
        model,
        payload=payload,
        reference=reference,
        controller=plan.controller,
        duration=2.0,
        start=start,
        step=H,
    )
    theta, q = mujoco_run(plan.robot, model, ours, reference, plan.controller, payload)
    np.testing.assert_allclose(ours.theta, theta, atol=1e-8)
    np.testing.assert_allclose(ours.q, q, atol=1e-8)
    assert np.ptp(q) > 0.5 and np.abs(theta - q).max() > 0.02


def test_panda_on_a_tilted_base() -> None:
    plan = make_plan("panda")
    x, y = 0.06, -0.04
    model = replace(plan.model, inertial=plan.robot.cad_parameters)
    tilted = replace(model, effects=(EffectValue("base_tilt", None, {"tilt_x": x, "tilt_y": y}),))
    payload = list(plan.payloads["p3"])
    reference = plan.groups[2].reference
    ours = simulate_run(
        plan.robot,
        tilted,
        payload=payload,
        reference=reference,
        controller=plan.controller,
        duration=1.5,
        step=H,
    )
    # R = Ry Rx; MuJoCo's "XYZ" is extrinsic: first about x, then about y
    theta, q = mujoco_run(plan.robot, model, ours, reference, plan.controller, payload, (x, y, 0.0))
    np.testing.assert_allclose(ours.theta, theta, atol=1e-8)
    np.testing.assert_allclose(ours.q, q, atol=1e-8)
    assert np.ptp(q, axis=0).min() > 0.05
