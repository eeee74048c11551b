"""Progress of a computation with an unknown number of stages: honest, monotone, and at its end complete."""

from __future__ import annotations

import itertools

import pytest

from flexviz.base.progress import BestSoFar, Pace, Progress
from flexviz.outlets.terminal.terminal import Reporter

KNOWN = {"search": (0.1, 0.25, 0.5), "refine": (0.4, 0.5, 0.9), "last": (0.8, 0.9, 1.0)}


def pace(times: list[float]) -> Pace:
    return Pace(KNOWN, clock=iter([0.0, *times]).__next__)


def test_a_stage_bounds_the_time_left() -> None:
    one = pace([0.0, 10.0, 30.0, 48.0])
    assert one.news("survey") == Progress("survey", 0.0)  # nothing is known yet
    begin = one.news("search")
    assert begin.rest == pytest.approx((30.0, 90.0))  # a tenth to a quarter is done
    assert begin.rest_text == "30 s to 2 min left"
    within = one.news("a candidate")  # at most half is done: as much is still to come
    assert within.rest == pytest.approx((30.0, 70.0))
    refined = one.news("refine")
    assert refined.rest == pytest.approx((48.0, 52.0))  # no more than the stage before allowed
    assert refined.rest_text == "about 50 s left"


def test_the_share_never_falls_and_the_end_is_known_only_at_the_end() -> None:
    one = pace([0.0, 10.0, 30.0, 60.0, 200.0, 210.0, 220.0])
    news = [one.news(text) for text in ("survey", "search", "b", "refine", "d", "last")]
    shares = [n.share or 0.0 for n in news]
    assert all(a <= b < 1 for a, b in itertools.pairwise(shares))
    assert news[4].rest == pytest.approx((200 / 9, 200 / 9))  # much longer than expected
    assert news[5].rest == pytest.approx((210 / 9, 52.5))
    assert one.done() == Progress("done in 220 s", 1.0)


@pytest.mark.parametrize(
    "rest, text",
    [
        (None, ""),
        ((1.0, 3.0), "a few seconds left"),
        ((40.0, 42.0), "about 40 s left"),
        ((150.0, 160.0), "about 3 min left"),
        ((12.0, 41.0), "10 to 40 s left"),
        ((40.0, 170.0), "40 s to 3 min left"),
        ((130.0, 250.0), "2 to 4 min left"),
        ((0.0, 40.0), "up to 40 s left"),
        ((20.0, 300.0), "at least 20 s left"),
    ],
)
def test_the_rest_in_words(rest: tuple[float, float] | None, text: str) -> None:
    assert Progress("x", 0.1, rest=rest).rest_text == text


def test_the_rest_falls_while_there_is_no_news() -> None:
    news = Progress("x", 0.1, rest=(30.0, 90.0))
    assert news.later(25.0) == Progress("x", 0.1, rest=(5.0, 65.0)) and news.later(60.0).rest == (0.0, 30.0)
    assert Progress("x").later(60.0) == Progress("x")


def test_without_a_terminal_each_stage_is_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    with Reporter("reading") as report:
        report(Progress("scoring", 0.25, rest=(30.0, 30.0)))
        for text in ("a", "b"):
            report(Progress(text, so_far=BestSoFar("Backlash on joint1", "error 3 % → 1 %")))
        report(Progress("done in 40 s", 1.0))
    best = "so far: Backlash on joint1 (being checked): error 3 % → 1 %"
    said = capsys.readouterr().err.splitlines()
    assert said == [" 25 % scoring, about 30 s left", best, "a", "b", "100 % done in 40 s"]
