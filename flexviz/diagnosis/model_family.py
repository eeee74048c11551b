"""Models in the band of the motion: the rich one, and ones with more effects."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.fit_context import STEPS
from flexviz.diagnosis.motion_fit import MotionContext, MotionFit
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS, ChosenEffect, JointScale, neighbour
from flexviz.equation import Layout
from flexviz.estimation import Covariance, ScoredCandidate

Array = NDArray[np.float64]

(OFFSET,) = (name for name, law in EFFECTS.items() if law.constant)


@dataclass(frozen=True, eq=False)
class PlainModel:
    """A fitted model without the free curves beside which it was estimated.

    Attributes:
        layout, x: the model and its parameters, shape (P,).
        kept: rows of the fit's parameters that are those of the model, shape (P,).
    """

    layout: Layout
    x: Array
    kept: NDArray[np.intp]

    def covariance(self, fit: MotionFit) -> Covariance:
        """Of its parameters."""
        whole = fit.covariance
        return Covariance(whole.matrix[np.ix_(self.kept, self.kept)], whole.prior_share[self.kept])


def without_curves(fit: MotionFit, curves: Collection[ChosenEffect]) -> PlainModel:
    """A fitted model without free curves."""
    kept = np.ones(fit.layout.size, bool)
    for curve in curves:
        kept[fit.layout.effect_slice(curve)] = False
    layout = Layout(fit.layout.joints, tuple(e for e in fit.layout.effects if e not in curves))
    return PlainModel(layout, fit.x[kept], np.flatnonzero(kept))


class ModelFamily:
    """Fits of one set's models.

    Args:
        context: the data.
        own: the set's own model, whose effects stay.
        say: called with a progress message; may raise to stop.
    """

    def __init__(self, context: MotionContext, own: Layout, say: Callable[[str], None]) -> None:
        self.context, self.own, self.say = context, own, say

    def fit(self, layout: Layout, x: Array, iterations: int = STEPS) -> MotionFit:
        """A model fitted from x, shape (P,)."""
        return self.context.fit(layout, x, iterations=iterations, check=lambda: self.say(""))

    def weigh(self, fit: MotionFit) -> Callable[[Array, int], Array]:
        """Function that weights the columns of a stretch like the residual of a fit."""

        def weigh(columns: Array, block: int) -> Array:
            rows = self.context.signals.blocks[block].rows
            return (columns * fit.weights[rows][:, :, None]).reshape(-1, columns.shape[2])

        return weigh

    def usual_fit(self, beside: MotionFit | None = None) -> MotionFit:
        """Every usual effect on every joint, from small sizes; `beside`: a model whose effects are kept."""
        have = self.own.effects if beside is None else beside.layout.effects
        replaced = {(EFFECTS[e.effect].replaces, e.joint) for e in have}
        names, joints = (name for name, law in EFFECTS.items() if law.usual), range(self.own.n)
        usual = (ChosenEffect(name, joint) for name in names for joint in joints)
        more = (e for e in usual if e not in have and (e.effect, e.joint) not in replaced)
        layout = Layout(self.own.joints, (*have, *more))
        start = self.context.start(layout).x
        x = start.copy() if beside is None else layout.vector(beside.layout.model(beside.x))
        for effect, where in layout.effect_slices():
            if beside is not None and effect in have:
                continue
            law = EFFECTS[effect.effect]
            values = np.array(law.typical(self.scale(effect.joint or 0, layout, start)))
            values[list(law.size_at)] *= THRESHOLDS.criterion.tolerance
            x[where] = values
        return self.fit(layout, x, STEPS // 2)  # it need not converge

    def scale(self, joint: int, layout: Layout, x: Array) -> JointScale:
        """Magnitudes of a joint's motion in the fit groups, with a model's parameters x, shape (P,)."""
        signals = self.context.signals
        torque = float(np.sqrt(np.mean(signals.tau[0, :, joint] ** 2)))
        compliance, inertia = x[layout.compliance], x[layout.motor_inertia]
        return JointScale(
            torque=torque,
            speed=float(np.sqrt(np.mean(signals.theta[1, :, joint] ** 2))),
            deflection=torque * float(compliance[joint]),
            stiffness=1 / float(compliance[joint]),
            motor_inertia=float(inertia[joint]),
            neighbour_inertia=float(inertia[neighbour(joint, layout.n)]),
            position=float(np.mean(signals.theta[0, :, joint])),
            duration=float(np.ptp(signals.time)),
            viscous=float(x[layout.link_viscous][joint] + x[layout.motor_viscous][joint]),
        )

    def offsets_of_springs(self, layout: Layout) -> frozenset[ChosenEffect]:
        """Torque offsets beside a spring, whose rest angle they stand for during the search.

        k (q − q₀) with both free is singular where k is small; k (q − q̄) and an offset are linear.
        """
        springs = {e.joint for e in layout.effects if EFFECTS[e.effect].offset_parameter}
        return frozenset(e for e in layout.effects if e.effect == OFFSET and e.joint in springs)

    def with_offsets_merged(self, fit: MotionFit) -> MotionFit:
        """The fit of that model; the given one if there are no such offsets."""
        if not (offsets := self.offsets_of_springs(fit.layout) - set(self.own.effects)):
            return fit
        smaller = Layout(fit.layout.joints, tuple(e for e in fit.layout.effects if e not in offsets))
        x = smaller.vector(fit.layout.model(fit.x))
        for offset in offsets:
            torque = float(fit.x[fit.layout.effect_slice(offset).start])
            for effect, where in smaller.effect_slices():
                if effect.joint == offset.joint:
                    x[where] = EFFECTS[effect.effect].with_constant(x[where], torque)
        return self.fit(smaller, x)

    def with_candidates(self, fit: MotionFit, chosen: list[ScoredCandidate]) -> tuple[Layout, Array]:
        """The model with candidates, and its parameters with them at their scored values."""
        replaced = {(EFFECTS[s.effect.effect].replaces, s.effect.joint) for s in chosen}
        kept = tuple(e for e in fit.layout.effects if (e.effect, e.joint) not in replaced)
        springs = [s for s in chosen if EFFECTS[s.effect.effect].offset_parameter]
        offsets = (ChosenEffect(OFFSET, s.effect.joint) for s in springs)
        new = dict.fromkeys((*(s.effect for s in chosen), *offsets))
        layout = Layout(fit.layout.joints, (*kept, *(e for e in new if e not in kept)))
        x = layout.vector(fit.layout.model(fit.x))
        for s in chosen:
            x[layout.effect_slice(s.effect)] = s.values
        return layout, x
