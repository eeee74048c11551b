"""Rigid least squares with the same friction terms, for the comparison of `benchmarks.gallery`.

The usual inverse dynamic model τ = Y(θ, θ̇, θ̈) Γ + B θ̈ + f_v θ̇ + f_c sign(θ̇) by least squares weighted per
joint, with the same zero-phase filter and the same samples as the flexible model. Two ways to treat what the
motion hardly shows: base parameters alone, and all parameters drawn weakly to the CAD values; the better one
counts.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.real import MOVING
from flexviz.analysis.estimation.base_inertials import base_parameters
from flexviz.analysis.identification import Identification
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import choose_effects
from flexviz.model.equation import Equation, Layout, build_signals
from flexviz.model.equation.link import LinkDynamics
from flexviz.model.observers import make_observer

Array = NDArray[np.float64]


def rigid_held_out(measurements: MeasurementSet, flexible: Identification) -> tuple[Array, Array]:
    """Held-out rms ÷ standard deviation of the torque while moving: flexible and rigid fit, (n,) each."""
    n = len(measurements.joints)
    observer = make_observer(flexible.observer_name, flexible.bandwidth)  # type: ignore[arg-type]
    effects = choose_effects([f"{e.effect}:{e.joint}" for e in flexible.model.effects], measurements.joints)

    def system(names: tuple[str, ...]) -> tuple[Array, Array, Array]:
        groups = [g for g in measurements.groups if g.name in names]
        signals = build_signals(measurements, groups, observer)
        y = LinkDynamics(measurements.robot).regressor(*signals.theta[:3])
        torque = signals.tau[0].copy()
        for block in signals.blocks:
            torque[block.rows] -= y[block.rows] @ signals.payload[block.group].ravel()
        columns = [y]
        for k in (2, 1):
            diagonal = np.zeros((signals.count, n, n))
            diagonal[:, range(n), range(n)] = signals.theta[k]
            columns.append(diagonal)
        layout = Layout(measurements.joints, effects)
        equation = Equation(measurements.robot, signals, layout)
        rigid = np.zeros(layout.size)
        rigid[layout.compliance] = 1e-12
        for _, term in equation.at(rigid).terms(rigid):
            block_columns = np.zeros((signals.count, n, len(term.slopes)))
            block_columns[:, list(term.joints)] = term.slopes[:, 0].transpose(1, 2, 0)
            columns.append(block_columns)
        return np.concatenate(columns, axis=2), torque, signals.theta[1]

    fit_columns, fit_torque, _ = system(flexible.groups)
    columns, torque, velocity = system(flexible.validation_groups)
    raw = np.concatenate(
        [s.tau for g in measurements.groups if g.name in flexible.validation_groups for s in g.segments]
    )
    moving = np.abs(velocity) > MOVING
    inertial = 10 * n
    base = list(base_parameters(measurements.robot).columns) + list(range(inertial, columns.shape[2]))
    centre = np.zeros(columns.shape[2])
    centre[:inertial] = measurements.robot.cad_parameters.ravel()
    spread = np.full(columns.shape[2], np.inf)
    size = np.abs(centre[:inertial])
    spread[:inertial] = size + 0.1 * size.reshape(n, 10).max(axis=1).repeat(10)
    candidates = []
    for used, middle, width in (
        (base, np.zeros(len(base)), np.full(len(base), np.inf)),
        (list(range(len(centre))), centre, spread),
    ):
        solution = weighted_least_squares(fit_columns[:, :, used], fit_torque, middle, width)
        candidates.append(_relative(torque - columns[:, :, used] @ solution, moving, raw))
    mine = np.concatenate([flexible.residuals[name].residual for name in flexible.validation_groups])
    return _relative(mine, moving, raw), min(candidates, key=np.mean)


def weighted_least_squares(columns: Array, torque: Array, centre: Array, spread: Array) -> Array:
    """Least squares, each joint with its own weight, iterated, drawn to `centre` with deviations `spread`."""
    size = columns.shape[2]
    sigma = np.sqrt(np.mean(torque**2, axis=0))
    x = centre.copy()
    for _ in range(4):
        a = (columns / sigma[:, None]).reshape(-1, size)
        b = ((torque - columns @ centre) / sigma).ravel()
        keep = np.isfinite(spread)
        a = np.vstack([a, (np.diag(1 / np.where(keep, spread, 1.0)))[keep]])
        b = np.concatenate([b, np.zeros(keep.sum())])
        scale = np.linalg.norm(a, axis=0) + 1e-300
        x = centre + np.linalg.lstsq(a / scale, b, rcond=1e-8)[0] / scale
        sigma = np.sqrt(np.mean((torque - columns @ x) ** 2, axis=0))
    return x


def _relative(residual: Array, moving: NDArray[np.bool_], raw: Array) -> Array:
    size = np.sqrt((residual**2 * moving).sum(axis=0) / moving.sum(axis=0))
    return size / raw.std(axis=0)
