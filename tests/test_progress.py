"""Progress of a computation with an unknown number of stages: honest, monotone, and at its end complete."""

from __future__ import annotations

import itertools

import pytest

from flexviz.cli.terminal import Reporter
from flexviz.progress import BestSoFar, Pace, Progress

LATE = {"last": 0.9}


def pace(times: list[float]) -> Pace:
    return Pace(4.0, 1.2, LATE, clock=iter([0.0, *times]).__next__)


def test_the_first_stage_tells_how_long_it_will_last() -> None:
    slow = pace([1e-4, 10.0, 20.0])
    assert slow.news("survey") == Progress("survey", 0.0)
    assert slow.news("a").share == pytest.approx(0.25, rel=1e-4)
    slow = pace([0.0, 10.0, 20.0])
    assert slow.news("survey") == Progress("survey", 0.0)
    assert slow.news("a") == Progress("a", 0.25, rest=30.0)  # a quarter is done
    assert slow.news("b") == Progress("b", 0.5, rest=20.0)


def test_the_share_never_falls_and_the_end_is_known_only_at_the_end() -> None:
    times = [0.0, 10.0, 30.0, 60.0, 200.0, 210.0, 220.0]
    one = pace(times)
    news = [one.news(text) for text in ("survey", "a", "b", "c", "d", "last")]
    shares = [n.share or 0.0 for n in news]
    assert all(a <= b < 1 for a, b in itertools.pairwise(shares))
    assert news[4].rest == pytest.approx(1.2 * 140.0)  # much longer than expected: more is still to come
    assert news[5].share == pytest.approx(0.9) and news[5].rest == pytest.approx(210 / 9)
    assert one.done() == Progress("done in 220 s", 1.0)


@pytest.mark.parametrize(
    "rest, text",
    [(None, ""), (3.0, "a few seconds left"), (41.0, "about 40 s left"), (150.0, "about 2 min left")],
)
def test_the_rest_in_words(rest: float | None, text: str) -> None:
    assert Progress("x", 0.1, rest=rest).rest_text == text


def test_without_a_terminal_each_stage_is_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    with Reporter("reading") as report:
        report(Progress("scoring", 0.25, rest=30.0))
        for text in ("a", "b"):
            report(Progress(text, so_far=BestSoFar("Backlash on joint1", "error 3 % → 1 %")))
        report(Progress("done in 40 s", 1.0))
    best = "so far: Backlash on joint1 (being checked): error 3 % → 1 %"
    said = capsys.readouterr().err.splitlines()
    assert said == [" 25 % scoring, about 30 s left", best, "a", "b", "100 % done in 40 s"]
