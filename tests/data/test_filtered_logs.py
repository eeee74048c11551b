"""Logs that were low-passed before they were written, and what their sensors may have shown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.signal_checks import FILTERS, Low, butterworth, exponential, low_passed, main
from flexviz.base.resources import sessions_dir
from flexviz.checks import filtered_before_writing
from flexviz.data.measurements import MeasurementSet, Segment, read_set

SHARED = Path(__file__).resolve().parents[3] / "shared"
SIMULATED = [*(SHARED / "practice" / "cases").glob("*"), *(SHARED / "robotlike" / "cases").glob("*")]
RATE = 500.0  # [Hz]
Array = np.ndarray


def log(seed: int = 0, noise: float = 5e-3) -> list[Segment]:
    """Two joints of a robot: sines, a torque that reverses with the velocity, sensors with counts."""
    rng, segments = np.random.default_rng(seed), []
    for _ in range(2):
        time = np.arange(0, 15, 1 / RATE)
        w = rng.uniform(1, 5, (3, 2))
        phase = time[:, None, None] * w + rng.uniform(0, 6, w.shape)
        theta, speed = 0.4 * np.sin(phase).sum(axis=1), 0.4 * (w * np.cos(phase)).sum(axis=1)
        tau = 10 * theta + 3 * np.tanh(speed / 0.005) + 2 * speed
        tau = tau + noise * tau.std(axis=0) * rng.standard_normal(tau.shape)
        count = 2 * np.pi / 2**21
        segments.append(Segment(time, np.round(theta / count) * count, tau, 1 / RATE))
    return segments


def changed(segments: Sequence[Segment], change: Callable[[Array], Array]) -> list[Segment]:
    return [replace(s, theta=change(s.theta), tau=change(s.tau)) for s in segments]


def all_segments(measurements: MeasurementSet) -> list[Segment]:
    return [segment for group in measurements.groups for segment in group.segments]


@pytest.mark.parametrize("hertz", [5.0, 10.0, 20.0])
@pytest.mark.parametrize("low_pass", FILTERS, ids=lambda f: f.__name__)
def test_a_filtered_log_is_recognised_with_what_is_left(low_pass: Low, hertz: float) -> None:
    found = filtered_before_writing(low_passed(log(), low_pass, hertz))
    assert np.isfinite(found.theta).all() and np.isfinite(found.tau).all()
    assert found.hertz is not None and 0.8 * hertz < found.hertz < 12 * hertz


@pytest.mark.parametrize("low_pass", FILTERS, ids=lambda f: f.__name__)
def test_a_filtered_simulation_is_recognised(demo: MeasurementSet, low_pass: Low) -> None:
    found = filtered_before_writing(low_passed(all_segments(demo), low_pass, 10.0))
    assert found.hertz is not None and np.isfinite(found.theta).all()


def test_sensors_alone_are_no_filter(demo: MeasurementSet) -> None:
    for segments in (log(), log(1, noise=0.05), log(2, noise=3e-4), all_segments(demo)):
        found = filtered_before_writing(segments)
        assert np.isnan(found.theta).all() and np.isnan(found.tau).all()
        assert found.hertz is None


@pytest.mark.parametrize("hold", [2, 5])
def test_repeated_values_are_no_filter(hold: int) -> None:
    found = filtered_before_writing(changed(log(), lambda y: np.repeat(y[::hold], hold, axis=0)[: len(y)]))
    assert found.hertz is None and np.isnan(found.theta).all()


def test_joints_at_rest_short_and_constant_signals_are_no_filter() -> None:
    segments = log()
    for segment in segments:
        segment.theta[:, 1], segment.tau[:, 0] = 0.3, 0.0
    assert np.isnan(filtered_before_writing(segments).tau).all()
    short = [replace(s, time=s.time[:40], theta=s.theta[:40], tau=s.tau[:40]) for s in segments]
    assert filtered_before_writing(short).hertz is None


def friction_log(count: float, jitter: float = 0.0, filtered: bool = False) -> list[Segment]:
    """A servo with dry friction: its torque falls as behind a first-order filter."""
    rng, segments = np.random.default_rng(0), []
    for k in range(4):
        even = np.arange(0, 8, 1 / 200)
        time = even + jitter * rng.uniform(-1, 1, len(even))
        theta = 0.2 * np.sin((1 + 0.3 * k) * time)
        tau = butterworth(
            3 * np.sign(np.cos((1 + 0.3 * k) * time))[:, None],
            200.0,
            4.0,
        ).ravel()
        tau = np.cumsum(rng.standard_normal(len(time))) * 3e-3 + tau
        y = np.column_stack([theta, tau])
        if filtered:
            y = exponential(y, 200.0, 5.0)
        y[:, 0] = np.round(y[:, 0] / count) * count
        y = np.column_stack([np.interp(even, time, column) for column in y.T])
        segments.append(Segment(even, y[:, :1], y[:, 1:], 1 / 200))
    return segments


@pytest.mark.parametrize("jitter", [0.0, 1e-4])
def test_an_angle_in_counts_is_not_filtered(jitter: float) -> None:
    """Of a torque that falls as behind a first-order filter only the angle tells; digits tell nothing."""
    assert filtered_before_writing(friction_log(1e-7, jitter)).hertz is not None
    assert filtered_before_writing(friction_log(2 * np.pi / 4096, jitter)).hertz is None
    assert filtered_before_writing(friction_log(1e-3, jitter, filtered=True)).hertz is not None


def test_white_noise_above_the_motion_is_not_filtered() -> None:
    """Slow sampling: the motion reaches into the bands that are compared, the noise above it is white."""
    segments = log(noise=1e-3)
    for segment in segments:
        segment.tau[:] = butterworth(segment.tau, RATE, 30.0)
    filtered = filtered_before_writing(segments)
    assert filtered.hertz is not None
    rng = np.random.default_rng(0)
    for segment in segments:
        segment.tau[:] += 1e-3 * segment.tau.std(axis=0) * rng.standard_normal(segment.tau.shape)
    assert filtered_before_writing(segments).hertz is None


def test_one_filtered_torque_is_not_a_filtered_log() -> None:
    segments = log()
    for segment in segments:
        segment.tau[:, 1:] = butterworth(segment.tau[:, 1:], RATE, 10.0)
    found = filtered_before_writing(segments)
    assert np.isnan(found.tau[0]) and found.tau[1] < 20 and found.hertz is None


@pytest.mark.skipif(not SIMULATED, reason="the simulated sets are not here")
def test_no_simulated_set_was_filtered() -> None:
    for folder in SIMULATED:
        found = filtered_before_writing(all_segments(read_set(folder, logged=False)))
        assert np.isnan(found.theta).all() and np.isnan(found.tau).all(), folder.name


def test_the_benchmark_prints_a_line_per_set_and_counts(capsys: pytest.CaptureFixture[str]) -> None:
    main([str(sessions_dir()), "--filter"])
    printed = capsys.readouterr().out
    assert "planar-2r-demo: noise at most 0.0" in printed and "; not filtered; " in printed
    assert "0 of 1 sets refused" in printed and "12 of 12 filtered copies recognised" in printed
