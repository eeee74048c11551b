"""Registers of a few bits: overflows, two's complements and sign-magnitude forms are told apart."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from flexviz.base.errors import InputError
from flexviz.checks import check_jumps
from flexviz.data.logs.assembling import decoded
from flexviz.data.noise import Channel, sign_magnitude

Array = NDArray[np.float64]
RATE = 250.0  # [Hz]
FASTEST = 20.0  # [rad/s]


def channel(signal: str, register: Array, size: float) -> Channel:
    return Channel(signal, "joint1", np.arange(len(register)) / RATE, register, size)


def motion(count: int = 2000, seed: int = 0) -> Array:
    """Through zero a few times, shape (N,), at most 1."""
    rng = np.random.default_rng(seed)
    t = np.arange(count) / RATE
    parts = [
        np.sin(2 * np.pi * f * t + p) for f, p in zip((0.3, 0.7, 1.3), rng.uniform(0, 6, 3), strict=True)
    ]
    return np.sum(parts, axis=0) / 3


def as_sent(form: str, counts: Array, bits: int) -> Array:
    if form == "sign-magnitude":
        return np.where(counts < 0, 2.0 ** (bits - 1) - counts, counts)
    return np.mod(counts, 2.0**bits)


@pytest.mark.parametrize("signal", ["theta", "tau"])
@pytest.mark.parametrize("bits", [11, 16])
@pytest.mark.parametrize("share", [0.05, 0.4, 0.9])
@pytest.mark.parametrize("form", ["sign-magnitude", "two's complement"])
@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_signed_registers(signal: str, bits: int, share: float, form: str, noise: float) -> None:
    half = 2.0 ** (bits - 1)
    noisy = share * (half - 4) * motion() + noise * np.random.default_rng(1).normal(size=2000)
    counts = np.round(np.clip(noisy, 1 - half, half - 1))
    sent = as_sent(form, counts, bits)
    if sent.max() < 256:  # of so few bits nothing is said
        return
    (found,) = check_jumps(channel(signal, sent, 2.0 / half), FASTEST, False)
    assert found.remedy is not None
    if form == "sign-magnitude":
        assert (found.remedy.key, found.remedy.value) == ("sign_bit", bits - 1)
        np.testing.assert_array_equal(sign_magnitude(sent, bits - 1), counts)
    else:
        assert (found.remedy.key, found.remedy.value) == ("wrap", 2.0**bits)


@pytest.mark.parametrize("period", [4096.0, 65536.0])
def test_a_counter_that_overflows(period: float) -> None:
    counts = np.round(period * (0.4 * motion() + np.linspace(0, 2, 2000)))
    (found,) = check_jumps(channel("theta", np.mod(counts, period), 2 * np.pi / period), FASTEST, False)
    assert found.remedy is not None and (found.remedy.key, found.remedy.value) == ("wrap", period)


@pytest.mark.parametrize("signal", ["theta", "tau"])
@pytest.mark.parametrize("offset", [0.0, 2000.0, 40000.0])
def test_registers_without_a_jump(signal: str, offset: float) -> None:
    counts = np.round(900 * motion()) + offset
    assert not check_jumps(channel(signal, counts, 1e-3), FASTEST, False)


def test_power_that_is_switched_off_is_no_overflow() -> None:
    torque = 986 * motion()
    torque[1000:1400] = 0.0
    torque = np.round(torque)
    for found in check_jumps(channel("tau", torque, 0.01), FASTEST, False):
        assert found.remedy is None or found.remedy.key not in ("wrap", "sign_bit")


def test_decoding_checks_its_numbers(tmp_path: Path) -> None:
    rows, file = np.arange(4), tmp_path / "log.csv"
    raw = np.array([5.0, 2.0**15, 2.0**15 + 7, -3.0])  # the last was decoded before
    np.testing.assert_array_equal(decoded(raw, 15, rows, "current", file), [5.0, 0.0, -7.0, -3.0])
    for wrong in (2.0**16, 2.0**15 + 0.5):
        with pytest.raises(InputError, match=r"whole number below 2\^16 with sign_bit = 15") as raised:
            decoded(np.array([1.0, wrong, 0.0, 0.0]), 15, rows, "current", file)
        assert raised.value.place == "row 2, column current"


def test_a_register_in_another_unit_has_no_sign_bit() -> None:
    sent = as_sent("sign-magnitude", np.round(900 * motion()), 16)
    scaled = replace(channel("tau", sent, 1.0), values=0.1 * sent + 0.05)
    for found in check_jumps(scaled, FASTEST, False):
        assert found.remedy is None or found.remedy.key != "sign_bit"
