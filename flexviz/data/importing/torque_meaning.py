"""What a column called "effort" is: asked together with what gravity says of it.

ROS leaves open whether `effort` is a motor torque, a current, a torque before the gear or that of a joint
torque sensor, and controllers differ in whether they add gravity themselves.
"""

from __future__ import annotations

import numpy as np

from flexviz.data.importing.draft import Draft, Questions
from flexviz.data.logs import ColumnFamily, Log
from flexviz.robot.robot import Robot

VAGUE = ("effort", "load")  # words that name no quantity
OPTIONS = (
    "motor torque at the joint [Nm], with gravity",
    "motor current",
    "motor torque before the gear",
    "joint torque sensor",
    "motor torque at the joint without the controller's gravity term",
)
SENSOR = OPTIONS.index("joint torque sensor")
MOST_POSES = 200  # of a log


def ask_for_meaning(
    draft: Draft, roles: dict[str, ColumnFamily], robot: Robot, log: Log, asked: Questions
) -> None:
    """Ask what an effort is, and draft the mapping for the answer."""
    family = roles["tau"]
    if family.meaning.unit is not None or not any(word in family.name.lower() for word in VAGUE):
        return
    says = evidence(roles, robot, log)
    chosen = asked.choose(f"What is {family.name}?{f' In these data {says}' if says else ''}", OPTIONS, 0)
    meaning = OPTIONS[chosen or 0]
    draft.seen.append(f"  {family.name}: taken for {meaning}" + (f"; {says}" if says else ""))
    draft.torque = "joint" if chosen == SENSOR else None
    for joint in draft.joints.values():
        if chosen:
            joint.comment("tau", meaning)
        if chosen == 1:
            joint.signals["tau"]["unit"] = "A"
        if chosen == 2:
            joint.signals["tau"]["side"] = "motor"
    if chosen in (1, 2):
        what = "torque constant [Nm/A], on the side of the current" if chosen == 1 else "gear ratio"
        values = asked.numbers(what, len(draft.joints), signed=chosen == 2)
        if values is None:
            draft.missing.append(f"{'torque_constant' if chosen == 1 else 'gear'} of every joint")
        for joint, value in zip(draft.joints.values(), values or (), strict=False):
            if chosen == 1:
                joint.torque_constant = value
            else:
                joint.gear = value


def evidence(roles: dict[str, ColumnFamily], robot: Robot, log: Log) -> str:
    """How much of τ the gravity of the URDF explains at the recorded poses; "" where that cannot be said."""
    theta, tau = (roles[name].columns if name in roles else {} for name in ("theta", "tau"))
    joints = [joint for joint in robot.joints if joint in theta and joint in tau]
    columns = log.columns
    signals = [[columns[x[j]].columns[x[j]] for j in joints] for x in (theta, tau)]
    if not joints or len({len(values) for signal in signals for values in signal}) != 1:
        return ""
    q, measured = (np.stack(signal, axis=1).astype(float) for signal in signals)
    known = np.flatnonzero(np.isfinite(q + measured).all(axis=1))
    rows = known[:: max(1, len(known) // MOST_POSES)]
    poses = np.zeros((len(rows), robot.n))
    poses[:, [robot.joints.index(joint) for joint in joints]] = q[rows]
    zero = np.zeros_like(poses)
    gravity = robot.cad_torques((), poses, zero, zero)[:, [robot.joints.index(joint) for joint in joints]]
    strongest = int(np.argmax(np.abs(gravity).max(axis=0, initial=0.0)))
    g, t = gravity[:, strongest], measured[rows, strongest]
    largest = f"|{joints[strongest]}| is up to {np.abs(t).max(initial=0.0):.3g}"
    if len(rows) < 8 or np.ptp(g) <= 1e-6 or np.ptp(t) <= 0.0:
        return largest
    (factor, offset), *_ = np.linalg.lstsq(np.column_stack([g, np.ones_like(g)]), t, rcond=None)
    share = 1.0 - np.var(t - factor * g - offset) / np.var(t)
    return (
        f"{largest}, of which the URDF's gravity explains {100 * share:.0f} % with a factor of {factor:.2g}"
    )
