"""Decoys: candidates that cannot be right, with which a search shows how often it would accept an accident.

Each is dry friction of a motion that its joint has not made: that of another joint, of another time, in
reversed time, or of another run. They compete with the real candidates where a diagnosis is asked for that,
and are never part of a model otherwise.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from flexviz.effects.effect import Effect
from flexviz.effects.terms import Array, Context, EffectTarget, JointMotion, ParameterSpec, Terms, smooth_sign

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
    decoy: ClassVar[bool] = True
    parameters = (ParameterSpec("coulomb", "Nm", explanation="size", symbol="f"),)

    @abstractmethod
    def velocities(self, context: Context, joint: int) -> list[Array]:
        """The wrong velocity in every stretch, shape (N,) each."""

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        joint = place.own_joint
        parts = [smooth_sign(v)[None] for v in self.velocities(context, joint)]
        slopes = context.filtered(parts, joint, 3)[..., None]
        return Terms("torque", (joint,), values[0] * slopes[0], slopes)


def _of(context: Context, joint: int) -> list[JointMotion]:
    return list(context.motions(joint))


class OtherJoint(Decoy):
    """Of another joint: the first but one on the way round."""

    name = "decoy_other_joint"
    title = "Decoy: another joint's friction"
    fewest_joints = 2

    def velocities(self, context: Context, joint: int) -> list[Array]:
        return [motion.velocity for motion in _of(context, (joint + 1) % context.joints())]


class OtherTime(Decoy):
    """A third of the stretch later."""

    name = "decoy_other_time"
    title = "Decoy: friction at another time"

    def velocities(self, context: Context, joint: int) -> list[Array]:
        return [np.roll(m.velocity, len(m.velocity) // SHIFTED_BY) for m in _of(context, joint)]


class ReversedTime(Decoy):
    """In reversed time."""

    name = "decoy_reversed"
    title = "Decoy: friction in reversed time"

    def velocities(self, context: Context, joint: int) -> list[Array]:
        return [motion.velocity[::-1] for motion in _of(context, joint)]


class OtherRun(Decoy):
    """Of another stretch of the recordings; of the same one, turned round in its middle, for the last."""

    name = "decoy_other_run"
    title = "Decoy: another run's friction"

    def velocities(self, context: Context, joint: int) -> list[Array]:
        all_of_it = [motion.velocity for motion in _of(context, joint)]
        others = [*all_of_it[1:], np.roll(all_of_it[0][::-1], len(all_of_it[0]) // 2)]
        return [np.resize(other, len(own)) for own, other in zip(all_of_it, others, strict=True)]


DECOYS: dict[str, Decoy] = {one.name: one for one in (OtherJoint(), OtherTime(), ReversedTime(), OtherRun())}
