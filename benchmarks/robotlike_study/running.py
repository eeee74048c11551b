"""Make sets, and diagnose each in a process of its own: what is there is not done again."""

from __future__ import annotations

from pathlib import Path

from benchmarks.diagnosis_study.running import say, spread
from benchmarks.robotlike_study.cases import RobotCase
from benchmarks.robotlike_study.making import is_made, make


def make_all(work: Path, cases: list[RobotCase], jobs: int) -> int:
    """Simulate what is not there yet; 1 if a case failed."""
    missing = [case for case in cases if not is_made(work, case)]
    failures = 0
    arguments = [(work, case) for case in missing]
    for done, (case, failed) in enumerate(spread(make, arguments, missing, jobs), 1):
        failures += failed is not None
        say(f"{done}/{len(missing)} {case.name}{f': {failed}' if failed else ''}")
    return int(failures > 0)
