"""Observers against the equations they solve, exact discretisation and analytic derivatives."""

import numpy as np
import pytest
from scipy.linalg import expm

from flexviz.base.errors import InputError
from flexviz.data.measurements import Segment
from flexviz.model.observers import OBSERVERS, CausalEso, EqualDelayEso, FlatZeroPhase, make_observer
from flexviz.model.observers.base import shifted
from flexviz.model.observers.cascade import cascade
from flexviz.model.observers.gains import binomial_gains

NAMES = list(OBSERVERS)


def first_order_hold(a, b, y, step, start):
    """x' = a x + b y, y a straight line between samples: exact, by the exponential of an augmented matrix."""
    n = len(a)
    big = np.zeros((n + 2, n + 2))
    big[:n, :n], big[:n, n], big[n, n + 1] = a * step, b * step, 1.0
    phi = expm(big)
    x = np.zeros((len(y), n))
    x[0] = start
    for k in range(len(y) - 1):
        x[k + 1] = phi[:n, :n] @ x[k] + phi[:n, n] * y[k] + phi[:n, n + 1] * (y[k + 1] - y[k])
    return x


@pytest.mark.parametrize(("w", "step"), [(5, 2.5e-4), (20, 2.5e-4), (370, 1e-3), (2000, 1e-3), (2000, 1e-2)])
def test_cascade_is_the_exact_first_order_hold(w, step):
    rng = np.random.default_rng(1)
    y = np.cumsum(rng.standard_normal(300))
    a = -w * np.eye(6) + w * np.eye(6, k=-1)
    b = np.r_[w, np.zeros(5)]
    expected = first_order_hold(a, b, y, step, np.full(6, y[0]))
    for stride in (1, 7, 300):
        got = cascade(y[:, None], step, w, stride)[:, :, 0].T
        np.testing.assert_allclose(got, expected[::stride], rtol=1e-9, atol=1e-9 * np.abs(y).max())


@pytest.mark.parametrize("w", [20.0, 80.0])
def test_causal_eso_solves_the_papers_equations(w):
    """x̂̇_i = x̂_{i+1} + β_i e, x̂̇₆ = β₆ e, in units of w^(i−1) to keep the matrix exponential accurate."""
    step = 1e-3
    t = step * np.arange(2000)
    y = np.sin(3 * t) + 0.2 * np.cos(11 * t)
    scaled = binomial_gains(w) / w ** np.arange(1, 7)
    a = w * (np.eye(6, k=1) - np.outer(scaled, np.eye(6)[0]))
    x = first_order_hold(a, w * scaled, y, step, np.r_[y[0], np.zeros(5)]) * w ** np.arange(6)
    states = CausalEso(w).states(Segment(t, y[:, None], y[:, None], step))
    for k in range(5):
        np.testing.assert_allclose(states.theta[k, :, 0], x[:, k], rtol=0, atol=2e-7 * np.abs(x[:, k]).max())
    assert states.disturbance is not None
    np.testing.assert_allclose(states.disturbance[:, 0], x[:, 5], rtol=0, atol=2e-7 * np.abs(x[:, 5]).max())
    np.testing.assert_allclose(states.tau[:, :, 0], states.theta[:3, :, 0])


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("w", [5.0, 50.0, 400.0, 2000.0])
@pytest.mark.parametrize("step", [2.5e-4, 1e-3, 1e-2])
def test_stable_and_exact_for_a_constant(name, w, step):
    y = np.full((3000, 2), 1.7)
    y[:, 1] = -0.4
    out = make_observer(name, w).derivatives(y, step, 5)
    assert np.all(np.isfinite(out))
    np.testing.assert_allclose(out[0], y, rtol=1e-9)
    for k in range(1, 5):
        assert np.abs(out[k]).max() <= 1e-9 * max(w, 1 / step) ** k


@pytest.mark.parametrize("name", NAMES)
def test_noise_does_not_blow_up(name):
    rng = np.random.default_rng(0)
    y = rng.standard_normal((20000, 1))
    for w in (5.0, 2000.0):
        out = make_observer(name, w).derivatives(y, 1e-3, 5)
        assert np.all(np.isfinite(out))
        assert np.abs(out[0]).max() < 12


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("order", range(5))
def test_steady_state_follows_the_transfer_function(name, order):
    observer = make_observer(name, 60.0)
    step, omega = 5e-4, 9.0
    t = step * np.arange(12000, dtype=float)
    segment = Segment(t, np.sin(omega * t)[:, None], np.zeros((len(t), 1)), step)
    got = observer.derivatives(segment.theta, step, 5, position=True)[order, :, 0]
    gain = observer.transfer(np.array([omega]), order)[0]
    expected = np.imag(gain * np.exp(1j * omega * t))
    keep = observer.valid(t)
    assert keep.sum() > 4000
    scale = abs(gain)
    np.testing.assert_allclose(got[keep], expected[keep], rtol=0, atol=(4e-2 if order == 4 else 3e-3) * scale)


