"""Parameter estimates of a solution: values, standard errors, and how far the data identify them."""

from __future__ import annotations

import numpy as np

from flexviz.analysis.estimation import BaseParameters, Covariance, Prior
from flexviz.analysis.identification.thresholds import IDENTIFICATION, IdentificationThresholds
from flexviz.base.arrays import Array, Bools
from flexviz.base.statistics import NORMAL_95
from flexviz.base.units import joint_unit
from flexviz.content.records import Combination, Grade, ParameterEstimate
from flexviz.model.effects import EFFECTS
from flexviz.model.equation import INERTIAL_NAMES, Layout
from flexviz.robot.model import INERTIAL_UNITS


def grade(kind: str, std: float, scale: float, prior_share: float) -> Grade:
    """ "yes", "weak" or "no"; a parameter that owes its precision to the prior is at most weak."""
    if not np.isfinite(std) or scale <= 0:
        return "no"
    sure, weak = IDENTIFICATION.grades[kind]
    relative = std / scale
    if relative <= sure and prior_share < IDENTIFICATION.prior_share:
        return "yes"
    return "weak" if relative <= weak else "no"


def natural_scale(prior: Prior) -> Array:
    """Prior standard deviation of the inertial parameters around CAD, shape (10n,)."""
    x = np.zeros(prior.layout.size)
    x[prior.layout.inertial] = prior.cad.ravel()
    hessian = prior.gradient_and_hessian(x)[1]
    spread = np.empty(prior.cad.size)
    for body in range(len(prior.cad)):
        rows = slice(10 * body, 10 * body + 10)
        spread[rows] = np.sqrt(np.diag(np.linalg.inv(hessian[rows, rows])))
    return spread


def parameter_estimates(
    layout: Layout,
    x: Array,
    start: Array,
    covariance: Covariance,
    at_bound: Bools,
    prior: Prior,
    thresholds: IdentificationThresholds = IDENTIFICATION,
    unbound: tuple[Covariance, Covariance] | None = None,
    samples: int = 1000,
) -> tuple[ParameterEstimate, ...]:
    """All parameters of the model in the order of the solver's vector, then the friction sums.

    `unbound`, `samples`: for `rigid_above`; covariances without holding a stiffness at its bound.
    """
    cov, share = covariance.matrix, covariance.prior_share
    values, begin = x.copy(), start.copy()
    values[layout.compliance] = 1 / x[layout.compliance]
    begin[layout.compliance] = 1 / start[layout.compliance]
    variance = np.maximum(np.diag(cov), 0.0)
    std = np.sqrt(variance)
    std[layout.compliance] *= values[layout.compliance] ** 2
    specs = [p for effect in layout.effects for p in EFFECTS[effect.effect].parameters]
    given = np.array([False] * layout.effect_start + [p.given for p in specs])
    at_bound = at_bound & ~given
    std[at_bound], std[given] = np.inf, 0.0
    kinds, scales = _kinds_and_scales(layout, x, values, prior, thresholds)
    names, labels = layout.names(), layout.labels()
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = cov / np.sqrt(np.outer(variance, variance))
    places = {k: effect for effect, where in layout.effect_slices() for k in range(where.start, where.stop)}
    out = []
    above = rigid_above(layout, x, unbound or (covariance, covariance), at_bound & (x < start), samples)
    for k in map(int, np.flatnonzero(~layout.held)):
        name, joint, unit = names[k]
        identifiable = "yes" if given[k] else grade(kinds[k], std[k], scales[k], share[k])
        tied: tuple[str, ...] = ()
        if identifiable != "yes" and not at_bound[k]:
            row = np.abs(np.nan_to_num(correlation[k]))
            row[k] = 0.0
            strongest = np.argsort(-row)[:4]
            tied = tuple(labels[i] for i in strongest if row[i] >= IDENTIFICATION.tied)
        effect = places.get(k)
        out.append(
            ParameterEstimate(
                name=name,
                joint=joint,
                value=float(values[k]),
                std=float(std[k]),
                unit=unit,
                start=float(begin[k]),
                identifiable=identifiable,
                tied_to=tied,
                at_bound=bool(at_bound[k]),
                payload=effect.payload if effect else None,
                group=effect.group if effect else None,
                rigid_above=above.get(k),
            )
        )
    return (*out, *_friction_sums(layout, x, start, covariance))


