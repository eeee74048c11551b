"""Wide-band motion on a fine grid, on which effects are evaluated before they are filtered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from flexviz.base.arrays import Array
from flexviz.base.recent import Recent
from flexviz.data.noise import segments_noise
from flexviz.model.equation.signals import Block, Signals, fine_samples
from flexviz.model.observers import ButterworthZeroPhase, largest_divisor

# band of the velocity that determines the sign of friction: a compromise between sharp reversals and noise
SIGN_BANDWIDTH_HZ = 70.0  # at an encoder noise of 2e-5 rad per sample at 1 ms
SIGN_REFERENCE_NOISE = 2e-5 * np.sqrt(1e-3)  # [rad √s]
TORQUE_NOISE = 5e-3  # maximum noise of the transmission torque relative to its rms
LINK_VELOCITY_NOISE = 4e-3  # [rad/s] maximum noise of the link velocity
BAND_STEP = 1.05  # bands within this factor share their signals
KEPT = 24  # bands whose signals are kept, of all parts and observers of a set together
KEPT_BYTES = 1.5e8  # of long records fewer, at least one


@dataclass(frozen=True)
class FineSignals:
    """Wide-band signals of one stretch."""

    time: Array  # (N_fine,) [s]
    step: float  # between samples [s]
    # position, velocity: (N_fine, n), motor side [rad], [rad/s]
    position: Array
    velocity: Array
    theta: Array  # (4, N_fine, n), in the torque band, for s and ṡ [rad/s^k]
    tau: Array  # (2, N_fine, n) [Nm/s^k]
    torque_hertz: Array  # (n,), torque band [Hz]


def fine_stride(block: Block) -> int:
    """Raw samples per fine sample: a divisor of the block's own stride."""
    return largest_divisor(block.stride, fine_samples(block.segment))


@dataclass(frozen=True)
class FineBands:
    """Bands of the fine signals of every block."""

    key: tuple[object, ...]  # equal for bands that share their signals
    # wide, narrow: (n,), of the velocity and of the torque [Hz], one per block
    wide: list[Array]
    narrow: list[Array]


def fine_bands(signals: Signals, inertia: Array, stiffness: Array, shared: dict[object, Any]) -> FineBands:
    """The bands at given B and K, shape (n,) each, which determine the noise of s and q̇.

    `shared`: cache of quantities that depend on the signals only.
    """
    blocks = signals.blocks
    if "noise" not in shared:
        shared["noise"] = segments_noise([b.segment for b in blocks])
    theta, tau = shared["noise"]
    scale = np.sqrt(np.mean(signals.tau[0] ** 2, axis=0)) + 1e-9
    wide = [_sign_band(b, theta) for b in blocks]
    roots = [np.sqrt(b.segment.step) for b in blocks]
    narrow = [
        torque_band(theta * root, tau * root, inertia, stiffness, scale, _band_limit(b))
        for b, root in zip(blocks, roots, strict=True)
    ]
    bands = (tuple(np.round(np.log(w) / np.log(BAND_STEP))) for w in (*wide, *narrow))
    key = ("fine", tuple(fine_stride(b) for b in blocks), *bands)
    return shared.setdefault(("bands", key), FineBands(key, wide, narrow))


def fine_signals(signals: Signals, bands: FineBands, shared: dict[object, Any]) -> list[FineSignals]:
    """Fine signals of every block, shared by all models with nearly the same bands."""

    def make() -> list[FineSignals]:
        parts = zip(signals.blocks, bands.wide, bands.narrow, strict=True)
        return [_filtered(block, a, b, signals.torque_hold / 2) for block, a, b in parts]

    if bands.key not in shared:  # a search meets hundreds of bands
        shared[bands.key] = Recent("fine signals", KEPT, _size, KEPT_BYTES)
    return shared[bands.key].get(make)


def _size(fine: list[FineSignals]) -> int:
    """Size in bytes."""
    return sum(array.nbytes for f in fine for array in (f.position, f.velocity, f.theta, f.tau))


def torque_band(
    theta: Array, tau: Array, inertia: Array, stiffness: Array, scale: Array, limit: float
) -> Array:
    """Widest band in which s and the link velocity are quiet enough, shape (n,) [Hz].

    Args:
        theta, tau: shape (n,), noise densities [rad √s], [Nm √s].
        inertia, stiffness, scale: shape (n,): B, K and the rms torque.
        limit: no wider than this [Hz].
    """
    f = np.geomspace(2.0, limit, 60)[:, None]
    w = 2 * np.pi * f
    # one-sided densities 2d²; s = τ − Bθ̈ and ṡ/K = (τ̇ − Bθ⃛)/K, integrated up to f
    torque = np.sqrt(2 * f * (tau**2 + inertia**2 * theta**2 * w**4 / 5))
    rate = np.sqrt(2 * f * (tau**2 * w**2 / 3 + inertia**2 * theta**2 * w**6 / 7)) / stiffness
    quiet = (torque < TORQUE_NOISE * scale) & (rate < LINK_VELOCITY_NOISE)
    widest = np.where(quiet, f, 0.0).max(axis=0)
    return np.clip(widest, 2.0, limit)


def _band_limit(block: Block) -> float:
    return 0.3 / (block.segment.step * fine_stride(block))


def _sign_band(block: Block, noise_theta: Array) -> Array:
    """Band of the velocity whose sign friction follows, shape (n,) [Hz]."""
    density = noise_theta * np.sqrt(block.segment.step)
    band = SIGN_BANDWIDTH_HZ * (SIGN_REFERENCE_NOISE / (density + 1e-12)) ** (2 / 3)
    return np.clip(band, 4.0, _band_limit(block))


def _filtered(block: Block, wide_hertz: Array, narrow_hertz: Array, delay: float) -> FineSignals:
    segment, stride = block.segment, fine_stride(block)
    wide = ButterworthZeroPhase(2 * np.pi * wide_hertz)
    position, velocity = wide.derivatives(segment.theta, segment.step, 2, position=True, stride=stride)
    narrow = ButterworthZeroPhase(2 * np.pi * narrow_hertz)
    theta = narrow.derivatives(segment.theta, segment.step, 4, position=True, stride=stride)
    tau = narrow.derivatives(block.torque, segment.step, 2, delay=delay, stride=stride)
    time, step = segment.time[::stride], segment.step * stride
    return FineSignals(time, step, position, velocity, theta, tau, narrow_hertz)
