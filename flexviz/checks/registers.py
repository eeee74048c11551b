"""Registers of a few bits, by their numbers: those that overflow, and those whose top bit is their sign."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.base.arrays import Array
from flexviz.data.noise import SLACK, sign_magnitude

BITS = range(8, 33)  # of a counter


def overflow(values: Array, periods: Sequence[float]) -> float | None:
    """The largest of `periods` by which `values` (N,) jump and are continuous otherwise; None: by none.

    What overflows after a period stays within one.
    """
    steps = np.abs(np.diff(values))
    for period in sorted(periods, reverse=True):
        far = steps > period / 2
        if not far.any() or far.all() or np.ptp(values) > period * (1 + SLACK):
            continue
        usual = float(np.max(steps[~far]))
        rest = np.abs(steps[far] - period * np.round(steps[far] / period))
        if usual < period / 4 and np.max(rest) <= max(2 * usual, 1e-3 * period):
            return float(period)
    return None


def counter_periods(values: Array) -> list[float]:
    """2⁸ … 2³² counts, in the unit of `values`, where these are whole numbers of counts."""
    steps = np.abs(np.diff(values))
    steps = steps[steps > 1e-9 * np.max(np.abs(values))]
    if not len(steps):
        return []
    for count in (1.0, float(np.min(steps))):
        numbers = values / count
        if np.all(np.abs(numbers - np.round(numbers)) < 1e-3):
            return [count * 2.0**bits for bits in BITS]
    return []


def sign_bit(values: Array) -> int | None:
    """The bit N of a register in sign-magnitude form, by its numbers (N,); None where it is in none.

    A change of sign then jumps by 2^N, whatever the value; with the bit decoded no step exceeds half of that.
    An overflow, or a two's complement, is as continuous only otherwise.
    """
    whole = np.round(values)
    if not len(values) or whole.min() < 0.0 or whole.max() < 2.0 ** BITS[0]:
        return None
    if np.any(np.abs(values - whole) > SLACK):
        return None
    bit = int(np.log2(whole.max()))
    half = 2.0**bit / 2
    far = np.abs(np.diff(whole)) > half
    right = far.any() and not np.any(np.abs(np.diff(sign_magnitude(whole, bit))) > half)
    return bit if right else None


def may_be_signed(values: Array, bit: int) -> bool:
    """Whether numbers (N,), NaN where unknown, can be a register whose sign is this bit."""
    known = values[np.isfinite(values)]
    whole = np.abs(known - np.round(known)) <= SLACK
    return bool(np.all(whole & (known > -SLACK) & (known < 2.0 ** (bit + 1) - SLACK)))


def has_sign_bit(values: Array, bit: int) -> bool:
    """Whether a column beside one with this sign bit has it: it is continuous so, or always below zero."""
    always = bool(np.all(values > 2.0**bit - SLACK))
    return may_be_signed(values, bit) and (always or sign_bit(values) == bit)
