"""Goals in a draft: whether they stand in for a torque, which joints they move, which are alike."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.base import toml
from flexviz.base.facts import Fact
from flexviz.data.importing.draft import Draft
from flexviz.data.logs import ColumnFamily, Log, LogSource, ReadOptions, open_run, words
from flexviz.data.measurements import LEAST_GOALS
from flexviz.robot.robot import Robot


def goals_drive(roles: dict[str, ColumnFamily], log: Log, draft: Draft) -> bool:
    """Whether goals stand in for the torque: there is none, or a register that is none.

    That is a current without a sign, or a load without a unit; it is left out of `roles`.
    """
    if "theta_ref" not in roles:
        return False
    torque = roles.get("tau")
    if torque is not None:
        signed = any(np.nanmin(log.columns[c].columns[c]) < 0 for c in torque.columns.values())
        current = torque.meaning.quantity == "current"
        load = "load" in words(torque.name) and torque.meaning.unit is None and "unit" not in torque.stated
        if not load and (not current or signed or torque.stated.get("sign_bit") is not None):
            return False
        columns = (torque.name,)
        no_torque = (
            Fact("unsigned-current", columns=columns) if current else Fact("load-register", columns=columns)
        )
        draft.note(str(no_torque))
        del roles["tau"]
    draft.note(str(Fact("goals-drive", columns=(roles["theta_ref"].name,))))
    return True


def leave_out_constant(
    draft: Draft, sources: Sequence[LogSource], logs: Sequence[Log], options: ReadOptions
) -> None:
    """Leave out the joints whose goal is the same in all logs: nothing is learned of their servos."""

    def changes(log: Log, joint: str, name: str = "theta_ref") -> bool:
        column = draft.joints[joint].signals[name]["from"]
        values = log.columns[column].columns[column]
        return len(np.unique(values[np.isfinite(values)])) >= LEAST_GOALS

    still = [joint for joint in draft.joints if not any(changes(log, joint) for log in logs)]
    for source in sources[len(logs) :] if still else ():
        log = open_run(source, options)
        still = [joint for joint in still if not changes(log, joint)]
    for joint in still if len(still) < len(draft.joints) else ():
        goal, theta = (draft.joints[joint].signals[name]["from"] for name in ("theta_ref", "theta"))
        stands = float(np.nanmedian(logs[0].columns[theta].columns[theta]))
        draft.leave_out(
            joint, Fact("constant-goal", "odd", (joint,), columns=(goal,), values={"at": stands}).text
        )


def alike_servos(joints: Sequence[str], robot: Robot) -> list[str]:
    """The key for joints of one effort limit, as comments: their servos may be of one type."""
    by_effort: dict[float, list[str]] = {}
    for joint in joints:
        by_effort.setdefault(float(robot.effort_limit[robot.joints.index(joint)]), []).append(joint)
    groups = {x: group for x, group in by_effort.items() if len(group) > 1 and 0.0 < x < np.inf}
    if not groups:
        return ['# same = [["…", "…"]]  # alike servos'] if len(joints) > 1 else []
    efforts = tuple(groups)
    return [
        f"# {Fact('alike-servos', values={'efforts': efforts})}",
        f"# same = {toml.value_text(list(groups.values()))}",
    ]
