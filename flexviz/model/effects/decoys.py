"""Decoys: candidates that cannot be right, with which a search shows how often it would accept an accident.

Each is dry friction of a motion that its joint has not made: that of another joint, of another time, in
reversed time, or of another run. They compete with the real candidates where a diagnosis is asked for that,
and are never part of a model otherwise.
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from flexviz.model.effects.effect import Effect
from flexviz.model.effects.terms import Array, Context, EffectTarget, ParameterSpec, Terms, smooth_sign

SHIFTED_BY = 3  # part of a stretch


class Decoy(Effect):
    """Dry friction of a wrong motion."""

    where = "motor"
    explanation = "Not physics: friction of a motion that the joint has not made, to count false findings."
    signature = "None: it can fit by accident only."
    confirm = "Nothing: it is always wrong."
    reference = (
        "Elias, Gygi: Target-decoy search strategy for increased confidence, Nature Methods 4(3), 2007"
    )
    equation = "u = f sign(w), w a velocity of another joint or time"
    linear = True
    shift = 0  # of the joint, on the way round
    parameters = (ParameterSpec("coulomb", "Nm", explanation="size", symbol="f"),)

    @abstractmethod
    def wrong(self, velocities: list[Array]) -> list[Array]:
        """The wrong velocity in every stretch, shape (N,) each, from those of joint + `shift`."""

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        joint = place.own_joint
        motions = context.motions((joint + self.shift) % context.joints())
        parts = [smooth_sign(v)[None] for v in self.wrong([motion.velocity for motion in motions])]
        slopes = context.filtered(parts, joint, 3)[..., None]
        return Terms("torque", (joint,), values[0] * slopes[0], slopes)


class OtherJoint(Decoy):
    """Of another joint: the next one on the way round."""

    name = "decoy_other_joint"
    title = "Decoy: another joint's friction"
    fewest_joints = 2
    shift = 1

    def wrong(self, velocities: list[Array]) -> list[Array]:
        return velocities


class OtherTime(Decoy):
    """A third of the stretch later."""

    name = "decoy_other_time"
    title = "Decoy: friction at another time"

    def wrong(self, velocities: list[Array]) -> list[Array]:
        return [np.roll(v, len(v) // SHIFTED_BY) for v in velocities]


class ReversedTime(Decoy):
    """In reversed time."""

    name = "decoy_reversed"
    title = "Decoy: friction in reversed time"

    def wrong(self, velocities: list[Array]) -> list[Array]:
        return [v[::-1] for v in velocities]


class OtherRun(Decoy):
    """Of another stretch of the recordings; of the same one, turned round in its middle, for the last."""

    name = "decoy_other_run"
    title = "Decoy: another run's friction"

    def wrong(self, velocities: list[Array]) -> list[Array]:
        others = [*velocities[1:], np.roll(velocities[0][::-1], len(velocities[0]) // 2)]
        return [np.resize(other, len(own)) for own, other in zip(velocities, others, strict=True)]


DECOYS: dict[str, Decoy] = {one.name: one for one in (OtherJoint(), OtherTime(), ReversedTime(), OtherRun())}
