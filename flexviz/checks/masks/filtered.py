"""Whether a log was low-passed before it was written: its noise then says nothing about its sensors.

Sensor noise is white up to half the sampling rate, whatever the robot does. Behind a low-pass it falls with
the frequency, at least as behind one of first order, or below what any sensor resolves. A position falls
without a filter, too, where the encoder shows the motor's own vibration: there it counts only with the
torques. Two things contradict a filter: a position in the counts of its encoder, and noise that is white
above the cut-off and larger than the digits that were written.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.checks.issues import Issue
from flexviz.checks.samples import AllSamples, mask
from flexviz.data.measurements import Segment
from flexviz.data.noise import ENOUGH, UNIFORM, count_of, in_counts, repeats_of, resolution

BLACKMAN_HARRIS = (0.35875, -0.48829, 0.14128, -0.01168)  # side lobes 92 dB below: motion does not leak
MEDIAN_OF_POWER = np.log(2.0)  # of white noise in one bin, over its mean
# in units of the sampling rate; above, resampling to a uniform clock filters
HIGH, LOWER = (0.2, 0.35), (0.05, 0.1)
WINDOWS = 200  # that suffice for a median
SHORT, LONG = 0.25, 2.0  # [s] of a window: short ones without reversals, and those that resolve 2 Hz
FEWEST, MOST = 64, 4096  # samples of a window
SAME_RATE = 0.05  # relative difference of rates that are the same
FIRST_ORDER = 2.5  # by which the level falls from LOWER to HIGH behind a filter of first order (3.2 far above
FALLING = 1.7  # its cut-off); single joints of such a log fall by this
STEEP = 50.0  # behind a filter of third order; the torque of friction falls by up to 15
ABOVE_STOP_BAND = 10.0  # times the level at HIGH that counts as content
TORQUE_CONTENT = 256.0  # times the finest resolution that counts as content: 2^-10 of the range
POSITION_CONTENT = 4.0  # the same of a position: a count of an encoder with 2^22 counts a turn


@dataclass(frozen=True, eq=False)
class FilteredLog:
    """What was filtered before it was written.

    Attributes:
        theta, tau: shape (n,), frequency up to which each joint's signal still has content [Hz]; NaN where
            it was not filtered.
        certain: whether the torques fall too steeply for what friction and vibrations leave unfiltered.
    """

    theta: Array
    tau: Array
    certain: bool = False

    @property
    def hertz(self) -> float | None:
        """The frequency up to which the torques have content; None if the log was not filtered."""
        found = self.tau[np.isfinite(self.tau)]
        return float(np.median(found)) if 2 * len(found) > len(self.tau) else None


@mask
def filtered(samples: AllSamples) -> Iterator[Issue]:
    """Torques that were surely low-passed before they were written."""
    if not samples.segments:
        return
    log = filtered_before_writing(samples.segments)
    if log.hertz is not None and log.certain:
        names = zip(samples.robot.joints, log.tau, strict=True)
        joints = tuple(joint for joint, hertz in names if np.isfinite(hertz))
        yield Issue("filtered", "odd", joints, "tau", {"hertz": log.hertz})


def filtered_before_writing(segments: Sequence[Segment]) -> FilteredLog:
    """Which signals were low-passed before they were written, and up to where they still have content.

    That is where they are above 2⁻¹⁰ of the torque's range, or 2⁻²² of a turn: sharp reversals reach well
    beyond a low-pass of low order. A stop band that was rounded away with the digits that were not written is
    not recognised.
    """
    theta, tau = (_Spectrum.of(segments, name, SHORT) for name in ("theta", "tau"))
    finest = resolution(segments)
    falls = tau.falls
    log_falls = bool(np.isfinite(falls).any()) and float(np.nanmedian(falls)) > FIRST_ORDER
    torques = (tau.high < finest[1]) | (log_falls & (falls > FALLING))
    steep = (tau.high < finest[1]) | (falls > STEEP)
    counted = in_counts(segments)
    # dry friction in counts falls as behind a first-order filter
    torques &= ~(tau.white & (tau.high > _written(segments, finest[1]))) & (steep | ~counted)
    positions = (theta.high < finest[0]) | (torques & (theta.falls > FALLING) & ~counted)
    return FilteredLog(
        certain=bool(2 * np.count_nonzero(steep) > len(steep)),
        theta=_content(segments, "theta", positions, POSITION_CONTENT * finest[0]),
        tau=_content(segments, "tau", torques, TORQUE_CONTENT * finest[1]),
    )


def _written(segments: Sequence[Segment], finest: Array) -> Array:
    """Level of the noise that the digits of torques leave with which they were written, shape (n,) [Nm]."""
    torques = np.concatenate([s.tau for s in segments])
    digits = np.array([count_of(column) for column in torques[:ENOUGH].T])
    return np.maximum(finest, 2 * UNIFORM * digits)


def _content(segments: Sequence[Segment], name: str, filtered: Bools, least: Array) -> Array:
    """Highest frequency at which each filtered signal is above a level, shape (n,) [Hz]; else NaN."""
    found = np.full(len(filtered), np.nan)
    if filtered.any():
        spectrum = _Spectrum.of(segments, name, LONG)
        for j in np.flatnonzero(filtered):
            level = max(least[j], ABOVE_STOP_BAND * spectrum.high[j])
            above = np.flatnonzero(spectrum.level[:, j] > level)
            found[j] = spectrum.rate * spectrum.frequency[above[-1] if len(above) else 1]
    return found


def _new_values(y: Array) -> tuple[Array, float]:
    """The rows of y (shape (N, m)) in which any column is new, and how many samples they last."""
    if min(repeats_of(column).lasts for column in y.T) <= 1.0:
        return y, 1.0
    rows = np.flatnonzero(np.diff(y, axis=0).any(axis=1))
    return y[np.concatenate(([0], rows + 1))], float(rows[-1] - rows[0]) / (len(rows) - 1)


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """Median spectrum of one signal of all joints over many windows.

    Attributes:
        rate: of the samples that count [Hz].
        frequency: shape (F,), in units of the rate, ascending from 0.
        level: shape (F, n), standard deviation of white noise with the same density; NaN of a signal at rest.
    """

    rate: float
    frequency: Array
    level: Array

    @staticmethod
    def of(segments: Sequence[Segment], name: str, seconds: float) -> _Spectrum:
        """From windows of about `seconds`; segments with another rate than most samples do not count."""
        signals = [(_new_values(getattr(s, name)), s.step) for s in segments]
        parts = [(y, 1 / (held * step)) for (y, held), step in signals]
        rate = max(parts, key=lambda part: len(part[0]))[1]
        usual = [y for y, own in parts if abs(own / rate - 1) < SAME_RATE]
        size = 2 ** round(np.log2(np.clip(seconds * rate, FEWEST, MOST)))
        while size > max(FEWEST, max(map(len, usual)) - 4):
            size //= 2
        angle = 2 * np.pi * np.arange(size) / size
        window = np.sum([c * np.cos(k * angle) for k, c in enumerate(BLACKMAN_HARRIS)], axis=0)
        frequency = np.arange(size // 2 + 1) / size
        powers = [np.full((1, size // 2 + 1, segments[0].theta.shape[1]), np.nan)]
        every = max(1, 2 * sum(map(len, usual)) // (size * WINDOWS))
        for y in usual:
            difference = np.diff(y, 4, axis=0)
            for first in range(0, len(difference) - size + 1, every * size // 2):
                part = difference[first : first + size]
                power = np.abs(np.fft.rfft(window[:, None] * part, axis=0)) ** 2 / np.sum(window**2)
                power[:, 2 * np.count_nonzero(part, axis=0) < size] = np.nan  # at rest
                powers.append(power[None])
        gain = np.maximum(2 * np.sin(np.pi * frequency), 1e-30) ** 8
        with np.errstate(invalid="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # columns that always rest
            middle = np.nanmedian(np.concatenate(powers), axis=0)
        return _Spectrum(rate, frequency, np.sqrt(middle / MEDIAN_OF_POWER / gain[:, None]))

    @property
    def high(self) -> Array:
        """Level at about a quarter of the rate, shape (n,)."""
        return self._mean(*HIGH)

    @property
    def falls(self) -> Array:
        """By which factor the level falls from about a twelfth to a quarter of the rate, shape (n,)."""
        return self._mean(*LOWER) / np.maximum(self.high, 1e-300)

    @property
    def white(self) -> Bools:
        """Which levels are nearer to white noise than to what a first-order filter leaves, shape (n,)."""
        middle = sum(HIGH) / 2
        lower, upper = self._mean(HIGH[0], middle), self._mean(middle, HIGH[1])
        first_order = np.sin(np.pi * (middle + HIGH[1]) / 2) / np.sin(np.pi * (HIGH[0] + middle) / 2)
        return lower < np.sqrt(first_order) * upper

    def _mean(self, low: float, high: float) -> Array:
        band = (self.frequency >= low) & (self.frequency <= high)
        return np.sqrt(np.mean(self.level[band] ** 2, axis=0))
