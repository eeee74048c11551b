"""How friction that differs with who drives, motor or load, is diagnosed.

    python -m benchmarks.driving_study FOLDER [--robot 2r|ur5] [--count N] [--first SEED]

Sets of the independent simulator, which shares no code with flexviz: in half of them one joint's gear loses
different shares of its torque when the motor and when the load drives (ratio 1.5 to 3, either way round,
mean 4 to 10 %); in the other half the shares are the same. Each is diagnosed with `apply` and printed as a
line, kept in FOLDER and not done again; the last lines are the sums. A share is the rms of that friction
relative to that of its joint's torque.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from benchmarks.command import command
from benchmarks.independent import cases, files
from flexviz.analysis.diagnosis import diagnose
from flexviz.data.measurements import read_set

DRIVING, ALONE = "driving_friction", "load_dependent_friction"
SHARE = 0.03  # from which it is to be named
ROBOTS = ["2r", "ur5"]


def tried(folder: Path, robot: str, kind: str, seed: int) -> dict[str, Any]:
    """One set: what was hidden, its share, what was found."""
    file = folder / f"{robot}-{kind}-{seed}.json"
    if file.is_file():
        return json.loads(file.read_text(encoding="utf-8"))
    case = cases.draw(seed, kind, robot)
    out = folder / "sets" / file.stem
    files.write(out, case.setup, case.record, case.drawn, case.rough, case.own)
    (hidden,) = case.truth["effects"]
    began = time.process_time()
    found = diagnose(read_set(out), apply=True)
    added = [step.added for step in found.steps if step.added is not None]
    named = [one for one in added if one.effect == DRIVING]
    result = {
        "hidden": hidden, "share": share(case, hidden), "found": [one.text for one in added],
        "named": [one.joint for one in named], "verdict": found.steps[-1].verdict,
        "values": {k: v.value for one in named for k, v in one.parameters.items()},
        "tied": [one.text for one in added if one.family is not None and one.family.tied],
        "seconds": time.process_time() - began,
    }  # fmt: skip
    file.write_text(json.dumps(result, indent=1), encoding="utf-8")
    return result


def share(case: Any, hidden: dict[str, Any]) -> float:
    """The friction's share of the torque on its joint, from the true motion."""
    j, p = case.truth["joints"].index(hidden["joint"]), hidden["parameters"]
    load, record = case.record.joint_torque[:, :, j], case.record
    step = record.time[1] - record.time[0]
    forth = load * np.gradient(record.q[:, :, j], step, axis=1) > 0
    lost = np.where(
        forth, p.get("motor_driving", p.get("coefficient")), p.get("load_driving", p.get("coefficient"))
    )
    return float(np.sqrt(np.mean((lost * load) ** 2) / np.mean(record.tau[:, :, j] ** 2)))


@command
def main(
    folder: Path,
    *,
    robot: Annotated[list[str], "both by default", ROBOTS] = ROBOTS,
    count: Annotated[int, "sets per robot and kind"] = 20,
    first: Annotated[int, "first seed"] = 900,
) -> None:
    done: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for seed in range(first, first + count):
        for name in robot:
            for kind in (DRIVING, ALONE):
                one = tried(folder, name, kind, seed)
                done.setdefault((name, kind), []).append(one)
                found = ", ".join(one["found"]) or "nothing"
                where = f"{name} {kind} {seed} on {one['hidden']['joint']}, {100 * one['share']:.1f} %"
                print(f"{where}: {found}, {one['verdict']}, {one['seconds']:.0f} s", flush=True)
    for (name, kind), results in done.items():
        large = [one for one in results if one["share"] >= SHARE or kind == ALONE]
        right = sum(one["named"] == [one["hidden"]["joint"]] for one in large)
        other = sum(any(joint != one["hidden"]["joint"] for joint in one["named"]) for one in large)
        what = "named" if kind == DRIVING else "falsely named"
        print(f"{name}, {kind}: {what} on its joint in {right} of {len(large)}, on another in {other}")


if __name__ == "__main__":
    sys.exit(main())
