"""Search backwards from a rich model, for robots that hide many effects at once.

Adding one effect at a time to a poor model goes astray: its parameters run to wherever they absorb most, and
imitations win. Here every usual effect starts on every joint; what held-out groups and the residual do not need
is taken away. Then all other effects are scored at once on what is left, the best of each joint are added,
and the model is thinned out again, until nothing is found.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.candidates import candidates
from flexviz.diagnosis.elimination import Necessity, eliminate
from flexviz.diagnosis.motion_fit import MotionContext, MotionFit, place
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS, ChosenEffect, JointScale
from flexviz.equation import Layout
from flexviz.estimation import Projection, ScoredCandidate, best_intervals, score

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.motion


@dataclass(frozen=True, eq=False)
class RichModel:
    """The smallest model found.

    Attributes:
        fit: its fit.
        needed: how much it needs each of its effects.
        leading: the best candidates that were not added.
    """

    fit: MotionFit
    needed: dict[ChosenEffect, Necessity]
    leading: tuple[ScoredCandidate, ...]


class RichSearch:
    """A search on one set.

    Args:
        context: the data.
        own: effects of the set's own model, which stay.
        say: called with a progress message; may raise to stop.
    """

    def __init__(self, context: MotionContext, own: Layout, say: Callable[[str], None]) -> None:
        self.context, self.own, self.say = context, own, say
        self._refused: set[ChosenEffect] = set()

    def check(self) -> None:
        self.say("")

    def run(self) -> RichModel:
        """The smallest model that is as good as the rich one."""
        self.say("fitting all usual effects on all joints")
        fit, needed = self.thinned(self.usual_fit())
        leading: list[ScoredCandidate] = []
        for _ in range(LIMITS.rounds):
            self.say("scoring what is left")
            leading = self.scores(fit)
            chosen = self.best_of_each_joint(fit, leading)
            if not chosen:
                break
            names = ", ".join(sorted({EFFECTS[s.effect.effect].title for s in chosen}))
            self.say(f"adding: {names}")
            larger, kept = self.thinned(self.with_candidates(fit, chosen))
            added = {s.effect for s in chosen}
            self._refused |= added - set(kept)
            if added & set(kept) and larger.objective < fit.objective:
                fit, needed = larger, kept
            else:
                self._refused |= added
        return RichModel(fit, needed, tuple(leading[: LIMITS.leading]))

    # -- the rich model

    def usual_fit(self) -> MotionFit:
        """Every usual effect on every joint, from small sizes."""
        own = set(self.own.effects)
        usual = (
            ChosenEffect(name, joint)
            for name, law in EFFECTS.items()
            if law.usual
            for joint in range(self.own.n)
        )
        layout = Layout(self.own.joints, (*self.own.effects, *(e for e in usual if e not in own)))
        x = self.context.start(layout).x.copy()
        for effect, where in layout.effect_slices():
            values = np.array(EFFECTS[effect.effect].typical(self.scale(effect.joint or 0)))
            values[: EFFECTS[effect.effect].size_count] *= LIMITS.small_start
            x[where] = values
        return self.context.fit(layout, x, check=self.check)

    def scale(self, joint: int) -> JointScale:
        """Magnitudes of a joint's motion in the fit groups."""
        signals, x = self.context.signals, self.context.start(Layout(self.own.joints)).x
        layout = Layout(self.own.joints)
        torque = float(np.sqrt(np.mean(signals.tau[0, :, joint] ** 2)))
        compliance, inertia = x[layout.compliance], x[layout.motor_inertia]
        neighbour = joint - 1 if joint else min(1, self.own.n - 1)
        return JointScale(
            torque=torque,
            speed=float(np.sqrt(np.mean(signals.theta[1, :, joint] ** 2))),
            deflection=torque * float(compliance[joint]),
            stiffness=1 / float(compliance[joint]),
            motor_inertia=float(inertia[joint]),
            neighbour_inertia=float(inertia[neighbour]),
            position=float(np.mean(signals.theta[0, :, joint])),
            duration=float(np.ptp(signals.time)),
        )

    # -- backwards

    def thinned(self, fit: MotionFit) -> tuple[MotionFit, dict[ChosenEffect, Necessity]]:
        """The model without the effects that it does not need, fitted again until all are needed."""
        firm = frozenset(self.own.effects)
        for _ in range(LIMITS.eliminations):
            result = eliminate(fit, firm)
            merged = self.merged_offsets(fit.layout, result.x, tuple(result.kept))
            if not result.dropped and merged is None:
                return fit, result.kept
            kept, x = merged or (tuple(result.kept), result.x)
            smaller = Layout(fit.layout.joints, kept)
            fit = self.context.fit(smaller, smaller.vector(fit.layout.model(x)), check=self.check)
        return fit, eliminate(fit, frozenset(fit.layout.effects)).kept

    def merged_offsets(
        self, layout: Layout, x: Array, kept: tuple[ChosenEffect, ...]
    ) -> tuple[tuple[ChosenEffect, ...], Array] | None:
        """A torque offset beside a spring becomes part of the spring's rest angle; None without any such."""
        x, merged = x.copy(), []
        springs = {e.joint: e for e in kept if EFFECTS[e.effect].offset_parameter}
        for effect in kept:
            if effect.effect != "torque_offset" or effect.joint not in springs or effect in self.own.effects:
                continue
            where = place(layout, springs[effect.joint])
            stiffness, rest = x[where]
            if stiffness <= 0:
                continue
            x[where.start + 1] = np.clip(rest - x[place(layout, effect).start] / stiffness, -50.0, 50.0)
            merged.append(effect)
        return (tuple(e for e in kept if e not in merged), x) if merged else None

    # -- what is left

    def scores(self, fit: MotionFit) -> list[ScoredCandidate]:
        """Scores of all effects that a model lacks, the best first."""
        weigh = self.weigh(fit)
        residual, jacobian = fit.whitened
        flat = jacobian.reshape(-1, fit.layout.size)
        projection = Projection(residual.ravel(), flat, flat.T @ flat + fit.prior_hessian)
        wanted = [e for e in candidates(fit.layout, self.fit_groups) if e not in self._refused]
        found = score(fit.point, fit.chain, wanted, weigh, projection)
        for joint in range(fit.layout.n):
            self.check()
            intervals = best_intervals(fit.point, joint, weigh, projection, longest=LIMITS.longest_episode)
            found += [s for s in intervals if s.effect not in self._refused]
        return sorted(found, key=lambda s: -s.gain)

    @property
    def fit_groups(self) -> list:
        return [g for g in self.context.measurements.groups if not g.validation]

    def weigh(self, fit: MotionFit) -> Callable[[Array, int], Array]:
        """Function that weights the columns of a stretch like the residual of a fit."""

        def weigh(columns: Array, block: int) -> Array:
            rows = self.context.signals.blocks[block].rows
            return (columns * fit.weights[rows][:, :, None]).reshape(-1, columns.shape[2])

        return weigh

    def best_of_each_joint(self, fit: MotionFit, leading: list[ScoredCandidate]) -> list[ScoredCandidate]:
        """The best candidate of each joint, and of those without one, that explains a clear share."""
        chosen: dict[int | None, ScoredCandidate] = {}
        quiet = fit.rms < LIMITS.quiet * self.context.noise_floor
        for s in leading:
            law, joint = EFFECTS[s.effect.effect], s.effect.joint
            least = LIMITS.least_share_episode if law.scope == "episode" else LIMITS.least_share
            if s.gain < least * len(fit.weights) or law.replaces:
                continue
            if joint not in chosen and not (joint is not None and quiet[joint]):
                chosen[joint] = s
        return list(chosen.values())

    def with_candidates(self, fit: MotionFit, chosen: list[ScoredCandidate]) -> MotionFit:
        """The model with candidates at their scored values, fitted."""
        replaced = {(EFFECTS[s.effect.effect].replaces, s.effect.joint) for s in chosen}
        kept = tuple(e for e in fit.layout.effects if (e.effect, e.joint) not in replaced)
        layout = Layout(fit.layout.joints, (*kept, *(s.effect for s in chosen)))
        x = layout.vector(fit.layout.model(fit.x))
        for s in chosen:
            x[place(layout, s.effect)] = s.values
        return self.context.fit(layout, x, check=self.check)
