"""Effects that these data cannot tell from one that was found, and the motion that would."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.coarse import Coarse, CoarseModel
from flexviz.diagnosis.result import Tie
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.estimation import Projection

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

LIMITS = THRESHOLDS.evidence
TELLING_SHARE, TELLING_DENSITY = (
    0.02,
    1.5,
)  # least share of the samples, and difference there against the mean


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
            best, there = 0.0, mine
            for guess in EFFECTS[name].guesses(fit.point.context, other.place):
                for one in guess.columns:
                    column = outside((fit.chain.column(guess.entry, guess.joints, one) * fit.weights).ravel())
                    if abs(float(column @ mine)) > best:
                        best, there = abs(float(column @ mine)), column * np.sign(column @ mine)
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
    ranked = [
        (float(density[rows].mean() / density.mean()), text)
        for text, rows in _kinds_of_motion(view, joint, joints[joint]).items()
        if np.count_nonzero(rows) > TELLING_SHARE * signals.count
    ]
    ratio, text = max(ranked, default=(0.0, ""))
    if ratio < TELLING_DENSITY:
        return "They differ slightly in every motion: any additional data would help."
    return f"They differ most in {text} ({ratio:.1f} times the average): record more data of this kind."


def _kinds_of_motion(view: Coarse, joint: int, name: str) -> dict[str, Bools]:
    """Description → samples, shape (N,), of each kind of motion of a joint and of each group."""
    signals = view.context.signals
    position, load = signals.theta[0, :, joint], np.abs(signals.tau[0, :, joint])
    speed, acceleration = np.abs(signals.theta[1:3, :, joint])
    low, high = np.quantile(position, [0.15, 0.85])
    kinds: dict[str, Bools] = {
        f"slow motion and reversals of {name}": speed < np.quantile(speed, 0.15),
        f"fast motion of {name}": speed > np.quantile(speed, 0.85),
        f"high torque on {name}": load > np.quantile(load, 0.85),
        f"torque near zero on {name}": load < np.quantile(load, 0.15),
        f"strong acceleration of {name}": acceleration > np.quantile(acceleration, 0.85),
        f"positions of {name} near {low:.2g} rad": position < low,
        f"positions of {name} near {high:.2g} rad": position > high,
    }
    for k, group in enumerate(signals.groups):
        rows = np.zeros(signals.count, bool)
        for block in signals.blocks:
            rows[block.rows] |= block.group == k
        kinds[f"motion and payload of group {group.name} (payload {group.payload})"] = rows
    return kinds
