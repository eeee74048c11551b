"""Effects whose size changes during the recordings: laws of no library, however well a constant size fits."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from flexviz.diagnosis.conclusion import Conclusion
from flexviz.diagnosis.constancy import ChangingSize, changing_size
from flexviz.diagnosis.own_start import OwnStart

from flexviz.diagnosis import Diagnosis, constancy, diagnose, forward_search
from flexviz.diagnosis.acceptance import Gained, exhausted, held_to_be_zero, verdict
from flexviz.diagnosis.fit_context import FitContext
from flexviz.effects import EFFECTS, ChosenEffect, ParameterSpec
from flexviz.equation import Layout, layout_of
from flexviz.estimation import Covariance
from flexviz.identification import identify
from flexviz.measurements import MeasurementSet
from flexviz.progress import never
from flexviz.recording.texts import diagnosis_text
from flexviz.view import verdict_html
from flexviz.wording import verdict_text
from tests.unknown_laws import search_of, step_from

FRICTION = ChosenEffect("coulomb_friction", 1)
HIDDEN = 3.0  # [Nm] of joint 2 in the demonstration


def with_growing_friction(
    measurements: MeasurementSet, share: float, along_load: bool = False
) -> MeasurementSet:
    """The motor pays for friction that grows from 3 (1 − share) to 3 (1 + share) Nm in a group, or with load.

    The motion is the same, since the torque that the friction takes is added to that of the motor.
    """
    low, high = np.quantile(
        np.concatenate([s.tau[:, 1] for g in measurements.groups for s in g.segments]), (0.05, 0.95)
    )
    groups = []
    for group in measurements.groups:
        segments = []
        start, end = group.segments[0].time[0], group.segments[-1].time[-1]
        for segment in group.segments:
            velocity = np.gradient(segment.theta[:, 1], segment.step)
            along = 2 * (segment.time - start) / (end - start) - 1
            if along_load:  # nearly: the motor's torque includes that of its own inertia and friction
                along = (2 * segment.tau[:, 1] - low - high) / (high - low)
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
    assert first.confidence <= 0.7
    (note,) = [n.text for n in grown.notes if n.kind == "changing"]
    name, _, rest = note.partition(" is not constant: it grows from about ")
    start, end = (float(word) for word in rest.split(" Nm ")[0].split(" to "))
    assert name == f"coulomb of the {EFFECTS[first.effect].title.lower()} of joint2"
    assert start == pytest.approx(0.6 * HIDDEN, rel=0.1) and end == pytest.approx(1.4 * HIDDEN, rel=0.1)
    assert note in grown.summary()
    again = replace(grown, verdict="unknown")  # as of the set with that effect in its model
    assert verdict_text(again) == f"Unknown: {note}."
    for text in (again.summary(), verdict_html(again), diagnosis_text(again)):
        assert text.count(note[1:]) == 1  # once, not as verdict and as note
    assert verdict_text(again, ["it"]).endswith(f"not all of the error is explained: {note}.")
    assert grown.guard is None  # no other bandwidth is needed to see that


def test_a_constant_friction_is_constant(demo: MeasurementSet, diagnosed_demo: Diagnosis) -> None:
    assert not any(n.kind == "changing" for n in diagnosed_demo.notes)
    layout = Layout(demo.joints, (FRICTION,))
    assert diagnosed_demo.model is not None
    for share, along_load, changing in (
        (0.0, False, False), (0.1, False, False), (0.4, False, True), (-0.4, False, True), (0.4, True, True),
    ):  # fmt: skip
        context = FitContext(with_growing_friction(demo, share, along_load), layout)
        fit = context.fit(layout, layout.vector(diagnosed_demo.model), iterations=3)
        found = changing_size(context, fit)
        assert (found is not None) == changing
        if found is not None:
            assert found.named == ("coulomb_friction", "joint2", None, None)
            ends = HIDDEN * (1 - share), HIDDEN * (1 + share)
            assert found.along == ("load" if along_load else "time")
            assert (found.start, found.end) == pytest.approx(ends, rel=0.25 if along_load else 0.1)
            assert ("grows" in found.text) == (share > 0)
            assert changing_size(context, fit, rival=found.gain) is None


def test_what_grows_from_nothing_is_not_constant_whatever_else_is_left(
    demo: MeasurementSet, diagnosed_demo: Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> None:
    layout = Layout(demo.joints, (FRICTION,))
    assert diagnosed_demo.model is not None
    for share, along_load, changing in ((1.0, False, True), (0.6, False, False), (1.0, True, False)):
        context = FitContext(with_growing_friction(demo, share, along_load), layout)
        fit = context.fit(layout, layout.vector(diagnosed_demo.model), iterations=3)
        assert changing_size(context, fit) is not None
        with monkeypatch.context() as patch:
            patch.setattr(constancy, "sum_above_noise", lambda fit: 1e12)
            assert (changing_size(context, fit) is not None) == changing


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


def test_a_share_follows_the_friction_that_scales_it(demo: MeasurementSet) -> None:
    """With no friction on the motor the law scales with a fifth of both sides': the torque is there."""
    effect = ChosenEffect("friction_drift", 0)
    layout = Layout(demo.joints, (effect,))
    context = FitContext(demo, layout)
    x = context.start(layout).x.copy()
    where, motor, link = (
        layout.effect_slice(effect), layout.motor_viscous.start, layout.link_viscous.start
    )  # fmt: skip
    x[where], x[motor], x[link] = (0.5, 4.0), 0.0, 10.0
    matrix = np.zeros((layout.size, layout.size))
    for std, zero in ((0.2, False), (0.3, True)):  # u = 0.2 · 10 · a: 1 ± 2 σ
        matrix[where.start, where.start] = std**2
        fit = context.fit(layout, x, iterations=0)
        fit = replace(fit, covariance=Covariance(matrix.copy(), np.zeros(layout.size)))
        assert held_to_be_zero(context, fit, effect) == zero


