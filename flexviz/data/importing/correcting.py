"""Let the data correct a draft: units, sides, signs and clocks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from flexviz.base.progress import Progress, ProgressCallback, StopCallback
from flexviz.base.statistics import NORMAL_95
from flexviz.checks import Issue
from flexviz.data.importing.checking import check_all
from flexviz.data.importing.delays import clock_offsets, in_ms
from flexviz.data.importing.draft import Draft, Questions
from flexviz.data.importing.goal_units import state_units
from flexviz.data.importing.goals import goal_faults
from flexviz.data.importing.scales import find_scales
from flexviz.data.logs import (
    AssembledGroup,
    CoarseClock,
    Log,
    assemble,
    check_stop,
)
from flexviz.robot.robot import Robot

COARSE = "most instants repeat"  # why a clock is not used as it is
CORRECTION_ROUNDS = 4  # of correcting what the data contradict


def correct(
    draft: Draft, logs: Sequence[Log], asked: Questions, progress: ProgressCallback, should_stop: StopCallback
) -> list[Issue]:
    """Let the data correct units, sides, signs and clocks; the issues that remain."""
    remaining: list[Issue] = []
    shifted = False
    for round_ in range(CORRECTION_ROUNDS):
        progress(Progress("comparing with the robot", round_ / CORRECTION_ROUNDS))
        check_stop(should_stop)
        robot = Robot.load(draft.robot, tuple(draft.joints), gravity=draft.gravity)
        mapping = draft.mapping().for_joints(robot.prismatic, Path("mapping"))
        entries = zip(logs, mapping.logs, strict=False)
        try:
            groups = [assemble(log, entry, mapping, Path("mapping")) for log, entry in entries]
        except CoarseClock as error:
            key = error.proposal
            if key is None or draft.time.get(key.key) == key.value:
                raise
            draft.time[key.key] = key.value
            draft.time_comment = COARSE
            continue
        if not shifted:
            shifted = True
            shift_clocks(draft, groups[0])
        if draft.drive:
            if state_units(draft, robot, [group.table for group in groups]):
                continue
            faults = goal_faults(mapping, robot, groups)
            for fault in faults:
                draft.accept(fault.proposals, fault.message)
            if any(fault.proposals for fault in faults):
                continue
            draft.missing += [str(fault.error()) for fault in faults]
        elif find_scales(draft, robot, [group.table for group in groups]):
            continue
        remaining = check_all(mapping, robot, {"none": ()}, groups, guessed=True)
        certain = [issue for issue in remaining if issue.severity == "wrong" and issue.fixes]
        for issue in certain:
            draft.apply(issue.fixes, issue.message)
        if not certain and not ask_for_scales(draft, remaining, asked):
            break
    # what a certain issue needs was applied; of an odd one the user decides
    draft.proposals = [(proposal, issue.message) for issue in remaining for proposal in issue.remedies]
    return remaining


def ask_for_scales(draft: Draft, remaining: Sequence[Issue], asked: Questions) -> bool:
    """Ask for gears and torque constants that the data suggest; whether an answer changed anything."""
    unknown = [(s.signal, joint) for s in remaining if s.kind == "unit" and not s.fixes for joint in s.joints]
    far = [joint for signal, joint in unknown if signal == "theta" and draft.joints[joint].gear == 1.0]
    tau = [joint for signal, joint in unknown if signal == "tau"]
    weak = [joint for joint in tau if "unit" not in draft.joints[joint].signals["tau"]]
    if far:
        question = f"gear ratio of {', '.join(far)}: theta turns too far"
        ratios = asked.numbers(question, len(far), signed=True)
        for joint, ratio in zip(far, ratios or (), strict=False):
            draft.joints[joint].gear = ratio
            draft.joints[joint].signals["theta"]["side"] = "motor"
        return ratios is not None and set(ratios) != {1.0}
    if weak:
        question = f"tau of {', '.join(weak)} is no plausible torque. Is it a current? Torque constant [Nm/A]"
        constants = asked.numbers(question, len(weak))
        for joint, constant in zip(weak, constants or (), strict=False):
            entry = draft.joints[joint]
            entry.torque_constant = constant
            entry.signals["tau"] |= {"unit": "A"} | ({"side": "motor"} if entry.gear != 1.0 else {})
        return constants is not None
    return False


def shift_clocks(draft: Draft, group: AssembledGroup) -> None:
    """Correct the clocks of link positions by one log."""
    for offset in clock_offsets(group.entry.group, group.traces, tuple(draft.joints)):
        if offset.significant:
            draft.time.setdefault("shift", {})[offset.clock] = round(-offset.delay, 6)
            late = "late" if offset.delay > 0 else "early"
            size = in_ms(offset.delay, NORMAL_95 * offset.std)
            draft.time_comment = f"[s]; {offset.clock} is {size} {late} against θ"
