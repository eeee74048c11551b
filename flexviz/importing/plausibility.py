"""All checks of groups against the robot and against each other, for imports and for sets made elsewhere."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from flexviz.importing.assembling import AssembledGroup
from flexviz.importing.cross_checks import check_optional_columns
from flexviz.importing.issues import Issue
from flexviz.importing.mapping import LogEntry, Mapping, parse
from flexviz.importing.thresholds import LIMITS
from flexviz.importing.torque_checks import check_torques
from flexviz.importing.torque_model import TorqueModel
from flexviz.measurements import GroupTable, MeasurementSet, body_entry, read_payloads
from flexviz.robot import PayloadBody, Robot

log = logging.getLogger(__name__)


def check_groups(
    mapping: Mapping,
    robot: Robot,
    groups: Sequence[AssembledGroup],
    file: Path = Path("mapping"),
    guessed: bool = False,
) -> list[Issue]:
    """Units, signs, zero positions and mix-ups that the data contradict.

    `guessed`: the payloads are not known yet, so the group that is explained best alone decides.
    """
    payloads = all_payloads(mapping, robot, file)
    tables = [(payloads[group.entry.payload], group.table) for group in groups]
    model = TorqueModel(robot, tables)
    if guessed and len(tables) > 1:
        model = max((TorqueModel(robot, [table]) for table in tables), key=TorqueModel.best_share)
    found = check_torques(mapping, model)
    known = {(joint, signal) for s in found for joint in s.joints for signal in s.signal.split(" and ")}
    found += [s for s in check_range(mapping, model) if (s.joints[0], "theta") not in known]
    # a wrong θ makes its torque and the columns compared with it inconclusive
    wrong_theta = {s.joints[0] for s in found if s.signal == "theta"}
    found = [s for s in found if s.kind != "unexplained" or not wrong_theta & set(s.joints)]
    known |= {(joint, "theta") for joint in wrong_theta}
    for issue in check_optional_columns(mapping, [table for _, table in tables]):
        signals = ("theta", "tau") if issue.kind == "swapped" else ("theta",)
        if not any((issue.joints[0], signal) in known for signal in signals):
            found.append(issue)
    return found


def all_payloads(mapping: Mapping, robot: Robot, file: Path) -> dict[str, tuple[PayloadBody, ...]]:
    """Name of each payload -> its bodies; "none" always exists."""
    return {"none": (), **read_payloads(mapping, robot, file)}


def check_range(mapping: Mapping, model: TorqueModel) -> list[Issue]:
    """Positions that leave the joint's range, or move faster than it can, by far."""
    found = []
    for j, joint in enumerate(mapping.names):
        excess = max(model.span[j] / model.width[j], model.speed[j] / model.fastest[j])
        if excess < LIMITS.beyond:
            continue
        message = (
            f"it spans {model.span[j]:.3g} rad at up to {model.speed[j]:.3g} rad/s, the joint's limits are "
            f'{model.width[j]:.3g} rad and {model.fastest[j]:.3g} rad/s: degrees (unit = "deg"), or the '
            "motor's angle before the gear (gear and side)?"
        )
        severity = "wrong" if excess > LIMITS.far_beyond else "odd"
        found.append(Issue("unit", severity, (joint,), "theta", message))
    return found


# -- sets made elsewhere -------------------------------------------------------------------------------


def with_plausibility_warnings(measurements: MeasurementSet) -> MeasurementSet:
    """The set with a warning, logged too, for everything that its robot's masses contradict.

    An identification alone would silently fit a torque of the wrong sign or an angle in degrees.
    """
    file = measurements.path / "measurements.toml"
    texts = [f"{file}: {issue}" for issue in issues_of_set(measurements) if issue.severity == "wrong"]
    for text in texts:
        log.warning("%s", text)
    return replace(measurements, warnings=(*texts, *measurements.warnings)) if texts else measurements


def issues_of_set(measurements: MeasurementSet, **keys: object) -> list[Issue]:
    """Issues that an import would find in θ and τ of a set; link positions are ignored.

    Args:
        measurements: the set.
        keys: of the mapping, the same on every joint.
    """
    groups = []
    for group in measurements.groups:
        table = replace(GroupTable.of(group), q=None, theta_ref=None)
        entry = LogEntry.model_validate({"file": "a", "group": group.name, "payload": group.payload})
        groups.append(AssembledGroup(entry, "CSV", table, {}, 0.0, ()))
    return check_groups(mapping_of(measurements, **keys), measurements.robot, groups)


def mapping_of(measurements: MeasurementSet, **keys: object) -> Mapping:
    """A mapping that takes the set's columns unchanged, with these keys on every joint."""
    payloads = measurements.payloads.items()
    bodies = {name: {"bodies": [body_entry(body) for body in payload]} for name, payload in payloads}
    joints = {joint: {"theta": f"t{joint}", "tau": f"u{joint}", **keys} for joint in measurements.joints}
    logs = [{"file": "a", "group": "a"}]
    return parse({"robot": "x", "payloads": bodies, "logs": logs, "joints": joints}, Path("mapping"))
