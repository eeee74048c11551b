"""Effects that these data cannot tell from one that was found, and the motion that would."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.coarse import Coarse, CoarseModel
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.analysis.estimation import Projection
from flexviz.base.facts import Fact
from flexviz.content.records import Tie
from flexviz.data.measurements import Group
from flexviz.model.effects import EFFECTS, ChosenEffect
from flexviz.model.effects.free_curve import NODES
from flexviz.model.equation import Signals

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

LIMITS = THRESHOLDS.evidence


def ties(view: Coarse, model: CoarseModel, effect: ChosenEffect, rivals: Sequence[str]) -> Iterator[Tie]:
    """Twins whose signature in these data is nearly the effect's own, and laws that fit as well."""
    fit, law = model.fit, EFFECTS[effect.effect]
    names = [name for name in dict.fromkeys((*law.twins, *rivals)) if name in EFFECTS]
    if not names or effect not in fit.layout.effects:
        return
    residual, jacobian = fit.whitened
    own = fit.layout.effect_slice(effect)
    others = np.delete(np.arange(fit.layout.size), own)
    flat = jacobian.reshape(-1, fit.layout.size)
    precision = (fit.information + fit.prior_derivatives[1])[np.ix_(others, others)]
    projection = Projection(residual.ravel(), flat[:, others], precision)

    def outside(column: Array) -> Array:
        left = projection.rest(column[:, None])[:, 0]
        return left / max(float(np.linalg.norm(left)), 1e-300)

    mine = outside(flat[:, own.start])
    for name in names:
        joints: Iterable[int | None] = [effect.joint if EFFECTS[name].scope == "joint" else None]
        if effect.joint is None or name == effect.effect:
            joints = range(fit.layout.n)
        for joint in joints:
            other = ChosenEffect(name, joint)
            if other in fit.layout.effects:
                continue
            columns = [
                outside((fit.chain.column(guess.entry, guess.joints, one) * fit.weights).ravel())
                for guess in EFFECTS[name].guesses(fit.point.context, other.place)
                for one in guess.columns
            ]
            there = max(columns, key=lambda column: abs(float(column @ mine)), default=0 * mine)
            best = abs(float(there @ mine))
            if best > LIMITS.tied_correlation or name in rivals:
                yield Tie(name, fit.layout.joint_name(other), best, telling_motion(view, effect, mine, there))


def telling_motion(view: Coarse, effect: ChosenEffect, mine: Array, other: Array) -> Fact:
    """The motion or payload in which two unit signatures, shape (N·n,), differ most."""
    signals, joints = view.context.signals, view.own.joints
    squares = (mine - float(mine @ other) * other).reshape(-1, len(joints)) ** 2
    density = squares.sum(axis=1)
    if density.sum() <= 1e-12:
        return Fact("alike-in-all-motion")
    joint = effect.joint if effect.joint is not None else int(np.argmax(squares.sum(axis=0)))
    kinds = (
        (float(density[rows].mean() / density.mean()), kind, group)
        for kind, group, rows in _kinds_of_motion(signals, joint)
    )
    ratio, kind, group = max(kinds, key=lambda found: found[0])
    values = {"motion": kind, "ratio": ratio}
    if group is None:
        return Fact("differ-in-motion", joints=(joints[joint],), values=values)
    return Fact("differ-in-motion", groups=(group.name,), values=values | {"payload": group.payload})


def _kinds_of_motion(signals: Signals, joint: int) -> Iterator[tuple[str, Group | None, Ints]]:
    """Each extreme of a joint's motion, and each group, with its samples."""
    position, load = signals.theta[0, :, joint], np.abs(signals.tau[0, :, joint])
    speed, acceleration = np.abs(signals.theta[1:3, :, joint])
    for values, least, most in (
        (speed, "slow", "fast"),
        (load, "unloaded", "loaded"),
        (acceleration, "", "accelerated"),
        (position, "low", "high"),
    ):
        parts = np.array_split(np.argsort(values), NODES)
        yield from ((kind, None, parts[end]) for kind, end in ((least, 0), (most, -1)) if kind)
    for k, group in enumerate(signals.groups):
        rows = np.flatnonzero(signals.group == k)
        if len(rows):
            yield "group", group, rows
