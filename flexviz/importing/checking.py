"""All checks of assembled groups against the robot and against each other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from flexviz.importing.assembling import Assembled
from flexviz.importing.companions import compare
from flexviz.importing.explaining import Judge
from flexviz.importing.judging import judge
from flexviz.importing.mapping import Mapping
from flexviz.importing.suspicion import Suspicion
from flexviz.measurements import read_payloads
from flexviz.robot import PayloadBody, Robot

FAR, TOO_FAR = 1.3, 3.0  # times the joint's range or speed: odd, and certainly wrong


def check_groups(
    mapping: Mapping,
    robot: Robot,
    groups: Sequence[Assembled],
    file: Path = Path("mapping"),
    guessed: bool = False,
) -> list[Suspicion]:
    """Units, signs, zero positions and mix-ups that the data contradict.

    `guessed`: the payloads are not known yet, so the group that is explained best alone is the judge.
    """
    payloads = payload_bodies(mapping, robot, file)
    tables = [(payloads[group.entry.payload], group.table) for group in groups]
    judged = Judge(robot, tables)
    if guessed and len(tables) > 1:
        alone = [Judge(robot, [table]) for table in tables]
        judged = max(alone, key=lambda one: one.explained_at_all())
    found = judge(mapping, judged)
    known = {(joint, signal) for s in found for joint in s.joints for signal in s.signal.split(" and ")}
    found += [s for s in check_range(mapping, judged) if (s.joints[0], "theta") not in known]
    far = {s.joints[0] for s in found if s.signal == "theta"}
    # where θ is wrong itself, its torque and the columns beside it say nothing
    found = [s for s in found if s.kind != "unexplained" or not far & set(s.joints)]
    known |= {(joint, "theta") for joint in far}
    for s in compare(mapping, [table for _, table in tables]):
        about = "tau" if s.kind == "swapped" else "theta"
        if (s.joints[0], "theta") not in known and (s.joints[0], about) not in known:
            found.append(s)
    return found


def payload_bodies(mapping: Mapping, robot: Robot, file: Path) -> dict[str, tuple[PayloadBody, ...]]:
    """Name of each payload -> its bodies; "none" is always there."""
    return {"none": (), **read_payloads(mapping, robot, file)}


def check_range(mapping: Mapping, judged: Judge) -> list[Suspicion]:
    """Positions that leave the joint's range, or move faster than it can, by far."""
    found = []
    for j, joint in enumerate(mapping.names):
        excess = max(judged.span[j] / judged.width[j], judged.speed[j] / judged.fastest[j])
        if excess < FAR:
            continue
        message = (
            f"it spans {judged.span[j]:.3g} rad at up to {judged.speed[j]:.3g} rad/s, the joint's limits are "
            f'{judged.width[j]:.3g} rad and {judged.fastest[j]:.3g} rad/s: degrees (unit = "deg"), or the '
            "motor's angle before the gear (gear and side)?"
        )
        severity = "wrong" if excess > TOO_FAR else "odd"
        found.append(Suspicion("unit", severity, (joint,), "theta", message))
    return found
