"""Six identical first-order sections in a row, discretised exactly.

z_j(s) = (w/(s+w))^j y(s), j = 1 … 6. Every sixth-order filter with all its poles at −w is a polynomial in
Z = w/(s+w), so the observers only differ in the coefficients with which they combine the z_j.

Between samples y is taken as a straight line (first-order hold), for which the chain's solution over a step h
is known in closed form: with x = wh, the transition from z_m to z_i is e^(−x) x^(i−m)/(i−m)!, the response to
a constant is the regularised incomplete gamma function P(i, x), to a ramp P(i, x) − (i/x) P(i+1, x). All
terms are positive, so that nothing cancels and the recursion is stable for every w and h. (The direct form
with six repeated poles is not: at w h = 0.005 its coefficients lose all digits.) Where only every S-th sample
is wanted, the recursion runs over steps of S samples, with the sum of their responses as its input.
"""

from math import factorial

import numpy as np
from numpy.typing import NDArray

from flexviz.base._scipy import sp
from flexviz.base.arrays import Array

ORDER = 6


def cascade(y: Array, step: float, bandwidth: float, stride: int = 1) -> Array:
    """z_1 … z_6 at every stride-th sample of y (N, m), shape (6, ceil(N / stride), m).

    `step` is that of y [s], `bandwidth` w [rad/s]. Before the first sample y is taken as constant.
    """
    x = bandwidth * step
    one, before, after = one_step(x)
    response = _response(before, after, one, stride)
    transition = _transition(stride * x)[:, 0]
    pole = transition[0]

    rows = np.ascontiguousarray(y.T)  # time runs along memory: the recursions below are sequential in it
    count = (len(y) - 1) // stride
    used = count * stride
    between = rows[:, :used].reshape(len(rows) * count, stride)
    last = rows[:, stride : used + 1 : stride]
    z = np.empty((ORDER, len(rows), count + 1))
    flat = z.reshape(ORDER, -1)
    drive = np.empty((len(rows), count))
    for i in range(ORDER):
        between.dot(response[i, :-1], out=drive.reshape(-1))
        drive += response[i, -1] * last
        if i:
            drive += (transition[i:0:-1] @ flat[:i]).reshape(len(rows), count + 1)[:, :-1]
        z[i, :, 0] = rows[:, 0]
        z[i, :, 1:] = sp.signal.lfilter([1.0], [1.0, -pole], drive, axis=-1, zi=pole * rows[:, :1])[0]
    return z.transpose(0, 2, 1)


def one_step(x: float) -> tuple[Array, Array, Array]:
    """A (6, 6), b₀ and b₁ (6,) of z ← A z + b₀ y_k + b₁ y_{k+1}, one sample later with wh = x."""
    number = np.arange(1, ORDER + 1)
    constant = sp.special.gammainc(number, x)
    ramp = constant - number / x * sp.special.gammainc(number + 1, x)
    return _transition(x), constant - ramp, ramp


def _transition(x: float) -> Array:
    """From z_m to z_i over a step with wh = x, shape (6, 6)."""
    down = np.subtract.outer(np.arange(ORDER), np.arange(ORDER))
    return np.array([[np.exp(-x) * x**k / factorial(k) if k >= 0 else 0.0 for k in row] for row in down])


def _response(first: Array, last: Array, transition: Array, stride: int) -> Array:
    """Response after `stride` steps to unit samples, shape (6, stride + 1), from that after one (6,)."""
    out = np.zeros((ORDER, stride + 1))
    for k in range(stride):
        out[:, : k + 1] = transition @ out[:, : k + 1]
        out[:, k] += first
        out[:, k + 1] += last
    return out


def combine(z: Array, coefficients: Array) -> Array:
    """Σ_j coefficients[:, j−1] z_j: shape (len(coefficients), N, m)."""
    rows = z.transpose(0, 2, 1)
    out = coefficients @ rows.reshape(len(rows), -1)
    return out.reshape(-1, *rows.shape[1:]).transpose(0, 2, 1)


def evaluate(coefficients: Array, omega: Array, bandwidth: float) -> NDArray[np.complex128]:
    """Σ_j coefficients[j−1] (w/(iω+w))^j at ω [rad/s], shape (len(ω),)."""
    base = bandwidth / (1j * omega + bandwidth)
    return base * np.polyval(coefficients[::-1], base)
