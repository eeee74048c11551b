"""What a real robot is missing, step by step: `python -m benchmarks.real SET`.

Diagnoses the set with all steps and prints, after each, the held-out residual divided by the torque's
standard deviation, of the samples in which a joint moves. Where the set has link encoders, the identified
deflection is compared with the measured one, which no fit has seen.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
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


def main() -> None:
    measurements = read_set(sys.argv[1])
    result: Any = diagnose(
        measurements, apply=True, guarded=True, progress=lambda p: print(p.text, file=sys.stderr)
    )
    print(result.summary())
    print("\nheld-out rms ÷ standard deviation of the torque, motion above 0.01 rad/s: mean, and each joint")
    for step in result.steps:
        share = held_out_share(measurements, step.model)
        label = "as it is" if step.added is None else f"+ {step.added.text}"
        print(f"{label:34s} {share.mean():.4f}  {np.round(share, 3)}")
    found = deflection(measurements, result.model)
    if found:
        print("\nidentified against encoded deflection (never fitted), the encoder's delay taken off:")
        for joint, one in found.items():
            print(
                f"{joint:12s} delay {1e3 * one.delay:.2f} ms, correlation {one.correlation:.3f}, "
                f"identified ÷ encoded {one.ratio:.2f}"
            )
    print("\nwhere the final residual lives, largest first")
    for place in result.where[:12]:
        low, high = place.range
        print(f"{place.joint:12s} {place.variable:14s} {place.explained:6.2f}  {low:.3g} … {high:.3g}")
    print(f"{result.seconds:.1f} s")


if __name__ == "__main__":
    main()
