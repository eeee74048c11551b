"""Cost of one simulated controller cycle against the four bare ABA calls that it cannot do without.

python benchmarks/simulation.py
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flexviz._pinocchio import pin
from flexviz.simulation import make_plan

DURATION = 2.0  # [s] simulated


def best(work: Callable[[], object], repeats: int = 3) -> float:
    """Shortest of a few runs [s]."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    for name in ("paper-b", "panda"):
        plan = make_plan(name)
        group = replace(plan.groups[0], duration=DURATION)
        cycles = round(DURATION / plan.controller.cycle)
        model = plan.robot.model_with(plan.model.inertial)
        data, aba = model.createData(), pin.aba
        q, v, tau = np.random.default_rng(0).normal(size=(3, plan.robot.n))

        def bare(model=model, data=data, aba=aba, q=q, v=v, tau=tau, cycles=cycles) -> None:  # type: ignore[no-untyped-def]
            for _ in range(4 * cycles):
                aba(model, data, q, v, tau)

        ours, floor = best(lambda plan=plan, group=group: plan.run(group)), best(bare)
        cost = f"{ours / cycles * 1e6:.1f} µs a cycle of {plan.controller.cycle * 1e3:g} ms"
        ratios = f"{ours / floor:.1f} × the bare ABA calls, {DURATION / ours:.0f} × real time"
        print(f"{name}: {plan.robot.n} joints, {cost}, {ratios}")


if __name__ == "__main__":
    main()
