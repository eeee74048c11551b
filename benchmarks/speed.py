"""Speed, as ratios measured in one run: `python -m benchmarks.speed [--quick]`.

1. Gauss–Newton with the analytic Jacobian against SciPy's `trust-constr` with finite differences (an
   interior-point method like the paper's) on the same equation, weights, prior, bounds and start: time to the
   same cost.
2. The solver's whole time against the bare cost of the Pinocchio calls it needs (joint torque regressor and
   RNEA derivatives once a sample and evaluation), called in an empty loop.
3. The sixth-order ESO over 20 s × 1 kHz × 7 joints (θ and τ).
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.optimize import Bounds as ScipyBounds
from scipy.optimize import minimize
from threadpoolctl import threadpool_limits

from flexviz._pinocchio import pin
from flexviz.equation import Equation, Evaluation, Layout, build_signals
from flexviz.estimation.descent import Descent, Reach
from flexviz.estimation.least_squares import PlainProblem, Solution, gauss_newton, weighted_cost
from flexviz.estimation.start import Start, start_values
from flexviz.measurements import MeasurementSet, Segment, read_set
from flexviz.observers import CausalEso, make_observer
from flexviz.resources import sessions_dir
from flexviz.simulation import simulate_preset


def prepared(measurements: MeasurementSet, hertz: float = 6.0) -> tuple[Equation, Start]:
    groups = [g for g in measurements.groups if not g.validation]
    signals = build_signals(measurements, groups, make_observer("butterworth-zero-phase", 2 * np.pi * hertz))
    equation = Equation(measurements.robot, signals, Layout(measurements.joints))
    start = start_values(measurements, equation)
    return equation, start


def against_trust_constr(measurements: MeasurementSet, limit: float) -> None:
    """Both minimise ½ Σ (r/σ)² + prior with the same fixed σ, over variables scaled to order one."""
    equation, start = prepared(measurements)
    solved = gauss_newton(equation, start.prior, start.bounds, start.x)
    weights = solved.weights
    target_x = solved.x

    def cost(x: np.ndarray) -> float:
        if not start.prior.feasible(x):
            return 1e12
        r = equation.evaluate(x).residual * weights
        return 0.5 * float((r**2).sum()) + start.prior.value(x)

    best = cost(target_x)
    target = best * 1.01
    begun = time.perf_counter()
    reached: list[float] = []

    def watch(value: float) -> bool:
        if value <= target:
            reached.append(time.perf_counter() - begun)
        return value <= target

    descend_at_fixed_weights(equation, start, weights, watch)
    mine = reached.pop()

    scale = np.maximum(np.abs(start.x), 1e-2 * np.abs(start.x).max())
    scale[equation.layout.compliance] = start.x[equation.layout.compliance]
    lower, upper = start.bounds.lower / scale, start.bounds.upper / scale
    begun = time.perf_counter()
    least = [np.inf]

    def callback(z: np.ndarray, state: object) -> bool:
        least[0] = min(least[0], float(state.fun))  # type: ignore[attr-defined]
        if state.fun <= target:  # type: ignore[attr-defined]
            reached.append(time.perf_counter() - begun)
            return True
        return time.perf_counter() - begun > limit

    minimize(
        lambda z: cost(z * scale),
        start.x / scale,
        method="trust-constr",
        jac="2-point",
        bounds=ScipyBounds(lower, upper, keep_feasible=True),  # type: ignore[arg-type]
        callback=callback,
        options={"maxiter": 100000, "gtol": 1e-12, "xtol": 1e-14},
    )
    other = reached[0] if reached else time.perf_counter() - begun
    bound = "" if reached else f"  (stopped; its cost was still {least[0] / best:.3g} times the optimum)"
    print("to within 1 % of the optimal cost, 2-DOF: ", end="")
    print(f"Gauss–Newton {mine * 1e3:.1f} ms, trust-constr {other:.2f} s")
    print(f"  ratio {'≥ ' if not reached else ''}{other / mine:.0f}{bound}")


def descend_at_fixed_weights(
    equation: Equation, start: Start, weights: np.ndarray, reached: Callable[[float], bool]
) -> None:
    """The solver's own loop with fixed weights, so that both methods see the same cost."""
    problem = PlainProblem(equation, start.prior)
    point = equation.at(start.x)
    now = point.evaluate(start.x)
    cost = weighted_cost(now, weights, start.prior, start.x)
    begin = Solution(start.x, point, now, weights, cost, np.zeros(len(start.x), bool), False)
    reach = Reach(start.bounds, start.prior.feasible, equation.layout.compliance)
    Descent(
        problem, reach, begin, negligible=0.0, damped=True, watch=lambda now: reached(now.place.objective)
    ).run(60)


def against_pinocchio(measurements: MeasurementSet, label: str) -> None:
    equation, start = prepared(measurements)
    count = 0
    evaluate = equation.evaluate

    def counted(x: np.ndarray) -> Evaluation:
        nonlocal count
        count += 1
        return evaluate(x)

    equation.evaluate = counted  # type: ignore[method-assign]
    ratios = []
    for _ in range(5):
        count = 0
        begun = time.perf_counter()
        gauss_newton(equation, start.prior, start.bounds, start.x)
        mine = time.perf_counter() - begun
        model = measurements.robot.model
        data = model.createData()
        q, v, a = (np.ascontiguousarray(x) for x in equation.signals.theta[:3])
        begun = time.perf_counter()
        for _ in range(count):
            for k in range(len(q)):
                pin.computeRNEADerivatives(model, data, q[k], v[k], a[k])
                pin.computeJointTorqueRegressor(model, data, q[k], v[k], a[k])
        bare = time.perf_counter() - begun
        ratios.append(mine / bare)
    print(f"{label}: solver {mine * 1e3:.0f} ms ({count} evaluations of {len(q)} samples), ", end="")
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


def main() -> None:
    parser = argparse.ArgumentParser(description="Speed, as ratios measured in one run.")
    parser.add_argument("--limit", type=float, default=60.0, help="give trust-constr this many seconds")
    arguments = parser.parse_args()
    with threadpool_limits(1):
        observer()
        with tempfile.TemporaryDirectory() as folder:
            planar = read_set(sessions_dir() / "planar-2r-demo")
            against_pinocchio(planar, "2-DOF")
            simulate_preset("panda", Path(folder) / "panda")
            against_pinocchio(read_set(Path(folder) / "panda"), "7-DOF")
        against_trust_constr(planar, arguments.limit)


if __name__ == "__main__":
    main()
