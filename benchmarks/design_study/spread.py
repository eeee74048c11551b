"""Designed groups against the paper's group B at equal duration and within the limits that B uses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.design_study.sets import designed_groups, noisy_sets, without_validation
from benchmarks.tables import markdown
from flexviz.analysis.designing import Design, DesignSettings, design, predict_errors
from flexviz.analysis.identification import identify
from flexviz.model.simulation import Plan, make_plan, move

Array = NDArray[np.float64]
NAMES = ("stiffness", "motor_inertia", "link_viscous_friction", "motor_viscous_friction")


@dataclass(frozen=True)
class Row:
    """One parameter over all seeds: predicted standard error, bias and spread of the estimates."""

    label: str
    truth: float
    unit: str
    predicted: float
    bias: float
    spread: float


def used_by(plan: Plan) -> dict[str, list[float]]:
    """Limits that a plan's motion just keeps."""
    runs = move(plan).values()

    def most(values: list[Array]) -> list[float]:
        return np.max([np.abs(v).max(axis=0) for v in values], axis=0).tolist()

    rates = [np.gradient(run.theta_velocity, run.time[1] - run.time[0], axis=0) for run in runs]
    return {
        "lower": np.min([run.theta_ref.min(axis=0) for run in runs], axis=0).tolist(),
        "upper": np.max([run.theta_ref.max(axis=0) for run in runs], axis=0).tolist(),
        "velocity": most([run.theta_velocity for run in runs]),
        "acceleration": most(rates),
        "torque": most([run.tau for run in runs]),
    }


def run(seeds: int, evaluations: int) -> tuple[Design, dict[str, list[Row]]]:
    """The design, and the rows of group B and of the designed groups."""
    plan = without_validation(make_plan("paper-b", start="moving"))
    settings = DesignSettings.of(groups=3, duration=10.0, evaluations=evaluations, limits=used_by(plan))
    found = design(plan, settings=settings)
    planned = replace(plan, start="rest", groups=designed_groups(found, None))
    return found, {"group B": rows(plan, seeds), "designed": rows(planned, seeds)}


def rows(plan: Plan, seeds: int) -> list[Row]:
    """Predicted and realised errors of the dynamic parameters."""
    estimates = []
    for measurements in noisy_sets(plan, range(seeds)):
        result = identify(measurements, refine=True)
        assert result.converged
        estimates.append([p for p in result.parameters if p.name in NAMES])
    first = next(noisy_sets(plan, [10_000]))
    predicted = [e for e in predict_errors(first, plan.model) if e.name in NAMES]
    values = np.array([[p.value for p in one] for one in estimates])
    return [
        Row(e.label, e.value, e.unit, e.std, float(v.mean() - e.value), float(v.std(ddof=1)))
        for e, v in zip(predicted, values.T, strict=True)
    ]


def table(found: dict[str, list[Row]]) -> str:
    """Markdown table: per parameter predicted and realised, of B and of the design."""
    b, d = found["group B"], found["designed"]
    rows = [
        ["parameter", "true", "group B: predicted", "realised", "designed: predicted", "realised", "gain"]
    ]
    for one, two in zip(b, d, strict=True):
        numbers = [f"{x:.2g}" for x in (one.predicted, one.spread, two.predicted, two.spread)]
        rows.append([one.label, f"{one.truth:g} {one.unit}", *numbers, f"{one.spread / two.spread:.1f}"])
    return markdown(rows, numbers=False)


def as_predicted(found: dict[str, list[Row]], seeds: int) -> bool:
    """Whether every spread agrees with its prediction within four standard errors of a standard deviation."""
    allowed = 4 / np.sqrt(2 * seeds)
    return all(abs(row.spread / row.predicted - 1) < allowed for one in found.values() for row in one)
