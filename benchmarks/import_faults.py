"""How often an import names wrong units, signs and samples: `python -m benchmarks.import_faults SET…`.

Takes each set as it is, which must raise no issue, then puts one fault at a time into a copy of its data
(a joint drawn at random where it concerns one) and looks whether exactly what undoes it is named. Link
positions are left out: they would make it easier.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.sample_faults import HARMLESS, KINDS, issues_of, log_of, named
from flexviz.importing import issues_of_set
from flexviz.measurements import MeasurementSet, read_set

SAMPLE_KINDS = {kind for one in KINDS.values() for kind in one.names} | {"jumps"}
Change = dict[str, Any]  # theta, tau -> factor, one or (n,)
Keys = dict[str, float]  # of the mapping, the same on every joint
Wanted = set[tuple[str, str, str]]  # joint, signal, key of each fix


def multiplied(measurements: MeasurementSet, theta: Any = 1.0, tau: Any = 1.0) -> MeasurementSet:
    """The set with θ and τ times these factors, one or (n,)."""
    groups = [
        replace(
            group,
            segments=tuple(replace(s, theta=s.theta * theta, tau=s.tau * tau) for s in group.segments),
        )
        for group in measurements.groups
    ]
    return replace(measurements, groups=tuple(groups))


def faults(joints: tuple[str, ...], joint: str) -> Iterator[tuple[str, Change, Keys, Wanted]]:
    """Name of a fault, what it does to the data, what the mapping says, and the fixes that undo it."""
    minus = np.where(np.array(joints) == joint, -1.0, 1.0)
    yield "sign of tau", {"tau": minus}, {}, {(joint, "tau", "sign")}
    yield "sign of theta", {"theta": minus}, {}, {(joint, "theta", "sign")}
    both = {(joint, signal, "sign") for signal in ("theta", "tau")}
    yield "joint turned round", {"theta": minus, "tau": minus}, {}, both
    yield "theta in degrees", {"theta": 180 / np.pi}, {}, {(j, "theta", "unit") for j in joints}
    yield "tau in mNm", {"tau": 1e3}, {}, {(j, "tau", "unit") for j in joints}
    sides = {(j, signal, "side") for j in joints for signal in ("theta", "tau")}
    yield "both before a known gear of 100", {"theta": 100.0, "tau": 0.01}, {"gear": 100.0}, sides
    unit = {(j, "tau", "unit") for j in joints}
    yield "a current of 8 Nm/A taken for Nm", {"tau": 1 / 8.0}, {"torque_constant": 8.0}, unit


def count_sample_faults(paths: list[str]) -> None:
    """Print how each fault of the samples was named in logs made of the sets, and what was said of none."""
    counts: dict[str, Counter[str]] = {name: Counter() for name in KINDS}
    alarms = 0
    for number, path in enumerate(paths):
        measurements = read_set(path, logged=False)
        group = measurements.fit_groups[0]
        for name, kind in KINDS.items():
            log = log_of(measurements, group, number)
            kind.spoil(log)
            with TemporaryDirectory() as folder:
                verdict = named(kind, issues_of(Path(folder), measurements, group, log))
            counts[name][verdict.partition(":")[0]] += 1
            if verdict != "right":
                print(f"{path}: {name}: {verdict}")
        for name, change in HARMLESS.items():
            log = log_of(measurements, group, number)
            change(log)
            with TemporaryDirectory() as folder:
                found = issues_of(Path(folder), measurements, group, log)
            said = [str(issue) for issue in found if issue.kind in SAMPLE_KINDS]
            alarms += bool(said)
            for text in said:
                print(f"{path}: {name}: {text}")
    print(f"false alarms: {alarms} of {len(paths) * len(HARMLESS)}")
    for name, count in counts.items():
        print(f"{name}: right {count['right']}, silent {count['silent']}, wrong cause {count['wrong cause']}")


def main(paths: list[str]) -> None:
    """Print how many sets raised something as they are, and how often each fault was named."""
    rng = np.random.default_rng(0)
    correct: Counter[str] = Counter()
    tried: Counter[str] = Counter()
    alarms = 0
    for path in paths:
        measurements = read_set(path)
        alarms += bool(issues_of_set(measurements))
        joint = measurements.joints[int(rng.integers(measurements.n))]
        for name, change, keys, wanted in faults(measurements.joints, joint):
            found = issues_of_set(multiplied(measurements, **change), keys)
            fixes = {(fix.joint, fix.signal, fix.key) for s in found for fix in s.fixes}
            tried[name] += 1
            correct[name] += fixes == wanted
            if fixes != wanted:
                print(f"{path}: {name} ({joint}): {'; '.join(map(str, found)) or 'nothing was said'}")
    print(f"sets as they are: {alarms} of {len(paths)} raised an issue")
    for name in tried:
        print(f"{name}: named in {correct[name]} of {tried[name]}")
    count_sample_faults(paths)


if __name__ == "__main__":
    main(sys.argv[1:])
