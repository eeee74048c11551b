"""External contact."""

from __future__ import annotations

import numpy as np

from flexviz.model.effects.effect import EffectEvidence, JointScale
from flexviz.model.effects.law import LawEffect
from flexviz.model.effects.terms import Array, Context, EffectTarget, Guess, JointMotion, ParameterSpec, Terms

SMALLEST_CONTACT = 3e-5  # of the joint's rms torque: smaller ones are artefacts of other errors


class ExternalContact(LawEffect):
    """A push on the arm during part of one run.

    Each edge is smoothed over one sample to either side, so that the integral of u is exact and ∂u/∂start and
    ∂u/∂end exist.
    """

    name = "external_contact"
    title = "External contact"
    where = "load"
    plot_against = "time"
    explanation = "Something touched or pushed the arm during part of one run."
    equation = "τ_ext = T for t₁ ≤ t ≤ t₂, in one group"
    signature = "A box in time, in one group only."
    confirm = "Repeat the run: a contact does not recur."
    simulated = "T is added to the link's torque between t₁ and t₂ of that run."
    reference = "Haddadin, De Luca, Albu-Schäffer: Robot collisions: a survey, IEEE T-RO 33(6), 2017"
    parameters = (
        ParameterSpec("torque", "Nm", explanation="positive like the transmission torque", symbol="T"),
        ParameterSpec("start", "s", explanation="when it begins, in the group's own time", symbol="t₁"),
        ParameterSpec("end", "s", explanation="when it ends, not before it begins", symbol="t₂"),
    )
    scope = "episode"
    smooth = True

    def possible(self, values: Array) -> bool:
        return bool(values[1] <= values[2])

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        assert place.group is not None
        terms = super().terms(context, place, values)
        inside = context.in_group(place.group)[:, None]
        return Terms(terms.entry, terms.joints, terms.value * inside, terms.slopes * inside)

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        torque, start, end = values
        step = motion.step

        def edge(instant: float) -> tuple[Array, Array]:
            """Smoothed step at `instant`, and minus its derivative by `instant` [1/s]."""
            late = np.clip((motion.time - instant) / step, -1.0, 1.0)
            return 0.5 + late - 0.5 * late * np.abs(late), (1.0 - np.abs(late)) / step

        (begun, begins), (ended, ends) = edge(start), edge(end)
        box = begun - ended
        return -torque * box, np.stack((-box, torque * begins, -torque * ends))

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        return []  # the interval is found in closed form

    def credible(self, values: Array, evidence: EffectEvidence) -> bool:
        rms = float((evidence.torque**2).mean()) ** 0.5
        return super().credible(values, evidence) and abs(values[0]) > SMALLEST_CONTACT * rms

    def typical(self, scale: JointScale) -> tuple[float, ...]:
        return (0.5 * scale.torque, 0.4 * scale.duration, 0.55 * scale.duration)