def rigid_above(
    layout: Layout, x: Array, covariances: tuple[Covariance, Covariance], at_lowest: Bools, samples: int
) -> dict[int, float]:
    """Place of each stiffness that may be infinite -> what it is above, at 95 % [Nm/rad].

    The compliance c enters the equation nearly linearly, so that c = 0, a model with one parameter less,
    costs (c/σ)²/2 nats and saves ½ ln N (Schwarz). It is also as good where c is held at its lower bound.
    `covariances`: with what the model lacks, for the limit, and of chance alone, which decides.
    """
    out, (errors, chance) = {}, (one.standard_errors for one in covariances)
    for k in range(layout.compliance.start, layout.compliance.stop):
        saved = np.sqrt(np.log(samples)) * float(chance[k])
        if not layout.held[k] and (x[k] < saved or at_lowest[k]):
            out[k] = 1 / (float(x[k]) + NORMAL_95 * float(errors[k]))
    return out


def _friction_sums(layout: Layout, x: Array, start: Array, covariance: Covariance) -> list[ParameterEstimate]:
    """Sum of the viscous friction on both sides of each joint, better determined than its parts."""
    out = []
    sides = [rows for rows in (layout.link_viscous, layout.motor_viscous) if x[rows].size]
    for j, joint in enumerate(layout.joints):
        if j in layout.no_torque:
            continue
        pair = [rows.start + j for rows in sides]
        total = float(x[pair].sum())
        std = float(np.sqrt(max(covariance.matrix[np.ix_(pair, pair)].sum(), 0.0)))
        identifiable = grade("friction", std, max(total, 1e-12), float(min(covariance.prior_share[pair])))
        unit, begin = joint_unit("Nm s/rad", j in layout.sliding), float(start[pair].sum())
        out.append(ParameterEstimate("viscous_friction_sum", joint, total, std, unit, identifiable, begin))
    return out


def _kinds_and_scales(
    layout: Layout, x: Array, values: Array, prior: Prior, thresholds: IdentificationThresholds
) -> tuple[list[str], Array]:
    kinds = ["friction"] * layout.effect_start
    kinds[layout.inertial] = ["inertial"] * (10 * layout.n)
    kinds[layout.compliance] = ["stiffness"] * layout.n
    kinds[layout.motor_inertia] = ["motor_inertia"] * len(x[layout.motor_inertia])
    scales = np.abs(values).copy()
    scales[layout.inertial] = np.maximum(np.abs(x[layout.inertial]), natural_scale(prior))
    floor = np.maximum(thresholds.viscous_floor * (x[layout.link_viscous] + layout.motor_side(x)[1]), 1e-12)
    for part in (layout.link_viscous, layout.motor_viscous):
        scales[part] = np.maximum(x[part], floor[: len(x[part])])
    for effect, where in layout.effect_slices():
        kinds += ["effect"] * len(EFFECTS[effect.effect].parameters)
        scales[where] = np.maximum(np.abs(x[where]), thresholds.effect_floor * prior.spread[where])
    return kinds, scales


def combinations(
    base: BaseParameters, layout: Layout, x: Array, cov: Array, prior: Prior
) -> tuple[Combination, ...]:
    """The base parameters with their standard errors."""
    inertial = layout.inertial
    labels = [f"{INERTIAL_NAMES[k]}:{joint}" for joint in layout.joints for k in range(10)]
    spread = natural_scale(prior)
    values = base.matrix @ x[inertial]
    deviation = np.sqrt(
        np.maximum(np.einsum("ij,jk,ik->i", base.matrix, cov[inertial, inertial], base.matrix), 0.0)
    )
    out = []
    for i, column in enumerate(base.columns):
        row = base.matrix[i]
        before = float(np.sqrt(np.sum((row * spread) ** 2)))
        scale = max(abs(values[i]), before)
        # the share of the prior: how far the data have narrowed what was plausible before
        share = min(1.0, (deviation[i] / before) ** 2)
        out.append(
            Combination(
                base.names[i],
                float(values[i]),
                float(deviation[i]),
                INERTIAL_UNITS[INERTIAL_NAMES[column % 10]],
                grade("inertial", float(deviation[i]), scale, share),
                {labels[k]: float(row[k]) for k in np.flatnonzero(row)},
            )
        )
    return tuple(out)


def condition_number(jacobian: Array, layout: Layout, base: BaseParameters, at_bound: Bools) -> float:
    """Of the weighted Jacobian (M, P), columns scaled to unit length, over base and joint parameters."""
    columns = [c for c in base.columns] + [
        k for k in range(layout.inertial.stop, layout.size) if not at_bound[k]
    ]
    part = jacobian[:, columns]
    norm = np.linalg.norm(part, axis=0)
    part = part[:, norm > 0] / norm[norm > 0]
    values = np.linalg.eigvalsh(part.T @ part)
    return float(np.sqrt(values[-1] / max(values[0], 1e-300)))