@pytest.mark.parametrize("name", [n for n in NAMES if OBSERVERS[n].zero_phase])
def test_zero_phase_derivatives_of_slow_motion(name):
    step = 1e-3
    t = step * np.arange(12000, dtype=float)
    y = 0.8 * np.sin(2 * t) + 0.1 * np.sin(5 * t + 1)
    observer = make_observer(name, 2 * np.pi * 14)
    out = observer.derivatives(y[:, None], step, 5, position=True)[:, :, 0]
    keep = observer.valid(t)
    for k in range(5):
        exact = 0.8 * 2**k * np.sin(2 * t + k * np.pi / 2) + 0.1 * 5**k * np.sin(5 * t + 1 + k * np.pi / 2)
        droop = abs(observer.gain(np.array([5.0]), np.array([2 * np.pi * 14]))[0, 0] - 1)  # type: ignore[attr-defined]
        error = np.abs(out[k] - exact)[keep] / np.abs(exact).max()
        # what the reflection gets wrong is worst in the fourth derivative, at the last valid sample
        assert error.max() < (1e-6, 1e-5, 1e-4, 2e-3, 4e-2)[k] + 4 * droop
        assert np.median(error) < 1e-6 * 10**k + 4 * droop
    assert observer.lag(step) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("position", [False, True])
