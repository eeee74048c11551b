"""Effects whose size changes during the recordings: laws of no library, however well a constant size fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexviz.diagnosis import Diagnosis, diagnose
from flexviz.diagnosis.acceptance import held_to_be_zero
from flexviz.diagnosis.constancy import changing_size
from flexviz.diagnosis.fit_context import FitContext
from flexviz.effects import ChosenEffect
from flexviz.equation import Layout
from flexviz.estimation import Covariance
from flexviz.measurements import MeasurementSet
from flexviz.wording import verdict_text

FRICTION = ChosenEffect("coulomb_friction", 1)
HIDDEN = 3.0  # [Nm] of joint 2 in the demonstration


def with_growing_friction(measurements: MeasurementSet, share: float) -> MeasurementSet:
    """The motor pays for friction that grows from 3 (1 − share) to 3 (1 + share) Nm in each group.

    The motion is the same, since the torque that the friction takes is added to that of the motor.
    """
    groups = []
    for group in measurements.groups:
        segments = []
        start, end = group.segments[0].time[0], group.segments[-1].time[-1]
        for segment in group.segments:
            velocity = np.gradient(segment.theta[:, 1], segment.step)
            along = 2 * (segment.time - start) / (end - start) - 1
            tau = segment.tau.copy()
            tau[:, 1] += HIDDEN * share * along * np.tanh(velocity / 0.005)
            segments.append(replace(segment, tau=tau))
        groups.append(replace(group, segments=tuple(segments)))
    return replace(measurements, groups=tuple(groups))


@pytest.fixture(scope="module")
def grown(demo: MeasurementSet) -> Diagnosis:
    return diagnose(with_growing_friction(demo, 0.4), apply=True)


def test_a_growing_friction_is_unknown_and_said_to_grow(grown: Diagnosis) -> None:
    assert grown.verdict == "missing" and grown.steps[-1].verdict == "unknown"
    first = grown.findings[0]
    # a friction with presliding takes up a little of the growth: the finding is as doubtful
    assert first.effect in ("coulomb_friction", "presliding_hysteresis") and first.joint == "joint2"
    assert first.confidence < 0.75
    (note,) = [n.text for n in grown.notes if n.kind == "changing"]
    name, _, rest = note.partition(" is not constant: it grows from about ")
    start, end = (float(word) for word in rest.split(" Nm ")[0].split(" to "))
    assert name == f"coulomb of {first.effect}:joint2"
    assert start == pytest.approx(0.6 * HIDDEN, rel=0.1) and end == pytest.approx(1.4 * HIDDEN, rel=0.1)
    assert note in grown.summary()
    again = replace(grown, verdict="unknown")  # as of the set with that effect in its model
    assert verdict_text(again) == f"Unknown: {note}."
    assert verdict_text(again, ["it"]).endswith(f"not all of the error is explained: {note}.")
    assert grown.guard is None  # no other bandwidth is needed to see that


def test_a_constant_friction_is_constant(demo: MeasurementSet, diagnosed_demo: Diagnosis) -> None:
    assert not any(n.kind == "changing" for n in diagnosed_demo.notes)
    layout = Layout(demo.joints, (FRICTION,))
    assert diagnosed_demo.model is not None
    for share, changing in ((0.0, False), (0.1, False), (0.4, True), (-0.4, True)):
        context = FitContext(with_growing_friction(demo, share), layout)
        fit = context.fit(layout, layout.vector(diagnosed_demo.model), iterations=3)
        found = changing_size(context, fit)
        assert (found is not None) == changing
        if found is not None:
            assert found.effect == FRICTION
            ends = HIDDEN * (1 - share), HIDDEN * (1 + share)
            assert (found.start, found.end) == pytest.approx(ends, rel=0.1)
            assert ("grows" in found.text(demo.joints)) == (share > 0)
            assert changing_size(context, fit, rival=found.gain) is None


def test_a_share_of_friction_counts_as_a_torque(demo: MeasurementSet, diagnosed_demo: Diagnosis) -> None:
    """Of a stiff joint only the friction of both sides is known: the share is uncertain, not the drift."""
    effect = ChosenEffect("friction_drift", 0)
    layout = Layout(demo.joints, (FRICTION, effect))
    assert diagnosed_demo.model is not None
    x = layout.vector(diagnosed_demo.model)
    where, viscous = layout.effect_slice(effect), layout.motor_viscous.start
    x[where], x[viscous] = (0.5, 4.0), 2.0
    context = FitContext(demo, layout)
    matrix = np.zeros((layout.size, layout.size))
    rows = [where.start, viscous]
    # σ of the share is 1 (twice the share), of f_mv 4; of their product a f, with −1 between both, 0
    matrix[np.ix_(rows, rows)] = np.outer((1.0, -4.0), (1.0, -4.0))
    fit = replace(context.fit(layout, x, iterations=0), covariance=Covariance(matrix, np.zeros(layout.size)))
    assert not held_to_be_zero(context, fit, effect)
    alone = replace(fit, covariance=Covariance(np.diag(np.diag(matrix)), np.zeros(layout.size)))
    assert held_to_be_zero(context, alone, effect)
