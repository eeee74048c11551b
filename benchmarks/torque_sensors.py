"""Joint torque sensors as the torque: recognised in which sets, and how fast `identify` converges.

`python -m benchmarks.torque_sensors` simulates ten seeds of the Panda preset, once with the motors'
torque and once with that of joint torque sensors behind the gears, and prints a line per set.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from flexviz import identify, read_set
from flexviz.checks import torque_evidence
from flexviz.model.simulation.plan import Plan
from flexviz.model.simulation.presets import PRESETS
from flexviz.model.simulation.run import Run
from flexviz.model.simulation.sets import move, record, write_plan

SEEDS = 10


def sensed(plan: Plan, recorded: dict[str, Run], seed: int) -> dict[str, Run]:
    """The runs with τ as joint torque sensors measure it, with the noise of the plan's torque."""
    rng = np.random.default_rng([seed, 1])
    return {
        name: replace(
            run,
            tau=run.tau_joint + np.asarray(plan.sensors.torque_noise) * rng.standard_normal(run.tau.shape),
            torque_hold=0.0,
        )
        for name, run in recorded.items()
    }


def main() -> None:
    """Print the table."""
    plan = PRESETS["panda"]()
    runs = move(plan)
    right = {"motor": 0, "joint": 0}
    print("torque  seed  gain of no motors  taken for  converged  CPU of identify [s]  stiffness off, median")
    truth = plan.model.stiffness
    with tempfile.TemporaryDirectory() as folder:
        for side in right:
            for seed in range(SEEDS):
                made = record(plan, runs, seed)
                made = sensed(plan, made, seed) if side == "joint" else made
                out = write_plan(plan, made, Path(folder) / f"{side}{seed}", seed)
                measurements = read_set(out)
                began = time.process_time()
                result = identify(measurements)
                cpu = time.process_time() - began
                found = result.document().torque_side
                gain = torque_evidence(measurements).gain
                off = np.median(np.abs(result.model.stiffness / truth - 1))
                right[side] += found == side and result.converged
                print(f"{side:6}  {seed:4}  {gain:17.0f}  {found!s:9}  {result.converged!s:9}"
                      f"  {cpu:19.1f}  {100 * off:20.2g} %")  # fmt: skip
    print("right and converged: " + ", ".join(f"{side} {n} of {SEEDS}" for side, n in right.items()))


if __name__ == "__main__":
    main()
