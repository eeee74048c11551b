"""A kind of fault is one file: what it yields is found in a set, with its words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from flexviz.base.progress import Progress
from flexviz.checks import Case, Comparison, Fault, contradictions, issues_of_set
from flexviz.checks.reading import Reading
from flexviz.content.wording import issue_text
from flexviz.data.measurements import GroupTable, MeasurementSet

Change = Callable[[np.ndarray, np.ndarray], np.ndarray]


def test_a_payload_that_one_group_carried_and_nobody_stated(demo: MeasurementSet) -> None:
    carried = next(g for g in demo.groups if g.bodies)
    groups = tuple(replace(g, bodies=()) if g is carried else g for g in demo.groups)
    (issue,) = issues_of_set(replace(demo, groups=groups))
    assert (issue.kind, issue.severity, issue.values["groups"]) == ("payload", "odd", (carried.name,))
    assert issue.values["mass"] == pytest.approx(sum(body.mass for body in carried.bodies), rel=0.25)


def test_no_reading_is_more_probable_than_its_bounds(demo: MeasurementSet) -> None:
    """Moves that a bound excludes are not computed, and the quick one excludes no other."""
    comparison = Comparison(demo.robot, [(g.bodies, GroupTable.of(g)) for g in demo.groups])
    start = comparison.stated
    readings = [
        start, replace(start, sign=-start.sign), replace(start, gravity=False),
        replace(start, size=3.0 * start.size), replace(start, tau_order=start.tau_order[::-1]),
    ]  # fmt: skip
    for reading in readings:
        bound = comparison.bound(reading, few=False)
        assert comparison.score(reading) <= bound <= comparison.bound(reading, few=False, quick=True)


def test_a_kind_of_fault_is_one_file(monkeypatch: pytest.MonkeyPatch, demo: MeasurementSet) -> None:
    """A new one is found, with words and remedy, without any other change."""

    def halved(now: Reading) -> Reading:
        return replace(now, size=2.0 * now.size)

    def hypothesis_of_tests(case: Case) -> Iterator[Fault]:
        yield Fault("summed_twice", case.every, "tau", halved)

    monkeypatch.setattr("flexviz.checks.faults.HYPOTHESES", {"made up": hypothesis_of_tests})
    groups = tuple(
        replace(g, segments=tuple(replace(s, tau=0.5 * s.tau) for s in g.segments)) for g in demo.groups
    )
    (issue,) = issues_of_set(replace(demo, groups=groups))
    assert issue.kind == "summed_twice" and issue.joints == demo.joints
    assert "with summed twice the robot's masses explain" in issue_text(issue)


def test_what_is_found_belongs_to_robot_and_groups(demo: MeasurementSet) -> None:
    """Another robot, or other groups, are compared anew; other settings are not."""
    upside_down = replace(demo, robot=demo.robot.mounted((0.0, 0.0, 9.81)))
    assert [one.kind for one in contradictions(upside_down)] == ["mounting"]
    assert contradictions(demo) == ()
    news: list[Progress] = []
    assert contradictions(replace(demo, effects=("coulomb_friction",)), news.append) == () and not news
    assert contradictions(replace(demo, groups=demo.groups[:2]), news.append) == () and news


@pytest.mark.parametrize(("signal", "by", "unit"), [("theta", 180 / math.pi, "deg"), ("tau", 1e3, "mNm")])
def test_one_log_in_another_unit(demo: MeasurementSet, signal: str, by: float, unit: str) -> None:
    one = demo.groups[0]
    other = tuple(replace(s, **{signal: by * getattr(s, signal)}) for s in one.segments)
    groups = (replace(one, segments=other, q=None), *demo.groups[1:])
    (issue,) = issues_of_set(replace(demo, groups=groups))
    assert (issue.kind, issue.severity, issue.signal, issue.joints) == ("unit", "wrong", signal, demo.joints)
    assert issue.values["groups"] == (one.name,) and issue.values["read_as"] == f'unit = "{unit}"'
    assert f'in {one.name}, with unit = "{unit}" the robot\'s masses explain' in issue_text(issue)


def with_samples(measurements: MeasurementSet, group: int, **changes: Change) -> MeasurementSet:
    """The set with signals of one group changed: (time, signal) -> signal."""
    groups = list(measurements.groups)
    segments = tuple(
        replace(s, **{name: change(s.time - s.time[0], getattr(s, name)) for name, change in changes.items()})
        for s in groups[group].segments
    )
    groups[group] = replace(groups[group], segments=segments, q=None)
    return replace(measurements, groups=tuple(groups))


def test_the_zero_of_one_log(demo: MeasurementSet) -> None:
    moved = with_samples(demo, 1, theta=lambda _, theta: theta - [0.0, 0.3])
    (issue,) = issues_of_set(moved)
    assert (issue.kind, issue.severity, issue.joints) == ("zero", "wrong", ("joint2",))
    assert issue.values["groups"] == (demo.groups[1].name,)
    assert issue.values["angle"] == pytest.approx(0.3, abs=0.06)  # the arm is soft


def test_a_torque_whose_zero_drifts(demo: MeasurementSet) -> None:
    size = demo.torque_spread[1]
    drifting = with_samples(
        demo, 0, tau=lambda time, tau: tau + np.outer(time / time[-1], [0.0, size]) - [0.0, size / 2]
    )
    (issue,) = issues_of_set(drifting)
    assert (issue.kind, issue.severity, issue.joints) == ("drift", "odd", ("joint2",))
    assert issue.values["drift"] == pytest.approx(size, rel=0.5)
    assert "a zero that drifts by up to" in issue_text(issue)