def test_only_the_effect_that_changes_is_doubted(grown: Diagnosis, demo: MeasurementSet) -> None:
    layout = Layout(demo.joints, (FRICTION,))
    context = FitContext(demo, layout)
    fit = context.fit(layout, context.start(layout).x, iterations=0)
    size = EFFECTS["coulomb_friction"].parameters[0]
    sure = [
        replace(grown.findings[0], effect=name, confidence=0.95) for name in ("coulomb_friction", "backlash")
    ]
    for joint, doubted in (("joint2", 0.7), ("joint1", 0.95)):
        changing = ChangingSize(("coulomb_friction", joint, None, None), size, "time", 1.0, 2.0, 300.0, 300.0)
        last = Conclusion(fit, "unknown", context.covariance(fit), changing=changing)
        assert [f.confidence for f in last.doubted(sure)] == [doubted, 0.95]
    assert Conclusion(fit, "unknown", last.covariance).doubted(sure) == sure


def test_without_apply_the_change_is_told_too(demo: MeasurementSet) -> None:
    result = diagnose(with_growing_friction(demo, 0.4))
    assert result.verdict == "missing" and not result.steps[1:]
    assert result.findings[0].confidence <= 0.7
    assert [n.kind for n in result.notes][:1] == ["changing"]


@pytest.mark.parametrize(
    "start, end, unit, along, words",
    [
        (1.0, 2.0, "Nm", "time", "grows from about 1 to 2 Nm during a recording, which"),
        (-2.0, -1.0, "-", "time", "falls from about -2 to -1 during"),
        (
            -0.5,
            0.4,
            "rad",
            "load",
            "changes from about -0.5 to 0.4 rad with the torque that the joint transmits",
        ),
        (0.0, 0.4, "rad", "time", "grows from about 0 to 0.4 rad during"),
    ],
)
def test_words(start: float, end: float, unit: str, along: Literal["time", "load"], words: str) -> None:
    size = ParameterSpec("half_width", unit)
    text = ChangingSize(("backlash", "j", None, None), size, along, start, end, 1.0, 1.0).text
    assert text.startswith("half width of the backlash of j is not constant: it ") and words in text


