"""Long parts of an identification report, and can be stopped, between two steps of the solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexviz.analysis.estimation import Stopped, TwoBandData
from flexviz.analysis.identification import FitSettings, identify
from flexviz.analysis.identification.plain_fit import StepReporter, plain_fit
from flexviz.base.progress import Progress
from flexviz.checks import plausibility_warnings
from flexviz.data.measurements import MeasurementSet
from flexviz.model.equation import OperatingPoint, layout_of


class Counted:
    """A `watch` that stops at its `most`-th call."""

    def __init__(self, most: float = np.inf) -> None:
        self.calls, self.most = 0, most

    def __call__(self) -> None:
        self.calls += 1
        if self.calls >= self.most:
            raise Stopped


def test_progress_comes_at_every_evaluation_of_the_equation(demo, monkeypatch):
    """Of many joints an evaluation takes a second, and a step several."""
    events: list[str] = []
    evaluate = OperatingPoint.evaluate

    def noted(self, *args, **options):
        events.append("evaluation")
        return evaluate(self, *args, **options)

    monkeypatch.setattr(OperatingPoint, "evaluate", noted)
    layout = layout_of(demo, demo.effects)
    report = StepReporter(layout, lambda news: events.append("news"), lambda: False, interval=0.0)
    plain_fit(demo, demo.fit_groups, FitSettings(), report)
    silent = max(len(part.split()) for part in " ".join(events).split("news"))
    assert events.count("evaluation") > 10
    assert silent <= 2  # weights renewed and a step begun


@pytest.fixture(scope="module")
def counted(demo) -> tuple[MeasurementSet, TwoBandData, np.ndarray, Counted]:
    watch = Counted()
    layout = layout_of(demo, demo.effects)
    data = TwoBandData(demo, demo.fit_groups, layout, watch=watch)
    return demo, data, layout.vector(identify(demo, refine=False).model), watch


def test_building_two_bands_can_be_stopped(counted):
    demo, data, _, watch = counted
    assert watch.calls >= 2 * len(data.blocks)  # both bands of every stretch
    for most in range(1, 2 * len(data.blocks) + 1):
        with pytest.raises(Stopped):
            TwoBandData(demo, demo.fit_groups, data.layout, watch=Counted(most))


def test_whitening_can_be_stopped(counted):
    _, data, x, watch = counted
    link = data.evaluate(x).link
    before = watch.calls
    data.whiteners(x, link)
    calls = watch.calls - before
    assert calls >= 2 * data.noise_model.order * len(data.blocks)  # every lag of θ and τ
    for most in (1, calls // 2, calls):
        watch.most = watch.calls + most
        with pytest.raises(Stopped):
            data.whiteners(x, link)
        watch.most = np.inf


def test_identification_can_be_stopped_everywhere(demo):
    """What was found so far is there, and hardly anything is computed after the stop."""
    asked = 0

    def never() -> bool:
        nonlocal asked
        asked += 1
        return False

    short = replace(demo, groups=(demo.groups[0], demo.groups[-1]))
    assert not identify(short, should_stop=never).stopped
    for share in (0.02, 0.4, 0.8, 0.99):
        left = int(share * asked)
        after = 0

        def stop() -> bool:
            nonlocal left, after
            left -= 1
            after += left < 0
            return left < 0

        found = identify(short, should_stop=stop)
        assert found.stopped and not found.converged
        assert found.message.startswith("stopped")
        assert np.isfinite([p.value for p in found.parameters]).all()
        assert after <= 4


def test_comparison_with_the_masses_reports_and_stops(demo):
    def anew() -> MeasurementSet:  # what was found of a set is kept
        return replace(demo, groups=tuple(replace(group) for group in demo.groups))

    news: list[Progress] = []
    assert plausibility_warnings(anew(), news.append) == []
    assert len(news) > 10 and {one.text for one in news} == {"comparing the torques with the robot's masses"}
    count = len(news)
    news.clear()
    assert plausibility_warnings(anew(), news.append, lambda: len(news) >= count // 2) == []
    assert len(news) == count // 2
