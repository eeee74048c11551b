"""Registers of a few bits, decoded: counters that overflow, and numbers whose top bit is their sign."""

from __future__ import annotations

import numpy as np

from flexviz.base.arrays import Array

SLACK = 1e-3  # of a period, or of a count, by which numbers may be inexact


def unwrapped(values: Array, period: float, centred: bool = False) -> Array:
    """`values` (N,) without jumps by `period`, beginning within half of it, or `centred` about 0."""
    first = (values[0] + period / 2) % period - period / 2
    continued = np.unwrap(values - values[0], period=period) + first
    return continued - period * np.round(np.median(continued) / period) if centred else continued


def sign_magnitude(values: Array, bit: int) -> Array:
    """Numbers (N,) below 2^(bit + 1) by their sign bit: 2^bit + x stands for −x."""
    return np.where(values > 2.0**bit - SLACK, 2.0**bit - values, values)
