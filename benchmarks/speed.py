"""Speed, as ratios measured in one run: `python -m benchmarks.speed`.

1. The solver's whole time against the bare cost of the Pinocchio calls it needs (joint torque regressor and
   RNEA derivatives once a sample and evaluation), called in an empty loop.
2. The sixth-order ESO over 20 s × 1 kHz × 7 joints (θ and τ).
3. A simulated controller cycle against the four ABA calls that it cannot do without.

How much faster the solver is than `trust-constr` is in `benchmarks.peers`.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.command import command
from benchmarks.peers.flexviz_answer import counted
from flexviz.analysis.estimation.least_squares import gauss_newton
from flexviz.analysis.estimation.start import Start, start_values
from flexviz.base.resources import sessions_dir
from flexviz.data.measurements import MeasurementSet, Segment, read_set
from flexviz.model.equation import Equation, Layout, build_signals
from flexviz.model.observers import CausalEso, make_observer
from flexviz.model.simulation import make_plan, simulate_preset
from flexviz.robot._pinocchio import pin

SIMULATED = 2.0  # [s]


def prepared(measurements: MeasurementSet, hertz: float = 6.0) -> tuple[Equation, Start]:
    groups = [g for g in measurements.groups if not g.validation]
    signals = build_signals(measurements, groups, make_observer("butterworth-zero-phase", 2 * np.pi * hertz))
    equation = Equation(measurements.robot, signals, Layout(measurements.joints))
    start = start_values(measurements, equation)
    return equation, start


def against_pinocchio(measurements: MeasurementSet, label: str) -> None:
    equation, start = prepared(measurements)
    ratios = []
    for _ in range(5):
        begun = time.perf_counter()
        with counted() as count:
            gauss_newton(equation, start.prior, start.bounds, start.x)
        mine = time.perf_counter() - begun
        model = measurements.robot.model
        data = model.createData()
        q, v, a = (np.ascontiguousarray(x) for x in equation.signals.theta[:3])
        begun = time.perf_counter()
        for _ in range(count.value):
            for k in range(len(q)):
                pin.computeRNEADerivatives(model, data, q[k], v[k], a[k])
                pin.computeJointTorqueRegressor(model, data, q[k], v[k], a[k])
        bare = time.perf_counter() - begun
        ratios.append(mine / bare)
    print(f"{label}: solver {mine * 1e3:.0f} ms ({count.value} evaluations of {len(q)} samples), ", end="")
    print(f"bare calls {bare * 1e3:.0f} ms, ratio {np.median(ratios):.2f} (median of 5)")


def observer() -> None:
    step = 1e-3
    t = step * np.arange(20000)
    rng = np.random.default_rng(0)
    y = np.sin(np.outer(t, rng.uniform(1, 6, 7))) + 1e-5 * rng.standard_normal((20000, 7))
    segment = Segment(t, y, 10 * y, step)
    times = []
    for _ in range(15):
        begun = time.perf_counter()
        CausalEso(50.0).states(segment, 0.001)
        times.append(time.perf_counter() - begun)
    print("ESO, 20 s × 1 kHz × 7 joints, θ and τ: ", end="")
    print(f"{np.median(times) * 1e3:.1f} ms (least {min(times) * 1e3:.1f})")


def simulation(name: str) -> None:
    plan = make_plan(name)
    group = replace(plan.groups[0], duration=SIMULATED)
    cycles = round(SIMULATED / plan.controller.cycle)
    model = plan.robot.model_with(plan.model.inertial)
    data, times = model.createData(), []
    q, v, tau = np.random.default_rng(0).normal(size=(3, plan.robot.n))
    for _ in range(3):
        begun = time.perf_counter()
        plan.run(group)
        mine = time.perf_counter()
        for _ in range(4 * cycles):
            pin.aba(model, data, q, v, tau)
        times.append((mine - begun, time.perf_counter() - mine))
    mine, bare = np.min(times, axis=0)
    cost = f"{mine / cycles * 1e6:.1f} µs a cycle of {plan.controller.cycle * 1e3:g} ms"
    print(f"simulator, {name}: {cost}, ratio {mine / bare:.1f}, {SIMULATED / mine:.0f} × real time")


@command
def main() -> None:
    with threadpool_limits(1):
        observer()
        for name in ("paper-b", "panda"):
            simulation(name)
        with tempfile.TemporaryDirectory() as folder:
            planar = read_set(sessions_dir() / "planar-2r-demo")
            against_pinocchio(planar, "2-DOF")
            simulate_preset("panda", Path(folder) / "panda")
            against_pinocchio(read_set(Path(folder) / "panda"), "7-DOF")


if __name__ == "__main__":
    sys.exit(main())
