"""What real robots are missing, step by step: `python -m benchmarks.real DIR ...`.

DIR is a measurement set or a folder of sets; what is absent is skipped. Diagnoses each set with all steps and
prints, after each, the held-out residual divided by the torque's standard deviation, of the samples in which
a joint moves. Where the set has link encoders, the identified deflection is compared with the measured one,
which no fit has seen. Ends with one line per set.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis import diagnose
from flexviz.equation import Equation, build_signals, layout_of
from flexviz.measurements import MeasurementSet, read_set
from flexviz.model import FlexibleModel
from flexviz.observers import ButterworthZeroPhase

Array = NDArray[np.float64]

MOVING = 0.01  # [rad/s] slower samples say nothing about friction
HERTZ = 5.0
HEAD = """| set | joints | error [% of torque spread] | worst joint | effects | last verdict | CPU [s] | MB |
|---|---|---|---|---|---|---|---|"""


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


@dataclass(frozen=True)
class Encoded:
    """Identified against encoded deflection θ − q of one joint, both about their mean.

    Attributes:
        delay: of the link encoder behind the motor's [s]: what goes with the velocity.
        correlation: of the identified one with the rest.
        ratio: of rms, identified ÷ encoded, the latter as far as it goes with the torque.
    """

    delay: float
    correlation: float
    ratio: float


def deflection(measurements: MeasurementSet, model: FlexibleModel) -> dict[str, Encoded]:
    """Joint → how what is identified compares with the link encoders, which no fit has seen."""
    out: dict[str, list[Array]] = {}
    layout = layout_of(measurements, [e.text for e in model.effects])
    x = layout.vector(model)
    for group in measurements.groups:
        if group.q is None or len(group.segments) != 1:
            continue
        signals = build_signals(measurements, [group], ButterworthZeroPhase(2 * np.pi * HERTZ))
        equation = Equation(measurements.robot, signals, layout)
        identified = signals.theta[0] - equation.evaluate(x).q[0]
        segment = group.segments[0]
        for j, joint in enumerate(measurements.joints):
            if np.isnan(group.q[:, j]).any():
                continue
            measured = np.interp(signals.time, group.time, group.q[:, j])
            encoded = np.interp(signals.time, segment.time, segment.theta[:, j]) - measured
            columns = np.stack((identified[:, j], encoded, signals.theta[1][:, j]), axis=1)
            out.setdefault(joint, []).append(columns - columns.mean(axis=0))
    found = {}
    for joint, parts in out.items():
        ours, encoded, velocity = np.concatenate(parts).T
        (delay, share), *_ = np.linalg.lstsq(np.stack((velocity, ours), axis=1), encoded, rcond=None)
        rest = encoded - delay * velocity
        found[joint] = Encoded(float(delay), float(np.corrcoef(ours, rest)[0, 1]), float(1 / share))
    return found


@dataclass(frozen=True)
class Row:
    """The diagnosis of one set in one line.

    Attributes:
        name: of the set.
        before, after: held-out rms ÷ standard deviation of the torque, first and last step, shape (n,).
        steps: number of added effects.
        verdict: of the last step.
        seconds: processor time of the diagnosis.
        megabytes: largest memory of its process.
    """

    name: str
    before: Array
    after: Array
    steps: int
    verdict: str
    seconds: float
    megabytes: float

    def text(self) -> str:
        """A line of a Markdown table, errors in per cent."""
        worst = 100 * np.array((self.before.max(), self.after.max()))
        mean = 100 * np.array((self.before.mean(), self.after.mean()))
        return (
            f"| {self.name} | {len(self.before)} | {mean[0]:.1f} → {mean[1]:.1f} "
            f"| {worst[0]:.0f} → {worst[1]:.0f} | {self.steps} | {self.verdict} "
            f"| {self.seconds:.0f} | {self.megabytes:.0f} |"
        )


def examine(folder: Path) -> Row:
    """Diagnose one set, print what was found and return its line."""
    measurements = read_set(folder)
    began = time.process_time()
    result: Any = diagnose(
        measurements, apply=True, guarded=True, progress=lambda p: print(p.text, file=sys.stderr)
    )
    seconds = time.process_time() - began
    print(f"\n{folder.name}\n{result.summary()}")
    print("\nheld-out rms ÷ standard deviation of the torque, motion above 0.01 rad/s: mean, and each joint")
    shares = [held_out_share(measurements, step.model) for step in result.steps]
    for step, share in zip(result.steps, shares, strict=True):
        label = "as it is" if step.added is None else f"+ {step.added.text}"
        print(f"{label:34s} {share.mean():.4f}  {np.round(share, 3)}")
    found = deflection(measurements, result.model)
    if found:
        print("\nidentified against encoded deflection (never fitted), the encoder's delay subtracted:")
        for joint, one in found.items():
            print(
                f"{joint:12s} delay {1e3 * one.delay:.2f} ms, correlation {one.correlation:.3f}, "
                f"identified ÷ encoded {one.ratio:.2f}"
            )
    print("\nwhere the final residual lives, largest first")
    for place in result.where[:12]:
        low, high = place.range
        print(
            f"{place.joint:12s} {place.variable:14s} {place.explained:6.2f}  {low:.3g} … {high:.3g}",
            flush=True,
        )
    megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    last = result.steps[-1].verdict
    return Row(folder.name, shares[0], shares[-1], len(shares) - 1, last, seconds, megabytes)


def sets_in(folder: Path) -> list[Path]:
    """The folder if it is a set, else the sets in it."""
    if (folder / "measurements.toml").is_file():
        return [folder]
    return sorted(file.parent for file in folder.glob("*/measurements.toml"))


def main(arguments: Sequence[str]) -> None:
    parser = argparse.ArgumentParser(description="Diagnoses recorded robots, each in a process of its own.")
    parser.add_argument("folders", nargs="+", type=Path, metavar="DIR", help="a set, or a folder of sets")
    rows = []
    for folder in parser.parse_args(arguments).folders:
        folders = sets_in(folder)
        if not folders:
            print(f"{folder}: skipped, no measurement set here; docs/how-good-is-it.md names the recordings")
        for one in folders:
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
                rows.append(pool.submit(examine, one).result())
    if rows:
        print(f"\n{HEAD}")
        print("\n".join(row.text() for row in rows))


if __name__ == "__main__":
    main(sys.argv[1:])
