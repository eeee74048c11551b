"""A design as lines of text and as files: references as CSV and ROS 2 JointTrajectory, errors as JSON."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from flexviz.analysis.designing.motion import Reached
from flexviz.analysis.designing.run import Design
from flexviz.analysis.designing.subject import Planned
from flexviz.base.arrays import Array
from flexviz.base.facts import Fact
from flexviz.base.files import as_json, named_errors, whole_folder
from flexviz.data.measurements import check_free
from flexviz.model.simulation import Fourier
from flexviz.robot.model import INERTIAL_NAMES

CSV_STEP = 0.001  # [s]
TRAJECTORY_STEP = 0.02  # [s] between the points that a trajectory controller interpolates
DIGITS = 9
MOST_LIMITS = 3  # per group
FROM_PRIOR = 0.5  # share of a variance from the prior, above which the motion does not show a parameter
KEPT = (
    "subject", "joints", "criterion", "unit", "value", "separates", "gains", "recorded_gains", "beside",
    "seed", "evaluations", "seconds", "stopped",
)  # fmt: skip


def design_files(design: Design) -> dict[str, str]:
    """File name → content: per group a CSV and a YAML file, and `design.json` and `summary.txt`."""
    files = {}
    for group in design.groups:
        files[f"{group.planned.name}.csv"] = reference_csv(group.planned, design.joints)
        files[f"{group.planned.name}.yaml"] = trajectory_yaml(group.planned, design.joints)
    files["design.json"] = as_json(design_document(design))
    files["summary.txt"] = "\n\n".join(fact.text for fact in design_facts(design)) + "\n"
    return files


def write_design(design: Design, folder: str | Path) -> Path:
    """Write the files of a design to a new folder: all of them or none.

    Raises:
        InputError: the folder is not empty, or cannot be written.
    """
    path = Path(folder)
    check_free(path)
    with named_errors(path), whole_folder(path.absolute()) as new:
        for name, content in design_files(design).items():
            (new / name).write_text(content, encoding="utf-8")
    return path


def reference_levels(planned: Planned, step: float) -> tuple[Array, Array, Array, Array]:
    """Time (N,) [s], position, velocity and acceleration (N, n) of a reference."""
    count = int(np.ceil(planned.duration / step - 1e-9))
    time = np.append(np.arange(count) * step, planned.duration)
    position, velocity = planned.reference.sample(time)
    near = 1e-5
    after, before = (
        planned.reference.sample(np.clip(time + d, 0.0, planned.duration)) for d in (near, -near)
    )
    gap = np.clip(time + near, 0.0, planned.duration) - np.clip(time - near, 0.0, planned.duration)
    return time, position, velocity, (after[1] - before[1]) / gap[:, None]


def reference_csv(planned: Planned, joints: Sequence[str]) -> str:
    """Time and, per joint, position [rad], velocity [rad/s] and acceleration [rad/s²] of the reference."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    kinds = ("theta_ref", "velocity_ref", "acceleration_ref")
    writer.writerow(["time", *(f"{kind}_{joint}" for kind in kinds for joint in joints)])
    time, *levels = reference_levels(planned, CSV_STEP)
    for row in np.concatenate([time[:, None], *levels], axis=1):
        writer.writerow([_text(value) for value in row])
    return out.getvalue()


def trajectory_yaml(planned: Planned, joints: Sequence[str]) -> str:
    """A trajectory_msgs/msg/JointTrajectory as YAML, as `ros2 topic pub` and controllers read it."""
    from ruamel.yaml import YAML

    time, *levels = reference_levels(planned, TRAJECTORY_STEP)
    points = []
    for k, instant in enumerate(time):
        nanoseconds = round(float(instant) * 1e9)
        rows = [[float(_text(value)) for value in level[k]] for level in levels]
        named: dict[str, Any] = dict(zip(("positions", "velocities", "accelerations"), rows, strict=True))
        named["time_from_start"] = {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
        points.append(named)
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    yaml, out = YAML(), io.StringIO()
    yaml.default_flow_style = None
    yaml.width = 10_000
    yaml.dump({"header": header, "joint_names": list(joints), "points": points}, out)
    return out.getvalue()


def design_document(design: Design) -> dict[str, Any]:
    """The design as JSON: references by their coefficients, expected errors, use of the limits."""
    groups = []
    for group in design.groups:
        planned, motion = group.planned, group.planned.reference
        assert isinstance(motion, Fourier)
        groups.append(
            {
                "name": planned.name,
                "payload": planned.payload,
                "duration": planned.duration,
                "files": [f"{planned.name}.csv", f"{planned.name}.yaml"],
                **{name: getattr(motion, name).tolist() for name in ("centre", "sine", "cosine")},
                "frequency": motion.frequency,
                "ramp": motion.ramp,
                "limits": [asdict(one) for one in group.used],
            }
        )
    kept = {name: getattr(design, name) for name in KEPT} | {"criterion": design.criterion.text}
    errors = [asdict(one) for one in design.errors]
    return {"format": 1, **kept, "random": design.before, "groups": groups, "parameters": errors}


def _text(value: float) -> str:
    return f"{round(float(value), DIGITS) + 0.0:.{DIGITS}g}"


def design_facts(design: Design) -> tuple[Fact, Fact]:
    """What to record and what it uses of the limits; what it is expected to show."""
    groups = tuple(
        (group.planned.name, group.planned.payload, group.planned.duration, used_text(group.used))
        for group in design.groups
    )
    plan = {name: getattr(design, name) for name in ("subject", "seed", "beside", "unit", "value", "before")}
    plan |= {name: getattr(design, name) for name in ("separates", "gains", "recorded_gains")}
    own = [error for error in design.errors if error.name not in INERTIAL_NAMES]
    shown = [error for error in own if error.prior_share <= FROM_PRIOR]
    expected = {
        "errors": tuple((error.label, error.value, error.std, error.unit) for error in shown),
        "hidden": len(own) - len(shown),
        "stopped": design.stopped,
    }
    criterion = design.criterion.values["of"]
    return (
        Fact("design-plan", values=plan | {"recorded": groups, "criterion": criterion}),
        Fact("design-expected", values=expected),
    )


def used_text(used: Sequence[Reached]) -> str:
    """The limits that a group uses most, "velocity of joint1 98 %"."""
    return ", ".join(f"{one.limit} {100 * one.share:.0f} %" for one in used[:MOST_LIMITS])
