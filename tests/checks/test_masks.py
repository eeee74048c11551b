"""A kind of fault of samples is one file: it is found in a set as in an import, with its words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from flexviz.checks import AllSamples, Issue, contradictions
from flexviz.content.wording import issue_text
from flexviz.data.measurements import MeasurementSet

SECONDS = 2.5  # for which brakes hold the arm


def braked(measurements: MeasurementSet) -> MeasurementSet:
    """The first group stands still with no torque until the drives are switched on."""
    group = measurements.groups[0]
    (segment,) = group.segments
    theta, tau = segment.theta.copy(), segment.tau.copy()
    still = segment.time - segment.time[0] < SECONDS
    theta[still], tau[still] = theta[still][-1], 1e-3 * np.sin(1e3 * segment.time[still])[:, None]
    one = replace(group, q=None, segments=(replace(segment, theta=theta, tau=tau),))
    return replace(measurements, groups=(one, *measurements.groups[1:]))


def test_brakes_are_named_in_a_set(demo: MeasurementSet) -> None:
    (issue,) = contradictions(braked(demo))
    assert (issue.kind, issue.severity, issue.signal) == ("held", "odd", "tau")
    (first, last, begin, end) = issue.values["stretches"][0]
    assert (first, begin) == (1, 0.0) and abs(end - SECONDS) < 0.3 and last > first
    assert "the joint stands still with" in issue_text(issue) and "Proposed" not in issue_text(issue)


def test_a_kind_of_fault_is_one_file(monkeypatch: pytest.MonkeyPatch, demo: MeasurementSet) -> None:
    """A new one is found, with words, without any other change."""

    def mask_of_tests(samples: AllSamples) -> Iterator[Issue]:
        yield Issue("too_warm", "odd", samples.robot.joints[:1], "tau", {"degrees": 90.0})

    monkeypatch.setattr("flexviz.checks.samples.MASKS", {"made up": mask_of_tests})
    other = replace(demo, groups=tuple(replace(group) for group in demo.groups))  # found anew
    (issue,) = contradictions(other)
    assert issue_text(issue) == "tau of joint1: too warm (degrees 90.0)"
