"""Why a fit did not converge: the joints that keep it from ending, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexviz.analysis.estimation import Solution, Start, bounded_step, normal_equations
from flexviz.analysis.identification.thresholds import IDENTIFICATION
from flexviz.base.arrays import Array, Bools
from flexviz.base.facts import Fact
from flexviz.content.records import ParameterEstimate, ResidualSummary, normalised
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
) -> Iterator[Fact]:
    """The joints that keep a fit from ending, the worst first."""
    order = np.argsort(-unrest.joints)
    least = min(IDENTIFICATION.unrest, float(unrest.joints[order[0]]))
    shares = normalised(residual.rms, residual.torque_spread or [np.nan] * layout.n)
    for j in (int(j) for j in order if unrest.joints[j] >= least):
        reasons = _reasons(j, unrest, layout, parameters, shares[j])
        yield Fact("joint-not-fitted", "wrong", (layout.joints[j],), values=reasons)


def _reasons(
    j: int, unrest: Unrest, layout: Layout, parameters: Sequence[ParameterEstimate], share: float
) -> dict[str, Any]:
    """Parameters at a bound and undetermined ones, a bad error; of a joint without any what still moves."""
    own = [p for p in parameters if p.joint == layout.joints[j] and (p.name in BY_DESIGN or "." in p.name)]
    out = {
        "at_bound": tuple(p.name for p in own if p.at_bound),
        "undetermined": tuple(p.name for p in own if p.identifiable == "no" and not p.at_bound),
        "share": share if share >= IDENTIFICATION.bad_share else None,
        "moves": None,
    }
    if not any(out.values()) and len(unrest.parameters):
        mine = [k for k, (_, joint, _) in enumerate(layout.names()) if joint == layout.joints[j]]
        out["moves"] = layout.names()[max(mine, key=lambda k: unrest.parameters[k])][0]
    return out
