"""What real robots are missing, step by step: `python -m benchmarks.real DIR ...`.

DIR is a measurement set or a folder of sets; what is absent is skipped. Diagnoses each set with all steps and
prints, after each, the held-out residual divided by the torque's standard deviation, of the samples in which
a joint moves. Where the set has link encoders, the summary has what they show of the stiffness, which no fit
has seen. Ends with one line per set.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.command import command
from benchmarks.running import alone, peak_megabytes
from benchmarks.tables import markdown
from flexviz.analysis.diagnosis import diagnose
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.equation import Equation, build_signals, layout_of
from flexviz.model.observers import ButterworthZeroPhase
from flexviz.robot.model import FlexibleModel

Array = NDArray[np.float64]

MOVING = 0.01  # [rad/s] slower samples say nothing about friction
HERTZ = 5.0
HEAD = [
    "set",
    "joints",
    "error [% of torque spread]",
    "worst joint",
    "effects",
    "last verdict",
    "CPU [s]",
    "MB",
]


def held_out_share(measurements: MeasurementSet, model: FlexibleModel) -> Array:
    """Held-out rms ÷ standard deviation of the torque while moving, shape (n,)."""
    groups = [g for g in measurements.groups if g.validation]
    signals = build_signals(measurements, groups, ButterworthZeroPhase(2 * np.pi * HERTZ))
    layout = layout_of(measurements, [e.text for e in model.effects])
    equation = Equation(measurements.robot, signals, layout)
    x = layout.vector(model)
    residual = equation.evaluate(x).residual
    moving = np.abs(signals.theta[1]) > MOVING
    raw = np.concatenate([s.tau for g in groups for s in g.segments])
    size = np.sqrt((residual**2 * moving).sum(axis=0) / np.maximum(moving.sum(axis=0), 1))
    return size / raw.std(axis=0)


def examine(folder: Path) -> list[str]:
    """Diagnose one set, print what was found and return its row of the table."""
    measurements = read_set(folder)
    began = time.process_time()
    result: Any = diagnose(
        measurements, apply=True, guard=True, progress=lambda p: print(p.text, file=sys.stderr)
    )
    seconds = time.process_time() - began
    print(f"\n{folder.name}\n{result.summary()}")
    print("\nheld-out rms ÷ standard deviation of the torque, motion above 0.01 rad/s: mean, and each joint")
    shares = [held_out_share(measurements, step.model) for step in result.steps]
    for step, share in zip(result.steps, shares, strict=True):
        label = "as it is" if step.added is None else f"+ {step.added.text}"
        print(f"{label:34s} {share.mean():.4f}  {np.round(share, 3)}")
    print("\nwhere the final residual lives, largest first")
    for place in result.where[:12]:
        low, high = place.range
        print(
            f"{place.joint:12s} {place.variable:14s} {place.explained:6.2f}  {low:.3g} … {high:.3g}",
            flush=True,
        )
    errors = [
        f"{100 * of(shares[0]):.{digits}f} → {100 * of(shares[-1]):.{digits}f}"
        for of, digits in ((np.mean, 1), (np.max, 0))
    ]
    last, added = result.steps[-1].verdict, str(len(shares) - 1)
    joints = str(measurements.n)
    return [folder.name, joints, *errors, added, last, f"{seconds:.0f}", f"{peak_megabytes():.0f}"]


def sets_in(folder: Path) -> list[Path]:
    """The folder if it is a set, else the sets in it."""
    if (folder / "measurements.toml").is_file():
        return [folder]
    return sorted(file.parent for file in folder.glob("*/measurements.toml"))


@command
def main(folders: Annotated[list[Path], "a set, or a folder of sets"]) -> None:
    rows = []
    for folder in folders:
        sets = sets_in(folder)
        if not sets:
            print(f"{folder}: skipped, no measurement set here; docs/how-good-is-it.md names the recordings")
        rows += [alone(examine, one) for one in sets]
    if rows:
        print(f"\n{markdown([HEAD, *rows], numbers=False)}")


if __name__ == "__main__":
    sys.exit(main())