def test_every_second_derivative_is_one_of_all(position):
    observer = FlatZeroPhase(40.0)
    y = np.random.default_rng(3).normal(size=(900, 2)).cumsum(axis=0)
    of_all = observer.derivatives(y, 2e-3, 5, position=position, stride=3)[::2]
    found = observer.derivatives(y, 2e-3, 5, position=position, stride=3, every=2)
    for order, expected in zip(found, of_all, strict=True):
        np.testing.assert_allclose(order, expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("stride", [2, 7, 25, 40])
@pytest.mark.parametrize("name", NAMES)
def test_stride_picks_the_same_samples(name, stride):
    rng = np.random.default_rng(3)
    y = np.cumsum(rng.standard_normal((4001, 2)), axis=0) * 1e-2
    observer = make_observer(name, 30.0)
    full = observer.derivatives(y, 1e-3, 3, position=True)
    picked = observer.derivatives(y, 1e-3, 3, position=True, stride=stride)
    inside = slice(1000 // stride, -1000 // stride)  # the continuation differs a little
    for k in range(3):
        expected, most = full[k, ::stride], np.abs(full[k]).max()
        np.testing.assert_allclose(picked[k], expected, rtol=0, atol=2e-3 * most)
        np.testing.assert_allclose(picked[k, inside], expected[inside], rtol=0, atol=1e-7 * most)


@pytest.mark.parametrize("name", NAMES)
def test_delay_shifts_the_signal(name):
    step, delay = 1e-3, 2.5e-3
    t = step * np.arange(6000, dtype=float)
    observer = make_observer(name, 60.0)
    late = observer.derivatives(np.sin(4 * t)[:, None], step, 1, delay=delay)[0, :, 0]
    shifted = observer.derivatives(np.sin(4 * (t - delay))[:, None], step, 1)[0, :, 0]
    keep = observer.valid(t)
    np.testing.assert_allclose(late[keep], shifted[keep], rtol=0, atol=2e-5)


@pytest.mark.parametrize("name", NAMES)
def test_noise_gain_is_that_of_white_noise(name):
    rng = np.random.default_rng(5)
    step = 1e-3
    noise = rng.standard_normal((200_000, 1))
    observer = make_observer(name, 80.0)
    out = observer.derivatives(noise, step, 5)[:, 5000:-5000, 0]
    np.testing.assert_allclose(out.std(axis=1), observer.noise_gain(step), rtol=0.05)


def test_one_bandwidth_a_joint():
    rng = np.random.default_rng(7)
    y = rng.standard_normal((2000, 3))
    for name in NAMES:
        together = make_observer(name, [20.0, 50.0, 20.0]).derivatives(y, 1e-3, 4)
        for j, w in enumerate((20.0, 50.0, 20.0)):
            alone = make_observer(name, w).derivatives(y[:, j : j + 1], 1e-3, 4)[:, :, 0]
            np.testing.assert_allclose(
                together[:, 500:-500, j], alone[:, 500:-500], atol=2e-2 * np.abs(alone[3]).max()
            )


def test_equal_delay_treats_theta_and_tau_alike():
    t = 1e-3 * np.arange(3000)
    y = np.sin(5 * t)[:, None]
    states = EqualDelayEso(40.0).states(Segment(t, y, y, 1e-3))
    np.testing.assert_allclose(states.theta[:3], states.tau)
    assert not states.valid[0] and states.valid[-1]


@pytest.mark.parametrize("bandwidth", [0.0, -3.0, np.nan, np.inf, 1e9, [20.0, -1.0]])
def test_bad_bandwidths_are_named(bandwidth):
    with pytest.raises(InputError, match="bandwidth"):
        make_observer("eso", bandwidth)


def test_unknown_observer_lists_the_known_ones():
    with pytest.raises(InputError, match="eso-equal-delay"):
        make_observer("kalman")
    with pytest.raises(InputError, match="3 joints"):
        make_observer("eso", [20.0, 30.0]).derivatives(np.zeros((100, 3)), 1e-3, 2)


def test_lag_of_six_equal_sections():
    omega, w = 2 * np.pi * 1.5, 40.0
    assert EqualDelayEso(w).lag(1e-3, 1.5) == pytest.approx(6 * np.arctan(omega / w) / omega, rel=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_the_last_state_is_there_where_it_is_announced(name):
    observer = make_observer(name, 30.0)
    t = 2e-3 * np.arange(2000, dtype=float)
    segment = Segment(t, np.sin(4 * t)[:, None], np.cos(3 * t)[:, None], 2e-3)
    states = observer.states(segment, torque_hold=0.02)
    assert observer.has_disturbance_state == (states.disturbance is not None)
    held = observer.derivatives(segment.tau, 2e-3, 3, delay=0.01)  # half of it
    np.testing.assert_allclose(states.tau, held)


def test_transients_end_at_a_sample():
    observer = make_observer("butterworth-zero-phase", 25.0)  # 1 s at either end
    for begin in (0.0, 0.3):
        t = begin + 0.1 * np.arange(41, dtype=float)
        assert np.flatnonzero(observer.valid(t)).tolist() == list(range(10, 31))
    late = CausalEso(25.0)
    settled = late.settling()[0] * 25.0
    assert 1e-7 < settled**5 * np.exp(-settled) / 120 < 1e-5  # of an error in the initial state
    assert np.flatnonzero(late.valid(0.1 * np.arange(41, dtype=float)))[0] == 10


def test_a_delay_of_one_second_is_one():
    y = np.arange(9.0)[:, None] ** 2
    np.testing.assert_array_equal(shifted(y, 0.25, 1.0)[4:], y[:-4])
    np.testing.assert_allclose(shifted(y, 0.25, 0.1)[1:], 0.6 * y[1:] + 0.4 * y[:-1])


@pytest.mark.parametrize("name", [n for n in NAMES if OBSERVERS[n].zero_phase])
def test_zero_phase_observers_keep_lines_and_drop_what_has_no_sign(name):
    t = 1e-2 * np.arange(1000, dtype=float)
    out = make_observer(name, 30.0).derivatives((2.0 - 3.0 * t)[:, None], 1e-2, 3, position=True)[:, :, 0]
    np.testing.assert_allclose(out, [2.0 - 3.0 * t, np.full(1000, -3.0), np.zeros(1000)], atol=1e-9)
    late = make_observer(name, 30.0).derivatives((2.0 - 3.0 * t)[:, None], 1e-2, 1, position=True, delay=0.03)
    np.testing.assert_allclose(late[0, :, 0], 2.0 - 3.0 * (t - 0.03), atol=1e-9)
    alternating = np.where(np.arange(1000) % 2, -1.0, 1.0)[:, None]  # half the sampling rate
    assert np.abs(make_observer(name, 2000.0).derivatives(alternating, 1e-2, 1)[0, 100:-100]).max() < 0.1


def test_above_the_cutoff_nothing_passes():
    w = np.array([30.0])
    for name in ("butterworth-zero-phase", "eso-zero-phase"):
        observer = make_observer(name, 30.0)
        for order in range(5):
            cutoff = np.array([observer.cutoff(order)])
            left = observer.gain(cutoff, w)[0, 0] * (cutoff[0] / w[0]) ** order  # type: ignore[attr-defined]
            assert left == pytest.approx(1e-8, rel=0.5) and cutoff > w
    flat = FlatZeroPhase(30.0)
    edge = flat.cutoff(0)
    assert flat.gain(np.array([edge]), w)[0, 0] == 0.0 < flat.gain(np.array([0.9 * edge]), w)[0, 0]
