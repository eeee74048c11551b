"""Motor inertia of the planar practice sets against its truth: `python -m benchmarks.motor_inertia PRACTICE`.

For each set the error of both joints after `diagnose --apply`, in units of 1e-4 kg m² and of the standard
error. Of sets in which nothing is hidden also what equation 6 leaves at the exact truth, per angular
acceleration: an error of the recording, which no method can avoid.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from benchmarks.command import command
from benchmarks.peers.sets import planar_inertial
from benchmarks.running import read
from flexviz import diagnose, make_observer, read_set
from flexviz.data.measurements import MeasurementSet
from flexviz.model.equation import Equation, build_signals, layout_of

BAND = 2 * np.pi * 8.0  # [rad/s]
STEP, EDGE = 0.002, 0.5  # [s] of the equation's samples; dropped at both ends


def left_at_truth(measurements: MeasurementSet, truth: dict[str, Any]) -> np.ndarray:
    """Residual of each joint per its angular acceleration, by least squares, shape (2,) [kg m²]."""
    observer = make_observer("butterworth-zero-phase", BAND)
    signals = build_signals(
        measurements, measurements.groups, observer, sample_step=STEP, exact_step=True, drop=(EDGE, EDGE)
    )
    layout, links = layout_of(measurements, []), planar_inertial(truth["inertial_2r"])
    x = np.zeros(layout.size)
    x[layout.inertial] = links.ravel()
    x[layout.compliance] = 1 / np.array(truth["stiffness"])
    x[layout.motor_inertia] = truth["motor_inertia"]
    x[layout.link_viscous], x[layout.motor_viscous] = truth["viscous_link"], truth["viscous_motor"]
    residual, acceleration = (
        Equation(measurements.robot, signals, layout).evaluate(x).residual,
        signals.theta[2],
    )
    return np.sum(residual * acceleration, axis=0) / np.sum(acceleration**2, axis=0)


@command
def main(practice: Annotated[Path, "folder with cases/ and truth/"]) -> None:
    """Print a line per set."""
    for file in sorted((practice / "truth").glob("2r-*.json")):
        truth = read(file)
        measurements = read_set(practice / "cases" / file.stem)
        found = diagnose(measurements, apply=True)
        texts = []
        for joint, right in zip(truth["joints"], truth["motor_inertia"], strict=True):
            one = next(p for p in found.parameters if (p.name, p.joint) == ("motor_inertia", joint))
            error = one.value - right
            texts.append(f"{joint} {1e4 * error:+6.2f} ({error / one.std:+6.1f} standard errors)")
        if not truth["effects"]:
            left = " and ".join(f"{1e4 * value:+.2f}" for value in left_at_truth(measurements, truth))
            texts.append(f"left at the truth {left}")
        print(f"{file.stem:28} {'; '.join(texts)}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
