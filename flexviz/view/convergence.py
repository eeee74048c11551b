"""The solver's way: cost, step and every parameter per iteration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from flexviz.charts import COLOURS, Line, Plot, no_plot

if TYPE_CHECKING:
    from flexviz.progress import Iteration

LINES = 14  # parameters drawn at most


def convergence_plots(iterations: Sequence[Iteration]) -> tuple[Plot, ...]:
    """Cost and step (logarithmic), and the parameters as a share of where they are now."""
    x_label = "iteration"
    if not iterations:
        keys = ("cost", "step", "parameters")
        return tuple(
            no_plot(
                key,
                "Cost, step and parameters appear here, live, after Run (step 3, Identify)." if not i else "",
            )
            for i, key in enumerate(keys)
        )
    x = np.arange(1.0, len(iterations) + 1.0)
    cost = positive([iteration.cost for iteration in iterations])
    step = positive([iteration.step for iteration in iterations])
    if len(step) > 1 and iterations[0].step <= 0:
        step[0] = step[1]  # nothing was stepped to the start
    if len(x) == 1:
        x, cost, step = np.array([1.0, 2.0]), np.repeat(cost, 2), np.repeat(step, 2)
    return (
        Plot(
            "cost",
            "Cost (weights are renewed on the way)",
            x,
            (Line("cost", COLOURS.measured, cost),),
            x_label,
            logarithmic=True,
        ),
        Plot(
            "step",
            "Step (relative; 0.001 and less at the bottom)",
            x,
            (Line("step", COLOURS.model, step),),
            x_label,
            logarithmic=True,
        ),
        Plot("parameters", "Parameters / present value", x, scaled(iterations, len(x)), x_label, height=260),
    )


def scaled(iterations: Sequence[Iteration], length: int) -> tuple[Line, ...]:
    """Each parameter divided by its present value; of many, stiffness and motor inertia first."""
    names = iterations[-1].names
    rows = [iteration.values for iteration in iterations if tuple(iteration.names) == tuple(names)]
    values = np.array(rows, dtype=float).reshape(len(rows), len(names))
    if len(values) < length:  # an earlier stage had other parameters
        values = np.concatenate((np.repeat(values[:1], length - len(values), axis=0), values))
    now = values[-1]
    scale = np.where(np.abs(now) > 1e-9, np.abs(now), 1.0)
    shares = np.clip(np.nan_to_num(values / scale), -5.0, 5.0)
    chosen = sorted(range(len(names)), key=lambda i: (rank(names[i]), i))[:LINES]
    return tuple(
        Line(
            short(names[i]),
            COLOURS.series[place % len(COLOURS.series)],
            shares[:, i],
            dashed=place >= len(COLOURS.series),
        )
        for place, i in enumerate(chosen)
    )


def rank(name: str) -> int:
    """How early a parameter is drawn; the order does not change while a fit runs."""
    parameter = name.partition(":")[0]
    order = ("stiffness", "motor_inertia", "link_viscous_friction", "motor_viscous_friction")
    if parameter in order:
        return order.index(parameter)
    return len(order) + ("." not in parameter)


def short(name: str) -> str:
    """ "stiffness:panda_joint1" as it fits a legend: K panda_joint1."""
    from flexviz.wording import SYMBOLS

    parameter, _, joint = name.partition(":")
    return f"{SYMBOLS.get(parameter, parameter)} {joint}".strip()


def positive(values: Sequence[float], floor: float = 1e-3) -> np.ndarray:
    """The values, none below `floor`, so that a logarithmic axis can show them."""
    return np.maximum(np.nan_to_num(np.asarray(values, dtype=float), nan=0.0, posinf=0.0), floor)


def progress_text(iterations: Sequence[Iteration]) -> str:
    """One line about a running fit."""
    if not iterations:
        return "starting"
    last = iterations[-1]
    return f"iteration {len(iterations)} ({last.stage}): cost {last.cost:.4g}, step {last.step:.1e}"
