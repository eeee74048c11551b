"""Memory and processor time of a diagnosis by the length of its records.

    python -m benchmarks.long_sets [--work DIR] [--minutes 1,2,5,10]

A Panda (7 joints, 1 kHz) on four random motions whose lengths add up to 1, 2, 5 and 10 minutes, three of them
fitted and one held out: with Coulomb friction hidden on two joints, and with nothing hidden. Each diagnosis
with all steps runs in a process of its own; prints one line per set. `--work` keeps the simulated sets.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np

from benchmarks.command import command
from benchmarks.running import alone, peak_megabytes
from flexviz.analysis.diagnosis import diagnose
from flexviz.base.progress import Progress
from flexviz.data.measurements import read_set
from flexviz.model.simulation import Plan, inject, make_plan, random_fourier, simulate_plan, write_plan

HIDDEN = {"friction": ("coulomb_friction:panda_joint2", "coulomb_friction:panda_joint4"), "clean": ()}
PERIOD = 12.0  # [s] of the preset's motions, which have six harmonics
HEAD = "| set | found | last verdict | CPU [s] | MB |\n|---|---|---|---|---|"


def long_plan(minutes: float, effects: Sequence[str]) -> Plan:
    """The preset's Panda on motions of the same frequencies that last longer and do not repeat."""
    plan = make_plan("panda")
    duration = 60.0 * minutes / len(plan.groups)
    groups = []
    for k, group in enumerate(plan.groups):
        reference = random_fourier(
            plan.robot,
            21 + k,
            centre=[0.0, -0.3, 0.0, -1.9, 0.0, 1.8, 0.6],
            reach=[0.9, 0.7, 0.9, 0.7, 1.0, 0.9, 1.2],
            duration=duration,
            harmonics=round(6 * duration / PERIOD),
            frequency=2 * np.pi / duration,
        )
        groups.append(replace(group, reference=reference, duration=duration))
    return inject(replace(plan, groups=tuple(groups), extra=False), effects)


def made(folder: Path, minutes: float, kind: str) -> Path:
    """The simulated set, made if it is not there."""
    out = folder / f"{kind}-{minutes:g}"
    if not out.exists():
        plan = long_plan(minutes, HIDDEN[kind])
        write_plan(plan, simulate_plan(plan), out, 0)
    return out


def examine(folder: Path, verbose: bool) -> str:
    """Diagnose one set; its line of the table."""
    measurements = read_set(folder)
    began = time.process_time()

    def told(progress: Progress) -> None:
        seconds, peak = time.process_time() - began, peak_megabytes()
        print(f"  {seconds:5.0f} s {peak:5.0f} MB {progress.text}", file=sys.stderr, flush=True)

    result = diagnose(measurements, apply=True, progress=told if verbose else None)
    seconds = time.process_time() - began
    found = ", ".join(step.added.text for step in result.steps if step.added) or "nothing"
    last = result.steps[-1].verdict
    return f"| {folder.name} min | {found} | {last} | {seconds:.0f} | {peak_megabytes():.0f} |"


@command
def main(
    *,
    work: Annotated[Path | None, "keep the simulated sets here"] = None,
    minutes: Annotated[str, "total lengths of the records"] = "1,2,5,10",
    hidden: Annotated[list[str], "all by default", HIDDEN] = list(HIDDEN),  # noqa: B006
    verbose: Annotated[bool, "print the progress with time and memory"] = False,
) -> None:
    with tempfile.TemporaryDirectory() as temporary:
        print(HEAD, flush=True)
        for kind in hidden:
            for length in map(float, minutes.split(",")):
                # in a process each: a process begins with the largest memory of the one that started it
                folder = alone(made, work or Path(temporary), length, kind)
                print(alone(examine, folder, verbose), flush=True)


if __name__ == "__main__":
    sys.exit(main())
