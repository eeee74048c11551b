"""What looks wrong in a set that was made elsewhere: the checks of an import, for sets that never saw one."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

from flexviz.importing.assembling import Assembled
from flexviz.importing.checking import check_groups
from flexviz.importing.mapping import LogEntry, Mapping, parse
from flexviz.importing.suspicion import Suspicion
from flexviz.measurements import GroupTable, MeasurementSet

log = logging.getLogger(__name__)


def with_doubts(measurements: MeasurementSet) -> MeasurementSet:
    """The set with a warning, logged too, for everything that its robot's masses contradict.

    A torque whose sign is turned round, an angle in degrees: an identification makes the best of them and
    says nothing.
    """
    file = measurements.path / "measurements.toml"
    texts = [f"{file}: {s}" for s in suspicions(measurements) if s.severity == "wrong"]
    for text in texts:
        log.warning("%s", text)
    return replace(measurements, warnings=(*texts, *measurements.warnings)) if texts else measurements


def suspicions(measurements: MeasurementSet, **keys: object) -> list[Suspicion]:
    """What an import would say of the set's θ and τ; link positions are left out.

    Args:
        measurements: the set.
        keys: of the mapping, the same on every joint.
    """
    groups = []
    for group in measurements.groups:
        table = replace(GroupTable.of(group), q=None, theta_ref=None)
        entry = LogEntry.model_validate({"file": "a", "group": group.name, "payload": group.payload})
        groups.append(Assembled(entry, "CSV", table, {}, 0.0, ()))
    return check_groups(mapping_of(measurements, **keys), measurements.robot, groups)


def mapping_of(measurements: MeasurementSet, **keys: object) -> Mapping:
    """A mapping that takes the set's columns as they are, with these keys on every joint."""
    payloads = {
        name: {
            "bodies": [
                {"link": b.link, "mass": b.mass, "com": list(b.com), "inertia": list(b.inertia)}
                for b in bodies
            ]
        }
        for name, bodies in measurements.payloads.items()
    }
    joints = {joint: {"theta": f"t{joint}", "tau": f"u{joint}", **keys} for joint in measurements.joints}
    logs = [{"file": "a", "group": "a"}]
    return parse({"robot": "x", "payloads": payloads, "logs": logs, "joints": joints}, Path("mapping"))