def test_a_group_too_short_for_a_sample_is_left_out(demo: MeasurementSet) -> None:
    first = demo.groups[0]
    (segment,) = first.segments
    short = replace(segment, time=segment.time[:40], theta=segment.theta[:40], tau=segment.tau[:40])
    tiny = replace(first, name="tiny", segments=(short,))
    measurements = with_growing_friction(replace(demo, groups=(tiny, *demo.groups)), 0.4)
    layout = Layout(demo.joints, (FRICTION,))
    context = FitContext(measurements, layout)
    fit = context.fit(layout, context.start(layout).x, iterations=6)
    assert changing_size(context, fit) is not None


def test_nothing_more_is_scored_where_nothing_can_be_gained(demo: MeasurementSet) -> None:
    layout = Layout(demo.joints)
    context = FitContext(demo, layout)
    fit = context.fit(layout, context.start(layout).x, iterations=2)
    above = fit.point.objective + (fit.held_out.objective if fit.held_out else 0.0)
    assert above > 1000 and not exhausted(fit, Gained(0.0, np.zeros(2)))
    limit = above / 0.003
    assert exhausted(fit, Gained(5 * limit, np.array([1.01, 3.0]) * limit))
    assert not exhausted(fit, Gained(5 * limit, np.array([0.99, 3.0]) * limit))  # on joint 1 it can


def test_the_start_is_given_or_found(demo: MeasurementSet, diagnosed_demo: Diagnosis) -> None:
    model = diagnosed_demo.model
    assert model is not None
    assert OwnStart(demo, lambda: model, None).model() == (model, 0)
    other = OwnStart(demo, None, None)
    other.use(model)
    assert other.model() == (model, 0)
    other.use(model, 12)
    assert other.model() == (model, 12)
    found, steps = OwnStart(demo, lambda: None, never).model()
    layout, plain = layout_of(demo), identify(demo).model
    fit = FitContext(demo, layout).fit(layout, layout.vector(plain), iterations=steps)
    assert steps > 0 and found.stiffness == pytest.approx(layout.model(fit.x).stiffness)
    begun = OwnStart(demo, None, never)
    assert begun.model()[0].stiffness == pytest.approx(found.stiffness)
    begun.close()
    stopped, steps = OwnStart(demo, None, lambda: True).model()
    assert steps == 0 and stopped.stiffness != pytest.approx(found.stiffness)


def test_a_model_without_effects_leaves_hardly_more_than_noise(demo: MeasurementSet) -> None:
    """Its residual has no reversals whose torques are only roughly known: less is needed to be unknown."""
    for layout, most in ((Layout(demo.joints), 0.4), (Layout(demo.joints, (FRICTION,)), 1.5)):
        context = FitContext(demo, layout)
        fit = context.fit(layout, context.start(layout).x, iterations=0)
        for excess, said in ((0.95 * most, "nothing-missing"), (1.05 * most, "unknown")):
            level = np.full(2, 1.0 + excess)
            left = replace(fit, chi=level, chi_held_out=level)
            assert verdict(left, left) == said


@pytest.mark.parametrize(
    ("last", "sure", "share", "drift", "unexplained"),
    [
        ("unknown", True, 0.2, True, False),  # the drift of a size explains what is left
        ("unknown", False, 0.8, True, False),  # of a main effect: how well it is known does not matter
        ("unknown", False, 0.2, True, True),
        ("unknown", True, 0.2, False, True),
        ("nothing-missing", False, 0.2, False, False),
    ],
)
def test_a_change_of_what_may_be_an_imitation_explains_nothing(
    demo: MeasurementSet,
    monkeypatch: pytest.MonkeyPatch,
    last: str,
    sure: bool,
    share: float,
    drift: bool,
    unexplained: bool,
) -> None:
    search = search_of(demo)
    search.steps = [step_from(search.base, ChosenEffect("base_tilt", None))]
    monkeypatch.setattr(forward_search, "verdict", lambda *_: last)
    monkeypatch.setattr(forward_search, "uncertain", lambda *_: not sure)
    monkeypatch.setattr(forward_search, "removed_share", lambda *_: share)
    monkeypatch.setattr(forward_search, "explained_by_drift", lambda *_: drift)
    assert search.unexplained == unexplained
