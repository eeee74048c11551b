"""Why a fit did not converge: the joints that keep it from ending, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.analysis.estimation import Solution, Start, bounded_step, normal_equations
from flexviz.analysis.identification.thresholds import IDENTIFICATION
from flexviz.base.arrays import Array, Bools
from flexviz.content.records import ParameterEstimate, ResidualSummary
from flexviz.content.wording import listed, normalised, percent, plain_name
from flexviz.model.equation import Layout

BY_DESIGN = ("stiffness", "motor_inertia")  # parameters that a healthy fit determines within their bounds


@dataclass(frozen=True, eq=False)
class Unrest:
    """How far a fit is from its end.

    Attributes:
        joints: shape (n,), share of each joint.
        parameters: shape (P,), squared length of the next step; empty if unknown.
    """

    joints: Array
    parameters: Array


def unrest_of(solution: Solution, start: Start, layout: Layout) -> Unrest:
    """The remaining step of a fit: its squared length in standard deviations, parameter by parameter."""
    normal = normal_equations(solution, start.prior)
    step, _ = bounded_step(normal.gradient, normal.hessian, solution.x, start.bounds)
    parts = np.maximum(step * (normal.hessian @ step), 0.0)
    names = [joint for _, joint, _ in layout.names()]
    joints = np.array([parts[[name == joint for name in names]].sum() for joint in layout.joints])
    return Unrest(joints / max(float(joints.sum()), 1e-300), parts)


def unrest_by_residual(chi: Array) -> Unrest:
    """The same by the joints' shares of the residual, shape (n,)."""
    return Unrest(chi / max(float(chi.sum()), 1e-300), np.zeros(0))


def far_above_noise(residual: ResidualSummary) -> Bools:
    """Joints whose error is not that of the sensors, shape (n,)."""
    return np.array(residual.rms) > IDENTIFICATION.far_above_noise * np.array(residual.noise_floor)


def unexplained(residual: ResidualSummary) -> Unrest | None:
    """Joints of which a fit explains no more than a constant would, far above the noise; None if none."""
    shares = np.array(normalised(residual.rms, residual.torque_spread or [np.nan] * len(residual.rms)))
    nothing = (shares >= IDENTIFICATION.nothing_explained) & far_above_noise(residual)
    return unrest_by_residual(np.where(nothing, shares, 0.0)) if nothing.any() else None


def why_not(
    unrest: Unrest, layout: Layout, parameters: Sequence[ParameterEstimate], residual: ResidualSummary
) -> str:
    """A clause on each joint that keeps a fit from ending, the worst first."""
    order = np.argsort(-unrest.joints)
    least = min(IDENTIFICATION.unrest, float(unrest.joints[order[0]]))
    shares = normalised(residual.rms, residual.torque_spread or [np.nan] * layout.n)
    clauses = []
    for j in (int(j) for j in order if unrest.joints[j] >= least):
        found = _reasons(j, unrest, layout, parameters, shares[j])
        clauses.append(f"{layout.joints[j]} cannot be fitted, because {listed(found)}")
    return "; ".join(clauses)


def _reasons(
    j: int, unrest: Unrest, layout: Layout, parameters: Sequence[ParameterEstimate], share: float
) -> list[str]:
    own = [p for p in parameters if p.joint == layout.joints[j] and (p.name in BY_DESIGN or "." in p.name)]
    bound = [plain_name(p.name) for p in own if p.at_bound]
    unknown = [plain_name(p.name) for p in own if p.identifiable == "no" and not p.at_bound]
    out = []
    if bound:
        out.append(f"its {listed(bound)} ended at the bound of what is possible")
    if unknown:
        out.append(f"the data do not determine its {listed(unknown)}")
    if share >= IDENTIFICATION.bad_share:
        out.append(f"its error is {percent(share)} of its torque")
    if not out and len(unrest.parameters):
        mine = [k for k, (_, joint, _) in enumerate(layout.names()) if joint == layout.joints[j]]
        k = max(mine, key=lambda k: unrest.parameters[k])
        out.append(f"its {plain_name(layout.names()[k][0])} still moves")
    return out or ["its residual is the furthest above the noise"]
