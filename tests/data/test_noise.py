"""Noise of recorded signals, and what is refused as no recording of a robot's motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from flexviz.analysis.diagnosis import Diagnosis, diagnose
from flexviz.analysis.diagnosis.pipeline import _Description
from flexviz.analysis.identification import identify
from flexviz.analysis.identification.pipeline import _with_noise_share
from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.checks import check_signals, noise_notes, spoilt_group
from flexviz.content.results import assessment
from flexviz.content.wording import verdict_text
from flexviz.data.measurements import MeasurementSet, Segment
from flexviz.data.noise import resolution, segments_noise, white_noise

STEP = 1e-3  # [s]
SIGMA = np.array([2e-5, 3e-3])  # of the noise in `signal`
Array = np.ndarray
Spoil = Callable[[Array, Array, np.random.Generator], None]


def signal(seconds: float = 20.0, seed: int = 0, step: float = STEP) -> Array:
    """Smooth motion with white noise, shape (N, 2)."""
    time = step * np.arange(round(seconds / step))
    motion = np.stack([0.8 * np.sin(3 * time), 20 * np.sin(4 * time + 1)], axis=1)
    return motion + SIGMA * np.random.default_rng(seed).standard_normal(motion.shape)


def spoilt(measurements: MeasurementSet, spoil: Spoil) -> MeasurementSet:
    """The set with θ and τ of every segment changed in place."""
    groups = []
    for seed, group in enumerate(measurements.groups):
        segments = [replace(s, theta=s.theta.copy(), tau=s.tau.copy()) for s in group.segments]
        for segment in segments:
            spoil(segment.theta, segment.tau, np.random.default_rng(seed))
        groups.append(replace(group, segments=tuple(segments)))
    return replace(measurements, groups=tuple(groups))


# -- estimates -----------------------------------------------------------------------------------------------


def with_zeros(y: Array) -> Array:
    y[np.random.default_rng(1).random(len(y)) < 0.01] = 0.0
    return y


def with_wraps(y: Array) -> Array:
    return (y + 0.5) % [1.0, 25.0]


@pytest.mark.parametrize("change", [lambda y: y, with_zeros, with_wraps, lambda y: y[:5000]])
def test_noise_is_found_beside_motion_and_jumps(change: Callable[[Array], Array]) -> None:
    assert white_noise(change(signal())) == pytest.approx(SIGMA, rel=0.1)


@pytest.mark.parametrize("samples", [2, 8, 10 / 3])
def test_repeated_values_are_noise_of_the_slower_clock(samples: float) -> None:
    """The 4th difference of a staircase is that of its steps; only new values tell the noise."""
    y = signal(step=samples * STEP)
    held = y[(np.arange(19_900) / samples).astype(int)]
    assert white_noise(held) == pytest.approx(np.sqrt(samples) * SIGMA, rel=0.1)


def test_counts_of_a_coarse_encoder_are_no_repeated_values() -> None:
    count = 2 * np.pi / 4096
    y = np.round(signal()[:, :1] / 8 / count) * count
    at_rest = np.concatenate([np.zeros((30_000, 1)), y])
    for z in (y, at_rest):
        assert 0.02 * count < white_noise(z)[0] < count / np.sqrt(12)


def test_single_wraps_at_rest_are_not_noise() -> None:
    y = np.zeros((10_000, 1))
    y[::100] = 1e-4  # counts
    rough = white_noise(y)
    y[5000:] -= 2 * np.pi
    assert white_noise(y) == pytest.approx(rough, rel=0.02)


def test_too_short_and_constant_signals_have_no_noise() -> None:
    assert not white_noise(np.ones((3, 2))).any() and not white_noise(np.ones((30, 2))).any()


def test_noise_is_never_finer_than_the_best_sensors() -> None:
    y = signal()
    smooth = np.cumsum(np.cumsum(y - y.mean(axis=0), axis=0), axis=0) * 1e-9
    one = Segment(STEP * np.arange(len(y)), smooth[:, :1], smooth[:, 1:], STEP)
    least, found = resolution([one]), segments_noise([one])
    assert found[0] == least[0] == pytest.approx(2 * np.pi / 2**24 / np.sqrt(12))
    assert found[1] == least[1] == pytest.approx(np.ptp(smooth[:, 1]) / 2**18 / np.sqrt(12), rel=0.1)


# -- faults --------------------------------------------------------------------------------------------------


def zeros(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    lost = rng.random(len(theta)) < 0.01
    theta[lost] = tau[lost] = 0.0


def zero_torques(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    tau[rng.random(len(theta)) < 0.01, 1] = 0.0


def marked_torques(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    tau[rng.random(len(theta)) < 0.001, 0] = -999.0


def publishers(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    other = np.arange(len(theta)) % 5 == 2
    theta[other] = theta[other][:, ::-1]


def wraps(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    theta[:, 1] = (theta[:, 1] + 0.2) % (2 * np.pi / 100)


def glitch(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    theta[1000, 0] += 0.2


def first_row(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    theta[0] += 1.0


def noise_as_position(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    theta[:, 0] = rng.standard_normal(len(theta))


def coarse_noise(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    theta[:] = 0.01 * theta + 0.0045 * np.where(rng.random(theta.shape) < 0.5, -1, 1)
    tau *= 0.01


def only_spikes(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    tau[:] = np.where(rng.random(tau.shape) < 0.01, 50.0, 0.0)


FAULTS: dict[str, tuple[Spoil, tuple[str, ...]]] = {
    "zeros": (
        zeros,
        ("column theta_joint", "the value is 0", "also in", "tau_joint1", "dropped values? expected"),
    ),
    "zero torques": (zero_torques, ("column tau_joint2", "times the value is 0 between", "dropped")),
    "marked torques": (marked_torques, ("column tau_joint1", "−999.0")),
    "two publishers": (publishers, ("column theta_joint", "jumps at", "two publishers on one topic")),
    "wraps": (wraps, ("column theta_joint2", "jumps by about 0.06", "wrapped")),
    "one glitch": (
        glitch,
        ("row 1001, column theta_joint1", "jumps at 2 of", "201 rad/s", "transmission errors"),
    ),
    "first row": (first_row, ("row 1, column theta_joint", "jumps at 1 of", "also in theta_joint")),
    "noise as position": (noise_as_position, ("column theta_joint1", "jumps at")),
    "noise above motion": (coarse_noise, ("column theta_joint", "noise of this position", "below 4 Hz")),
    "spikes": (only_spikes, ("columns tau_joint1, tau_joint2", "nothing but noise or spikes")),
}


@pytest.mark.parametrize("name", FAULTS)
def test_what_is_no_motion_of_a_robot_is_refused_with_its_place(demo: MeasurementSet, name: str) -> None:
    spoil, words = FAULTS[name]
    measurements = spoilt(demo, spoil)
    for command in (identify, diagnose):
        with pytest.raises(InputError) as caught:
            command(measurements)
        text = str(caught.value)
        assert text.startswith(str(demo.path)) and "\n" not in text
        assert all(word in text for word in words), text


# -- no faults -----------------------------------------------------------------------------------------------


def counts(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    theta[:] = np.round(theta / 0.0123) * 0.0123
    tau[:] = np.round(tau / 0.5) * 0.5


def held(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    last = np.arange(len(theta)) // 8 * 8
    theta[:], tau[:] = theta[last], tau[last]


def noisy(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    theta += 1e-3 * rng.standard_normal(theta.shape)


def switched(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    tau[:, 0] = 10 * np.sign(np.sin(4 * np.pi * STEP * np.arange(len(tau))))


def saturated(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    most = 0.5 * np.abs(tau).max(axis=0)
    np.clip(tau, -most, most, out=tau)


def drive_off(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    tau[3000:3500] = 0.0


def at_rest(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    theta[:, 1] = 0.3 + 2e-5 * rng.standard_normal(len(theta))


def passive(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    tau[:, 1] = 0.0


def locked(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    tau[:, 1], theta[:, 1] = 0.0, 1e-4 * rng.standard_normal(len(theta))


def fast(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    theta *= 20.0


@pytest.mark.parametrize(
    "spoil",
    [counts, held, noisy, switched, saturated, drive_off, at_rest, passive, locked, fast],
    ids=lambda f: f.__name__,
)
def test_odd_but_possible_signals_are_no_faults(demo: MeasurementSet, spoil: Spoil) -> None:
    measurements = spoilt(demo, spoil)
    assert not any(spoilt_group(group, demo.robot) for group in measurements.groups)
    assert max(check_signals(measurements)) < 0.05 and not noise_notes(measurements)


# -- share of the noise --------------------------------------------------------------------------------------


def test_share_of_the_noise_is_that_of_the_band(demo: MeasurementSet) -> None:
    """White noise of σ in means of 100 samples is σ / 10; other joints do not count."""
    spread = np.std(np.concatenate([g.joined("tau") for g in demo.groups]), axis=0)
    before = np.array(check_signals(demo))

    def noise(theta: Array, tau: Array, rng: np.random.Generator) -> None:
        tau[:, 1] += spread[1] * rng.standard_normal(len(tau))

    after = np.array(check_signals(spoilt(demo, noise)))
    assert max(before) < 2e-3
    assert after[0] == pytest.approx(before[0]) and after[1] == pytest.approx(0.1, rel=0.1)


def pure_noise(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    tau[:, 1] = 5 * rng.standard_normal(len(tau))


def spikes(theta: Array, tau: Array, rng: np.random.Generator) -> None:
    tau[:, 1] = 50 * rng.choice([-1, 1], len(tau)) * (rng.random(len(tau)) < 0.01)
    tau[:, 1] += 1e-3 * rng.standard_normal(len(tau))


@pytest.mark.parametrize("spoil", [pure_noise, spikes], ids=lambda f: f.__name__)
def test_a_torque_that_is_nothing_but_noise_is_said(demo: MeasurementSet, spoil: Spoil) -> None:
    measurements = spoilt(demo, spoil)
    assert check_signals(measurements)[1] == 1.0
    (note,) = noise_notes(measurements)
    assert (note.kind, note.joints, note.values["shares"]) == ("noise", ("joint2",), (1.0,))
    result = identify(measurements, refine=False)
    assert result.residual.noise_share[1] == 1.0
    text = assessment(result.document())
    assert text.startswith("Poor: noise is 100 % of the torque of joint2, and hides what is smaller.")
    assert "error of all joints" not in text


# -- verdicts ------------------------------------------------------------------------------------------------


def test_nothing_is_concluded_where_the_noise_exceeds_the_torque(diagnosed_demo: Diagnosis) -> None:
    """Any residual looks like such noise: neither "Nothing is missing" nor "Good" may be said."""
    course = SimpleNamespace(
        measurements=SimpleNamespace(torque_spread=(20.0, 5.0)),
        own=SimpleNamespace(joints=("joint1", "joint2")),
    )
    description = _Description(course, None, True, None, True)  # type: ignore[arg-type]
    for floors, drowned in (
        ((0.1, 0.1), []),
        ((21.0, 0.1), ["joint1"]),
        ((905.0, 421.0), ["joint1", "joint2"]),
    ):
        stair = SimpleNamespace(errors=SimpleNamespace(noise_floor=floors))
        assert description.drowned(stair) == drowned  # type: ignore[arg-type]
    note = Fact("drowned", "wrong", joints=("joint1",))
    shown = replace(diagnosed_demo, verdict="unknown", findings=(), notes=(note,))
    assert verdict_text(shown) == f"Unknown: {note.text}."


def test_an_identification_whose_noise_exceeds_the_torque_is_poor(demo: MeasurementSet) -> None:
    result = identify(demo, refine=False)
    spread = np.array(result.residual.torque_spread)
    floors = tuple((1.5 * spread).tolist())
    residual = _with_noise_share(replace(result.residual, noise_floor=floors), (0.0, 0.0))
    text = assessment(replace(result, residual=residual).document())
    assert text.startswith("Poor: noise is 150 % of the torque of joint1") and "Good" not in text


def test_counts_are_known_to_a_uniform_error() -> None:
    step, t = 2 * np.pi / 2**12, np.arange(4000) * 1e-3
    y = np.round(np.sin(8 * t) / step) * step
    assert white_noise(y[:, None])[0] == pytest.approx(step / np.sqrt(12), rel=0.02)
    switched = np.where(np.sin(20 * t) > 0, 1.0, 0.0)  # its steps are no counts
    assert white_noise(switched[:, None])[0] < 0.2 / np.sqrt(12)
    fine = np.sin(8 * t) + 1e-5 * np.random.default_rng(0).standard_normal(len(t))
    assert white_noise(fine[:, None])[0] == pytest.approx(1e-5, rel=0.1)
