"""Effects of load, mounting and surroundings, on the link side."""

from __future__ import annotations

import numpy as np

from flexviz.effects.base import (
    Array,
    Context,
    Effect,
    EffectTarget,
    Guess,
    JointMotion,
    LawEffect,
    ParameterSpec,
    Terms,
)

GRAVITY = 9.81  # [m/s²]


class CableSpring(Effect):
    """Cables, hoses or a balancer that pull the joint towards a rest angle."""

    name = "cable_spring"
    title = "Cable spring"
    where = "link"
    explanation = "Cables, hoses or a balancer pull the joint towards a rest angle like a spring."
    equation = "u = k_c (q − q₀)"
    signature = "A straight line against position, the same in both directions."
    confirm = "Slow motion over the whole range, in poses with different gravity load."
    reference = (
        "Swevers, Verdonck, De Schutter: Dynamic model identification for industrial robots, "
        "IEEE Control Systems Magazine 27(5), 2007"
    )
    parameters = (
        ParameterSpec("stiffness", "Nm/rad", 0.0, explanation="of the spring", symbol="k_c"),
        ParameterSpec("rest_angle", "rad", -50.0, 50.0, "angle without pull", "q₀"),
    )
    state = True

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        assert place.joint is not None
        q = context.link_state(place.joint)[:1, :, None]
        slopes = np.stack((q - values[1], np.full_like(q, -values[0])))
        return Terms("residual", (place.joint,), values[0] * (q - values[1]), slopes)

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        assert place.joint is not None
        q = context.link_state(place.joint)[:1, :, None]

        def to_values(c: Array) -> Array:
            return np.array([c[0], -c[1] / c[0] if c[0] else 0.0])

        return [Guess("residual", (place.joint,), np.stack((q, np.ones_like(q))), to_values)]


class PayloadError(Effect):
    """The payload is heavier or lighter than it was said to be."""

    name = "payload_error"
    title = "Payload error"
    where = "load"
    explanation = "The named payload's mass and inertia are wrong by a common factor."
    equation = "Γ_payload → (1 + e) Γ_payload"
    signature = "A residual like that payload's own weight, in the groups that carry it."
    confirm = "Weigh the payload, or run the same motion without it."
    simulated = "The payload's mass and inertia are multiplied by 1 + e in the runs that carry it."
    reference = (
        "Khalil, Gautier, Lemoine: Identification of the payload inertial parameters of industrial "
        "manipulators, ICRA 2007"
    )
    parameters = (
        ParameterSpec("relative_mass_error", "-", -0.95, 10.0, "true mass over the given one, less one", "e"),
    )
    scope = "payload"
    state = True

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        assert place.payload is not None
        column = context.payload_torque(place.payload)[None]
        return Terms("residual", tuple(range(context.joints())), values[0] * column, column[None])

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        terms = self.terms(context, place, np.zeros(1))
        return [Guess("residual", terms.joints, terms.slopes, lambda c: c)]


class BaseTilt(Effect):
    """The robot does not stand level."""

    name = "base_tilt"
    title = "Base tilt"
    where = "load"
    explanation = "The robot does not stand level, so gravity comes from a slightly different direction."
    equation = "g = Rᵀ(0, 0, −9.81),  R = Ry(tilt_y) Rx(tilt_x)"
    signature = "A gravity-like residual, a quarter turn out of step with gravity itself."
    confirm = "A level; or poses of the first axis all round."
    simulated = "Gravity points along Rᵀ(0, 0, −1)."
    reference = (
        "Featherstone: Rigid Body Dynamics Algorithms (gravity as the base's acceleration), Springer, 2008"
    )
    parameters = (
        ParameterSpec("tilt_x", "rad", lower=-0.6, upper=0.6, explanation="about the base's x"),
        ParameterSpec("tilt_y", "rad", lower=-0.6, upper=0.6, explanation="about the base's y"),
    )
    scope = "set"
    state = True

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        directions, slopes = tilted_gravity(*values)
        unit = np.stack([context.gravity_torque(axis) for axis in range(3)])  # torque per unit acceleration
        level = np.array([0.0, 0.0, -GRAVITY])
        value = np.tensordot(directions - level, unit, axes=1)[None]
        return Terms(
            "residual", tuple(range(context.joints())), value, np.tensordot(slopes, unit, axes=1)[:, None]
        )

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        terms = self.terms(context, place, np.zeros(2))
        return [Guess("residual", terms.joints, terms.slopes, lambda c: np.clip(c, -0.5, 0.5))]


def tilted_gravity(tilt_x: float, tilt_y: float) -> tuple[Array, Array]:
    """Rᵀ(0, 0, −g) for R = Ry(tilt_y) Rx(tilt_x), shape (3,), and its slopes, shape (2, 3) [m/s²]."""
    sx, cx, sy, cy = np.sin(tilt_x), np.cos(tilt_x), np.sin(tilt_y), np.cos(tilt_y)
    # third row of R: (−sin y, cos y sin x, cos y cos x)
    value = -GRAVITY * np.array([-sy, cy * sx, cy * cx])
    slopes = -GRAVITY * np.array([[0.0, cy * cx, -cy * sx], [-cy, -sy * sx, -sy * cx]])
    return value, slopes


class ExternalContact(LawEffect):
    """Somebody or something pushed the arm for a while.

    Each edge is spread over one sample to either side, as smoothly as its slope needs: u is then as exact as
    its integral, and ∂u/∂start and ∂u/∂end are its true derivatives.
    """

    name = "external_contact"
    title = "External contact"
    where = "load"
    explanation = "Something touched or pushed the arm during part of one run."
    equation = "τ_ext = T for t₁ ≤ t ≤ t₂, in one group"
    signature = "A box in time, in one group only."
    confirm = "Repeat the run: a contact does not come back."
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
        assert place.joint is not None and place.group is not None
        terms = super().terms(context, place, values)
        inside = context.in_group(place.group)[:, None]
        return Terms(terms.entry, terms.joints, terms.value * inside, terms.slopes * inside)

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        torque, start, end = values
        step = motion.step

        def edge(instant: float) -> tuple[Array, Array]:
            """0 before `instant`, 1 after it, and how fast that falls when the instant moves on [1/s]."""
            late = np.clip((motion.time - instant) / step, -1.0, 1.0)
            return 0.5 + late - 0.5 * late * np.abs(late), (1.0 - np.abs(late)) / step

        (begun, begins), (ended, ends) = edge(start), edge(end)
        box = begun - ended
        return -torque * box, np.stack((-box, torque * begins, -torque * ends))

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        return []  # searched in closed form over all intervals
