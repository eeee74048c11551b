"""Design of a static test for stiffness: pushes against a clamped flange, and poses with weights.

Against a clamp a push τ turns the motor by τ/K. The slope over pushes in steps, up and down, has the standard
error σ/(K ‖τ_free‖), where τ_free is τ without what an offset and friction in either direction explain, and σ
the scatter of a hold in Nm. The pose is the one in which the clamp bears the least.

Hanging weights only show K by what gravity changes along the deflection, ∂g/∂q g/K. What that gives at best,
with all masses known, is given for comparison.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flexviz.analysis.designing.settings import DesignSettings, Limits, choose_payloads, limits_of
from flexviz.analysis.designing.subject import Subject
from flexviz.base.arrays import Array, Indices
from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.base.files import as_json, named_errors, whole_folder
from flexviz.base.spelling import listed
from flexviz.base.statistics import NORMAL_95, student_95
from flexviz.data.measurements import Holds, check_free
from flexviz.model.equation import LinkDynamics
from flexviz.robot._pinocchio import pin
from flexviz.robot.robot import Robot

LEVELS = 7  # of the pushes, from one direction to the other
MOST_PASSES = 10
PUSH_SHARE = 0.3  # of the torque that a motor may use
WANTED = 0.03  # half a 95 % interval, relative
AVERAGED = 50  # samples of a hold
FRICTION, SCATTER = 0.1, 0.05  # friction where it is not known, of the push; how it differs from hold to hold
POSES, HUNG = 300, 12  # poses to choose from; those with weights
MOST_CLAMPED = 6  # joints that a clamp holds
LEVER = 0.1  # [m] at which a moment counts like a force


@dataclass(frozen=True, eq=False)
class StaticDesign:
    """A static test, and what it is expected to show.

    Attributes:
        subject: name of the robot or set.
        joints: all of them; the first `clamped` ones are before the clamped link.
        clamped: how many joints the clamp holds.
        pose: where the flange is clamped, (n,) [rad].
        pushes: largest push of each clamped joint, (m,) [Nm].
        passes: how often the pushes go up and down.
        errors: half 95 % intervals of the stiffnesses, relative, (m,).
        force, moment: the largest that the clamp bears [N], [Nm].
        payload: weight that is hung, "" without any.
        poses: where it is hung, (H, n) [rad].
        hung: half 95 % intervals that these show at best, relative, (n,); infinite where they show nothing.
    """

    subject: str
    joints: tuple[str, ...]
    clamped: int
    pose: Array
    pushes: Array
    passes: int
    errors: Array
    force: float
    moment: float
    payload: str
    poses: Array
    hung: Array


def design_static(
    subject: Subject, settings: DesignSettings | None = None, seed: int = 0, file: str | Path | None = None
) -> StaticDesign:
    """The pose, the pushes and the weights; `file` is what errors call the settings."""
    settings = settings or DesignSettings()
    limits, rng = limits_of(subject.robot, settings.limits, file), np.random.default_rng(seed)
    m = min(subject.robot.n, MOST_CLAMPED)
    if not np.isfinite(limits.torque[:m]).all():
        named = listed(
            [j for j, t in zip(subject.robot.joints, limits.torque, strict=True) if not np.isfinite(t)]
        )
        message = f"the torque that {named} may use is not known, expected limits.torque [Nm] in the settings"
        raise InputError(message, file=file, place="limits.torque")
    every = largest_pushes(subject, limits)
    pushes = every[:m]
    poses = allowed_poses(subject.robot, limits, rng)
    loads = [clamp_load(subject.robot, pose, pushes) for pose in poses]
    best = int(np.argmin([force + moment / LEVER for force, moment in loads]))
    noise = scatter(subject, every)
    tries = range(1, MOST_PASSES)
    passes = next((k for k in tries if np.all(push_errors(pushes, noise[:m], k) < WANTED)), MOST_PASSES)
    payloads = choose_payloads(settings, subject.payloads, file)
    payload = max(payloads, key=lambda name: sum(b.mass for b in subject.payloads[name]))
    hung, errors = hung_errors(subject, payload, poses, noise)
    return StaticDesign(
        subject.name, subject.robot.joints, m, poses[best], pushes, passes,
        push_errors(pushes, noise[:m], passes), *loads[best], payload, poses[hung], errors,
    )  # fmt: skip


def largest_pushes(subject: Subject, limits: Limits) -> Array:
    """What each motor may push, (n,) [Nm]: a share of its torque, and no more than it was recorded with."""
    pushes = PUSH_SHARE * limits.torque
    if subject.recorded is not None:
        recorded = [np.abs(s.tau).max(axis=0) for g in subject.recorded.groups for s in g.segments]
        pushes = np.minimum(pushes, np.max(recorded, axis=0))
    return pushes


def scatter(subject: Subject, pushes: Array) -> Array:
    """Standard deviation of a hold, as a torque, shape (n,) [Nm]: of the sensors, and of friction."""
    known = {e.joint: e.parameters["coulomb"] for e in subject.model.effects if "coulomb" in e.parameters}
    guessed = np.where(np.isfinite(pushes), FRICTION * pushes, 0.0)
    friction = [known.get(joint, guess) for joint, guess in zip(subject.robot.joints, guessed, strict=True)]
    sensors = np.hypot(subject.noise[0] * subject.model.stiffness, subject.noise[1]) / np.sqrt(AVERAGED)
    return np.hypot(sensors, SCATTER * np.array(friction))


def pushed(passes: int) -> Array:
    """Shares of the largest push, one after the other, (N,)."""
    up = np.linspace(-1.0, 1.0, LEVELS)
    return np.concatenate([np.concatenate([up, up[-2:0:-1]])] * passes + [up[:1]])


def push_errors(pushes: Array, noise: Array, passes: int) -> Array:
    """Half 95 % intervals of the stiffnesses, relative, (m,); `noise`: of a hold [Nm]."""
    shares = pushed(passes)
    way = np.sign(np.diff(shares, prepend=0.0))
    table = np.stack([shares] * 2, axis=1)
    used = Holds(np.arange(len(shares)), table, table, np.stack([way] * 2, axis=1)).slid(0)
    tau, way = shares[used], way[used]
    basis = np.linalg.svd(np.stack([np.ones_like(tau), way, way * np.abs(tau)], axis=1), full_matrices=False)[
        0
    ]
    free = tau - basis @ (basis.T @ tau)
    certain = float(student_95(len(tau) - basis.shape[1] - 1))
    return certain * noise / (pushes * np.linalg.norm(free))


def allowed_poses(robot: Robot, limits: Limits, rng: np.random.Generator) -> Array:
    """Random poses within the limits, with the tool in its box, (P, n) [rad]."""
    poses = rng.uniform(limits.lower, limits.upper, (4 * POSES, robot.n))
    if np.isfinite(limits.box).any():
        places = np.array([robot.link_poses(pose)[limits.tool][:3, 3] for pose in poses])
        poses = poses[np.all((places >= limits.box[0]) & (places <= limits.box[1]), axis=1)]
    if not len(poses):
        raise InputError(
            "no pose within the limits was found, expected a wider box", place="limits.box_lower"
        )
    return poses[:POSES]


def clamp_load(robot: Robot, pose: Array, pushes: Array) -> tuple[float, float]:
    """Force [N] and moment [Nm] with which one of the pushes (m,) [Nm] loads the clamp at most."""
    data, last = robot.model.createData(), 1 + int(robot.order[len(pushes) - 1])
    jacobian = pin.computeJointJacobian(robot.model, data, robot.to_pin(np.ascontiguousarray(pose)), last)
    columns = jacobian[:, robot.order[: len(pushes)]]
    wrench = np.linalg.pinv(columns.T) @ np.diag(pushes)
    short = np.abs(columns.T @ wrench - np.diag(pushes)).max() > 1e-6 * pushes.max()
    if short:  # singular: the clamp does not hold every joint
        return np.inf, np.inf
    return tuple(float(np.linalg.norm(part, axis=0).max()) for part in (wrench[:3], wrench[3:]))  # type: ignore[return-value]


def hung_errors(subject: Subject, payload: str, poses: Array, noise: Array) -> tuple[Indices, Array]:
    """Poses (H,) that show the stiffnesses best with a weight, and half their 95 % intervals at best, (n,).

    All masses, the weight's too, count as known: each pose is reached from both sides.
    """
    robot, model = subject.robot, subject.model
    inertial = model.inertial + robot.payload_parameters(subject.payloads[payload])
    still = np.zeros_like(poses)
    terms = LinkDynamics(robot).evaluate([(slice(0, len(poses)), inertial)], poses, still, still)
    torque = LinkDynamics(robot).torque(inertial, poses, still, still)
    compliance = 1 / model.stiffness
    # change of each joint's torque with the logarithm of each compliance, both sides averaged, (P, n, n)
    columns = terms.dq * (torque * compliance)[:, None, :] / noise[:, None] * np.sqrt(2)
    chosen: list[int] = []
    for _ in range(min(HUNG, len(poses))):
        gains = []
        for k in range(len(poses)):
            gains.append(
                -np.inf if k in chosen else np.linalg.slogdet(_information(columns[[*chosen, k]]))[1]
            )
        chosen.append(int(np.argmax(gains)))
    variance = np.diag(np.linalg.inv(_information(columns[chosen])))
    return np.array(chosen, np.intp), NORMAL_95 * np.sqrt(variance)


def _information(columns: Array) -> Array:
    """Of the relative compliances, given an offset per joint, (n, n), of columns (H, n, n)."""
    centred = columns - columns.mean(axis=0)
    flat = centred.reshape(-1, columns.shape[2])
    return flat.T @ flat + 1e-12 * np.eye(columns.shape[2])


def static_fact(design: StaticDesign) -> Fact:
    """What to do, and what it is expected to show."""
    values = {
        "subject": design.subject,
        "clamped": design.clamped,
        "pose": tuple(design.pose.tolist()),
        "force": design.force,
        "moment": design.moment,
        "levels": LEVELS,
        "passes": design.passes,
        "holds": len(pushed(design.passes)),
        "pushes": tuple(design.pushes.tolist()),
        "errors": tuple(design.errors.tolist()),
        "payload": design.payload,
        "poses": len(design.poses),
        "hung": tuple(float(error) for error in design.hung),
        "wanted": WANTED,
    }
    return Fact("static-test", joints=tuple(design.joints), values=values)


def static_files(design: StaticDesign) -> dict[str, str]:
    """File name → content: the pushes, the poses, `static.json` and `summary.txt`."""
    joints = design.joints[: design.clamped]
    rows = [
        [joint, f"{share * push:.4g}"]
        for joint, push in zip(joints, design.pushes, strict=True)
        for share in pushed(design.passes)
    ]
    document = {
        "format": 1, "subject": design.subject, "joints": design.joints, "clamped": joints,
        "pose": design.pose.tolist(), "pushes": design.pushes.tolist(), "passes": design.passes,
        "errors": design.errors.tolist(), "force": design.force, "moment": design.moment,
        "payload": design.payload, "poses": design.poses.tolist(),
        "hung": [float(x) for x in design.hung],
    }  # fmt: skip
    poses = [[f"{value:.5g}" for value in pose] for pose in design.poses]
    return {
        "pushes.csv": _csv(["joint", "torque"], rows),
        "poses.csv": _csv([f"theta_{joint}" for joint in design.joints], poses),
        "static.json": as_json(document),
        "summary.txt": static_fact(design).text + "\n",
    }


def write_static(design: StaticDesign, folder: str | Path) -> Path:
    """Write the files of a static test to a new folder: all of them or none."""
    path = Path(folder)
    check_free(path)
    with named_errors(path), whole_folder(path.absolute()) as new:
        for name, content in static_files(design).items():
            (new / name).write_text(content, encoding="utf-8")
    return path


def _csv(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerows([head, *rows])
    return out.getvalue()
