"""How decisions depend on the estimator's thresholds: `python -m benchmarks.thresholds [--seeds 2]`.

Simulated two-joint arms, identified and refined, against the known truth:

1. `noise_explains`: actual ÷ predicted standard errors, from the noise model and from the residual's spectra,
   over the size of an unmodelled friction, and with it over χ² per sample.
2. Prior spreads: how far estimates and standard errors move when all spreads are a third or three times as
   wide.
3. `effect_floor`, `viscous_floor`: the grade of effects and friction that are absent, and of present ones.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.command import command
from flexviz.analysis.estimation import Bounds, Prior, Solved, TwoBandData, Whitening, solve, start_values
from flexviz.analysis.identification import identify, parameter_estimates
from flexviz.analysis.identification.thresholds import IDENTIFICATION
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.equation import Equation, build_signals, layout_of
from flexviz.model.observers import make_observer
from flexviz.model.simulation import make_plan, move, record, write_plan
from flexviz.robot.model import EffectValue, FlexibleModel

Array = NDArray[np.float64]

FRICTION = (0.0, 7e-4, 1e-3, 1.5e-3, 3e-3)  # unmodelled [Nm]
ABSENT = ("torque_offset:joint1", "coulomb_friction:joint1", "stiffness_hardening:joint2")
PRESENT = "coulomb_friction:joint2"


@dataclass(frozen=True, eq=False)
class Case:
    """A simulated set, its truth, and what an identification may assume of it."""

    measurements: MeasurementSet
    truth: FlexibleModel
    prior: Prior
    bounds: Bounds
    x: Array

    def refined(self, prior: Prior) -> Solved:
        """The refinement without model error, from the plain fit."""
        data = TwoBandData(self.measurements, self.measurements.fit_groups, prior.layout)
        return solve(Whitening(data), prior, self.bounds, self.x, iterations=12)


def simulated(folder: Path, friction: float, seeds: int, fitted: tuple[str, ...] = ()) -> list[Case]:
    """Sets with Coulomb friction on joint 2 that differ in their noise; `fitted` are the model's effects."""
    plan = make_plan("planar-2r")
    effects = (EffectValue("coulomb_friction", "joint2", {"coulomb": friction}),) if friction else ()
    plan = replace(plan, model=replace(plan.model, effects=effects))
    runs, out = move(plan, 1), []
    for seed in range(seeds):
        place = folder / f"f{friction:g}-{seed}"
        measurements = replace(read_set(write_plan(plan, record(plan, runs, seed), place)), effects=fitted)
        layout = layout_of(measurements)
        signals = build_signals(measurements, measurements.fit_groups, make_observer("flat-zero-phase", 40.0))
        start = start_values(measurements, Equation(measurements.robot, signals, layout))
        x = layout.vector(identify(measurements, refine=False).model)
        out.append(Case(measurements, plan.model, start.prior, start.bounds, x))
    return out


def print_noise_explains(folder: Path, seeds: int) -> list[Case]:
    print("1. friction [Nm]   χ²    actual ÷ predicted standard error: noise model, residual's spectra")
    clean: list[Case] = []
    for friction in FRICTION:
        cases = simulated(folder, friction, seeds)
        clean = clean or cases
        chi, ratios = [], ([], [])
        for case in cases:
            solved = case.refined(case.prior)
            layout = case.prior.layout
            kept = [*range(layout.compliance.start, layout.motor_inertia.stop)]
            error = (solved.place.x - layout.vector(case.truth))[kept]
            chi.append(float(np.mean(solved.place.chi)))
            for ratio, from_noise in zip(ratios, (True, False), strict=True):
                ratio.append(
                    error
                    / solved.place.covariance(case.prior, from_noise, solved.at_bound).standard_errors[kept]
                )
        actual = [float(np.sqrt(np.mean(np.square(r)))) for r in ratios]
        print(f"   {friction:<15g} {np.mean(chi):7.3f} {actual[0]:12.2f} {actual[1]:12.2f}")
    return clean


def print_spreads(case: Case) -> None:
    print("2. spreads ×   largest shift [standard errors]   largest change of a standard error")
    usual = case.refined(case.prior)
    before = usual.place.covariance(case.prior, True, usual.at_bound)
    told = before.prior_share < IDENTIFICATION.prior_share
    for factor in (1 / 3, 3.0):
        prior = replace(case.prior, spread=factor * case.prior.spread)
        solved = case.refined(prior)
        after = solved.place.covariance(prior, True, solved.at_bound)
        shift = np.abs(solved.place.x - usual.place.x)[told] / before.standard_errors[told]
        change = after.standard_errors[told] / before.standard_errors[told] - 1
        print(f"   {factor:<10.2g} {shift.max():22.3f} {np.abs(change).max():30.1%}")


def print_floors(folder: Path) -> None:
    case = simulated(folder / "floors", 2.0, 1, (PRESENT, *ABSENT))[0]
    solved, prior = case.refined(case.prior), case.prior
    covariance = solved.place.covariance(prior, True, solved.at_bound)
    for field, values, part in (
        ("effect_floor", (0.0, 0.002, 0.007, 0.02, 0.06), "."),
        ("viscous_floor", (0.0, 0.02, 0.05, 0.1, 0.2), "_viscous_"),
    ):
        for value in values:
            thresholds = replace(IDENTIFICATION, **{field: value})
            found = parameter_estimates(
                prior.layout, solved.place.x, prior.centre, covariance, solved.at_bound, prior, thresholds
            )
            kept = [p for p in found if part in p.name]
            if value == 0.0:
                print(f"3. {field:15s}", *(f"{p.name}:{p.joint} {p.value:.3g}±{p.std:.2g}" for p in kept))
            print(f"   {value:<15g}", *(p.identifiable for p in kept))


@command
def main(*, seeds: int = 4) -> None:
    with tempfile.TemporaryDirectory() as folder:
        clean = print_noise_explains(Path(folder), seeds)
        print_spreads(clean[0])
        print_floors(Path(folder))


if __name__ == "__main__":
    sys.exit(main())
