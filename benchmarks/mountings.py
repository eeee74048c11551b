"""Whether an import names how an arm is mounted: `python -m benchmarks.mountings [--seed N]`.

Ten arms of the independent simulator on walls and under ceilings, whose sets state no gravity, and twenty
that stand upright, with and without a hidden effect.
"""

from __future__ import annotations

import math
import sys
from itertools import cycle
from tempfile import TemporaryDirectory

from benchmarks.command import command
from benchmarks.independent import make_case
from flexviz.checks import Issue, issues_of_set
from flexviz.data.measurements import read_set

TURN = math.pi / 2
MOUNTED = {  # turns of the base about x, then about the world's y [rad] -> what is to be stated
    (0.0, TURN): "gravity = [9.81, 0, 0]",
    (0.0, -TURN): "gravity = [-9.81, 0, 0]",
    (math.pi, 0.0): "gravity = [0, 0, 9.81]",
    (TURN, 0.0): "gravity = [0, -9.81, 0]",
}
ARMS = ("panda", "ur5", "2r", "panda", "ur5")
KINDS = ("none", "coulomb_friction", "backlash", "torque_ripple", "payload_error")


def issues(seed: int, kind: str, robot: str, mounted: tuple[float, float]) -> list[Issue]:
    """What an import finds in such an arm's set."""
    with TemporaryDirectory() as folder:
        make_case(seed, kind, robot, folder, mounted=mounted, duration=8.0)
        return issues_of_set(read_set(folder, logged=False))


@command
def main(*, seed: int = 1) -> int:
    named = alarms = 0
    for i, (mounted, robot) in zip(range(10), zip(cycle(MOUNTED), cycle(ARMS), strict=False), strict=False):
        wanted = MOUNTED[mounted]
        found = issues(seed + i, KINDS[i % 2], robot, mounted)
        right = any(wanted in str(issue) for issue in found)
        sole = right and any(issue.kind == "mounting" for issue in found)
        named += right
        said = "" if sole else "; ".join(map(str, found)) or "silent"
        print(
            f"{robot:6s} {wanted:26s} {'named' if sole else 'among others' if right else 'no'} {said}",
            flush=True,
        )
    for i in range(20):
        robot, kind = ARMS[i % len(ARMS)], KINDS[i % len(KINDS)] if i % 2 else "none"
        found = issues(seed + 100 + i, kind, robot, (0.0, 0.0))
        alarm = [issue for issue in found if "gravity" in str(issue)]
        alarms += bool(alarm)
        print(f"{robot:6s} upright, {kind:18s} {'; '.join(map(str, found)) or 'silent'}", flush=True)
    print(f"mounting named: {named} of 10; of upright arms called mounted otherwise: {alarms} of 20")
    return 0


if __name__ == "__main__":
    sys.exit(main())
