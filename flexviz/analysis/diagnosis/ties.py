"""Effects that these data cannot tell from one that was found, and the motion that would."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.coarse import Coarse, CoarseModel
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.analysis.estimation import Projection
from flexviz.content.records import Tie
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


def telling_motion(view: Coarse, effect: ChosenEffect, mine: Array, other: Array) -> str:
    """Sentence that names the motion or payload in which two unit signatures, shape (N·n,), differ most."""
    signals, joints = view.context.signals, view.own.joints
    squares = (mine - float(mine @ other) * other).reshape(-1, len(joints)) ** 2
    density = squares.sum(axis=1)
    if density.sum() <= 1e-12:
        return "The two effects look the same in every motion of this set: record a different kind of motion."
    joint = effect.joint if effect.joint is not None else int(np.argmax(squares.sum(axis=0)))
    kinds = _kinds_of_motion(signals, joint, joints[joint])
    ratio, text = max((float(density[rows].mean() / density.mean()), text) for text, rows in kinds)
    return f"They differ most in {text} ({ratio:.1f} times the average): record more data of this kind."


def _kinds_of_motion(signals: Signals, joint: int, name: str) -> Iterator[tuple[str, Ints]]:
    """Description and samples of each extreme of a joint's motion, and of each group."""
    position, load = signals.theta[0, :, joint], np.abs(signals.tau[0, :, joint])
    speed, acceleration = np.abs(signals.theta[1:3, :, joint])
    for values, least, most in (
        (speed, f"slow motion and reversals of {name}", f"fast motion of {name}"),
        (load, f"torque near zero on {name}", f"high torque on {name}"),
        (acceleration, "", f"strong acceleration of {name}"),
        (position, f"low positions of {name}", f"high positions of {name}"),
    ):
        parts = np.array_split(np.argsort(values), NODES)
        yield from ((text, parts[end]) for text, end in ((least, 0), (most, -1)) if text)
    for k, group in enumerate(signals.groups):
        rows = np.flatnonzero(signals.group == k)
        if len(rows):
            yield f"motion and payload of group {group.name} (payload {group.payload})", rows
