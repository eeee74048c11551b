"""Writes the problem of one measurement set, see `problem`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from benchmarks.peers.problem import FILE
from flexviz.data.measurements import MeasurementSet
from flexviz.robot._pinocchio import pin


def moving_urdf(urdf: str, joints: Sequence[str]) -> str:
    """The robot with all other joints fixed, without anything to draw or to collide with."""
    root = ElementTree.fromstring(urdf)
    for link in root.iter("link"):
        for name in ("visual", "collision"):
            for element in link.findall(name):
                link.remove(element)
    for joint in root.findall("joint"):
        if joint.get("name") not in joints:
            joint.set("type", "fixed")
            for name in ("mimic", "limit", "axis"):
                for element in joint.findall(name):
                    joint.remove(element)
    for name in ("transmission", "gazebo", "material"):
        for element in root.findall(name):
            root.remove(element)
    return ElementTree.tostring(root, encoding="unicode")


def moved_links(urdf: str, joints: Sequence[str]) -> list[str]:
    """The child link of each joint."""
    children = {}
    for joint in ElementTree.fromstring(urdf).findall("joint"):
        child = joint.find("child")
        assert child is not None
        children[joint.get("name")] = str(child.get("link"))
    return [children[name] for name in joints]


def write(measurements: MeasurementSet, effects: Sequence[str], folder: Path) -> None:
    """Write the problem into `folder`; every group must be one stretch without gaps."""
    folder.mkdir(parents=True, exist_ok=True)
    robot = measurements.robot
    urdf = moving_urdf(robot.urdf, robot.joints)
    (folder / "robot.urdf").write_text(urdf, encoding="utf-8")
    entries = []
    for group in measurements.groups:
        (segment,) = group.segments
        table: dict[str, Any] = {"time": segment.time, "theta": segment.theta, "tau": segment.tau}
        reference = group.at("theta_ref", segment.time)
        if reference is not None and np.isfinite(reference).all():
            table["reference"] = reference
        np.savez(folder / f"{group.name}.npz", allow_pickle=False, **table)
        payload = robot.payload_parameters(group.bodies).tolist()
        entries.append({"name": group.name, "validation": group.validation, "payload": payload})

    def listed(values: np.ndarray | None) -> list[float] | None:
        return None if values is None else values.tolist()

    stiffness = measurements.initial_stiffness
    inertia = measurements.initial_motor_inertia
    if inertia is None:  # half of the links' inertia, as in the paper
        start = robot.to_pin(measurements.groups[0].segments[0].theta[0])
        model = robot.model_with(robot.cad_parameters)
        inertia = 0.5 * robot.from_pin(np.diag(pin.crba(model, model.createData(), start)))
    document = {
        "folder": str(measurements.path.resolve()),
        "joints": measurements.joints,
        "links": moved_links(urdf, measurements.joints),
        "hold": measurements.torque_hold,
        "stiffness": listed(np.full(robot.n, 1e4) if stiffness is None else stiffness),
        "motor_inertia": listed(inertia),
        "kp": listed(measurements.kp),
        "kd": listed(measurements.kd),
        "effects": list(effects),
        "inertial": robot.cad_parameters.tolist(),
        "groups": entries,
    }
    (folder / FILE).write_text(json.dumps(document), encoding="utf-8")
