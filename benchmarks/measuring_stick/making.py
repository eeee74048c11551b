"""The simulated sets of one or more seeds: what is there is not made again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks import filtered_logs, servo_joint
from benchmarks.diagnosis_study.cases import cases
from benchmarks.diagnosis_study.making import make as make_case
from benchmarks.diagnosis_study.making import make_all
from benchmarks.robotlike_study.cases import cases as robot_cases
from benchmarks.robotlike_study.making import make as make_robot

NUMBERS: dict[tuple[str, str], int] = {  # (kind, robot): cases of `benchmarks.diagnosis_study` for each seed
    ("single", "2r"): 20,
    ("single", "panda"): 3,
    ("single", "ur5"): 3,
    ("pair", "2r"): 4,
    ("pair", "panda"): 1,
    ("clean", "2r"): 6,
    ("clean", "panda"): 1,
    ("clean", "ur5"): 1,
    ("unknown", "2r"): 5,
    ("unknown", "ur5"): 1,
}
ROBOTLIKE = 4  # robots with many effects for each seed
FILTERED = 12  # filtered logs of the first seed


def make(work: Path, seeds: Sequence[int], jobs: int, larger: int = 1) -> None:
    """Simulate the sets of these seeds; `larger` times as many as usual of each study."""
    for k, seed in enumerate(seeds):
        folder = work / f"fresh-{seed}"
        numbers = {where: larger * count for where, count in NUMBERS.items()}
        make_all(folder / "diagnosis", cases(seed, numbers), make_case, jobs)
        make_all(folder / "robotlike", robot_cases(seed, larger * ROBOTLIKE), make_robot, jobs)
        if k == 0:
            filtered_logs.make(folder / "filtered", seed, FILTERED)
            servo_joint.make(folder / "servo", seed)
