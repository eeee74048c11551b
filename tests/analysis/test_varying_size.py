"""Effects whose size changes during the recordings: laws of no library, however well a constant size fits."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from flexviz.analysis.diagnosis import Diagnosis, diagnose
from flexviz.analysis.diagnosis.fine import Fine
from flexviz.analysis.diagnosis.fit_context import FitContext
from flexviz.analysis.diagnosis.varying_size import ChangingSize, changing_size
from flexviz.content.rendering import panel
from flexviz.content.topics import verdict_panel
from flexviz.content.wording import verdict_text
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS, ChosenEffect, ParameterSpec
from flexviz.model.equation import Layout
from flexviz.outlets.recording.texts import diagnosis_text

FRICTION = ChosenEffect("coulomb_friction", 1)
FRICTION_NAMED = ("coulomb_friction", "joint2", None, None)
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


@pytest.mark.slow
def test_a_growing_friction_is_unknown(demo: MeasurementSet, grown: Diagnosis) -> None:
    """Friction of a constant size is missing, and is not all that is."""
    assert grown.verdict == "missing" and grown.steps[-1].verdict == "unknown"
    (first,) = grown.findings
    assert first.text == "coulomb_friction:joint2"
    assert first.parameters["coulomb"].value == pytest.approx(HIDDEN, rel=0.1)
    assert grown.where[0].joint == "joint2"
    assert grown.guard is None  # no other bandwidth is needed to see that
    assert diagnose(with_growing_friction(demo, 0.4)).verdict == "missing"


def test_a_size_that_changes_is_the_verdict(grown: Diagnosis) -> None:
    size = ChangingSize(FRICTION_NAMED, EFFECTS["coulomb_friction"].parameters[0], "time", 1.8, 4.2)
    told, said = replace(grown, verdict="unknown", notes=(size.fact,)), size.fact.text
    assert verdict_text(told) == f"Unknown: {said}."
    for text in (told.summary(), panel(verdict_panel(told, True)), diagnosis_text(told)):
        assert text.count(said[1:]) == 1  # once, not as verdict and as note
    assert verdict_text(told, ["it"]).endswith(f"not all of the error is explained: {said}.")


def test_a_constant_friction_is_constant(demo: MeasurementSet, diagnosed_demo: Diagnosis) -> None:
    assert not any(n.kind == "changing" for n in diagnosed_demo.notes)
    layout, own = Layout(demo.joints, (FRICTION,)), Layout(demo.joints)
    assert diagnosed_demo.model is not None
    for share, along_load, changing in (
        (0.0, False, False), (0.1, False, False), (0.4, False, True), (-0.4, False, True), (0.4, True, True),
    ):  # fmt: skip
        fine = Fine(FitContext(with_growing_friction(demo, share, along_load), own), own, lambda _: None)
        found = changing_size(fine, fine.begin(layout, layout.vector(diagnosed_demo.model), iterations=3))
        assert (found is not None) == changing
        if found is not None:
            assert found.named == FRICTION_NAMED
            ends = HIDDEN * (1 - share), HIDDEN * (1 + share)
            assert found.along == ("load" if along_load else "time")
            assert (found.start, found.end) == pytest.approx(ends, rel=0.25 if along_load else 0.15)
            assert (found.end > found.start) == (share > 0)


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
    text = ChangingSize(("backlash", "j", None, None), size, along, start, end).fact.text
    assert text.startswith("half width of the backlash of j is not constant: it ") and words in text


def test_a_group_too_short_for_a_sample_is_left_out(demo: MeasurementSet) -> None:
    first = demo.groups[0]
    (segment,) = first.segments
    short = replace(segment, time=segment.time[:40], theta=segment.theta[:40], tau=segment.tau[:40])
    tiny = replace(first, name="tiny", segments=(short,))
    measurements = with_growing_friction(replace(demo, groups=(tiny, *demo.groups)), 0.4)
    layout, own = Layout(demo.joints, (FRICTION,)), Layout(demo.joints)
    fine = Fine(FitContext(measurements, own), own, lambda _: None)
    assert changing_size(fine, fine.begin(layout, fine.context.start(layout).x, iterations=6)) is not None
