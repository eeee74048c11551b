"""Numbers of messages other than JointState: which fields are signals, and their columns' names.

| in the message | columns |
|---|---|
| a JointState inside (franka_msgs/FrankaRobotState) | `/topic/measured_joint_state/joint/position` … |
| a JointTrajectoryPoint (control_msgs/JointTrajectoryControllerState) | `/topic/reference/joint/position` … |
| control_msgs/DynamicJointState | `/topic/joint/interface` |
| an array (FrankaState), a list of records (Unitree LowState) | `/topic/q[0]`, `/topic/motor_state[0].q` |
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import Any

import numpy as np

KINDS = {  # field -> what it is called per joint
    "position": "position", "velocity": "velocity", "effort": "effort",
    "positions": "position", "velocities": "velocity", "accelerations": "acceleration",
}  # fmt: skip
LONGEST = 64  # entries of an array of signals; longer ones are images, clouds, reserves
MOST_COLUMNS = 2000  # of a topic
DEFINITIONS = {  # of types that older bags name without defining them
    "control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values",
    "control_msgs/msg/DynamicJointState": (
        "std_msgs/Header header\nstring[] joint_names\ncontrol_msgs/InterfaceValue[] interface_values"
    ),
    "control_msgs/msg/JointTrajectoryControllerState": (
        "std_msgs/Header header\nstring[] joint_names\n"
        + "".join(
            f"trajectory_msgs/JointTrajectoryPoint {name}\n"
            for name in ("reference", "feedback", "error", "output")
        )
    ),
}
Step = str | int


@dataclass(frozen=True)
class MessageField:
    """Numbers in a message: the way to them, and the columns that they fill."""

    path: tuple[Step, ...]
    columns: tuple[str, ...]

    def values(self, message: Any) -> Any:
        """(k,) one number per column; NaN where a message has another number of them."""
        value: Any = message
        try:
            for step in self.path:
                value = value[step] if isinstance(step, int) else getattr(value, step)
        except (IndexError, AttributeError):
            value = ()
        numbers = (value,) if isinstance(value, Real) else value
        return numbers if len(numbers) == len(self.columns) else [np.nan] * len(self.columns)


@dataclass
class TopicNumbers:
    """The messages of one topic, collected as rows of numbers."""

    name: str
    fields: list[MessageField] = field(default_factory=list)
    stamp: list[int] = field(default_factory=list)  # [ns]
    logged: list[int] = field(default_factory=list)  # [ns]
    rows: list[np.ndarray] = field(default_factory=list)

    def add(self, message: Any, logged: int) -> None:
        """Keep the numbers of a message; the first one decides which there are."""
        if not self.fields:
            self.fields = list(signals(message, self.name))
            total = sum(len(one.columns) for one in self.fields)
            self.fields = self.fields if total <= MOST_COLUMNS else []
        if self.fields:
            header = getattr(message, "header", None)
            stamp = getattr(header, "stamp", None)
            self.stamp.append(0 if stamp is None else stamp.sec * 1_000_000_000 + stamp.nanosec)
            self.logged.append(logged)
            self.rows.append(np.concatenate([np.asarray(f.values(message), float) for f in self.fields]))

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """Name -> (N,) values."""
        names = [name for one in self.fields for name in one.columns]
        return dict(zip(names, np.array(self.rows).T, strict=True)) if self.rows else {}


def signals(
    message: Any, name: str, path: tuple[Step, ...] = (), joints: Sequence[str] = ()
) -> Iterator[MessageField]:
    """The fields of a message that hold signals, called `name/…` or `name.…`."""
    joints = getattr(message, "joint_names", None) or getattr(message, "name", None) or joints
    joints = joints if isinstance(joints, list) else []
    for key in getattr(message, "__dataclass_fields__", {}):
        value, way = getattr(message, key), (*path, key)
        if key == "header" or key.startswith("__"):
            continue
        if hasattr(value, "__dataclass_fields__"):
            yield from signals(value, f"{name}/{key}", way, joints)
        elif key == "interface_values":
            for i, (joint, one) in enumerate(zip(joints, value, strict=False)):
                yield MessageField(
                    (*way, i, "values"), tuple(f"{name}/{joint}/{x}" for x in one.interface_names)
                )
        elif isinstance(value, list) and value and hasattr(value[0], "__dataclass_fields__"):
            for i, one in enumerate(value[:LONGEST]):
                yield from records(one, f"{name}/{key}[{i}]", (*way, i))
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and 0 < len(value) <= LONGEST:
            named = key in KINDS and len(value) == len(joints)
            columns = (f"{name}/{j}/{KINDS[key]}" for j in joints) if named else (
                f"{name}/{key}[{i}]" for i in range(len(value))
            )  # fmt: skip
            yield MessageField(way, tuple(columns))


def records(one: Any, name: str, path: tuple[Step, ...]) -> Iterator[MessageField]:
    """The numbers of a record in a list."""
    for key in one.__dataclass_fields__:
        if isinstance(getattr(one, key), Real) and not isinstance(getattr(one, key), bool):
            yield MessageField((*path, key), (f"{name}.{key}",))
