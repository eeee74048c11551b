"""Six identical first-order sections in a row, discretised exactly.

z_j(s) = (w/(s+w))^j y(s), j = 1 … 6. Every sixth-order filter with all its poles at −w is a polynomial in
Z = w/(s+w), so the observers only differ in the coefficients with which they combine the z_j.

Between samples y is taken as a straight line (first-order hold), for which the chain's solution over a step h
is known in closed form: with x = wh, the transition from z_m to z_i is e^(−x) x^(i−m)/(i−m)!, the response to
a constant is the regularised incomplete gamma function P(i, x), to a ramp P(i, x) − (i/x) P(i+1, x). All
terms are positive, so that nothing cancels and the recursion is stable for every w and h. (The direct form
with six repeated poles is not: at w h = 0.005 its coefficients lose all digits.)
"""

from math import factorial

import numpy as np
from numpy.typing import NDArray

from flexviz._scipy import sp

ORDER = 6

Array = NDArray[np.float64]


def cascade(y: Array, step: float, bandwidth: float) -> Array:
    """Outputs of the six sections.

    Args:
        y: shape (N, m). Before the first sample it is taken as constant.
        step: sampling step [s].
        bandwidth: w [rad/s].

    Returns:
        shape (6, N, m): z_1 … z_6.
    """
    x = bandwidth * step
    number = np.arange(1, ORDER + 1)
    constant = sp.special.gammainc(number, x)
    ramp = constant - number / x * sp.special.gammainc(number + 1, x)
    pole = np.exp(-x)
    transition = [pole * x**k / factorial(k) for k in range(ORDER)]

    rows = np.ascontiguousarray(y.T)  # time runs along memory: the recursions below are sequential in it
    z = np.empty((ORDER, *rows.shape))
    flat = z.reshape(ORDER, -1)
    for i in range(ORDER):
        drive = (constant[i] - ramp[i]) * rows
        drive[:, :-1] += ramp[i] * rows[:, 1:]
        if i:
            drive += (np.array(transition[i:0:-1]) @ flat[:i]).reshape(rows.shape)
        z[i, :, 0] = rows[:, 0]
        z[i, :, 1:] = sp.signal.lfilter([1.0], [1.0, -pole], drive[:, :-1], axis=-1, zi=pole * rows[:, :1])[0]
    return z.transpose(0, 2, 1)


def combine(z: Array, coefficients: Array) -> Array:
    """Σ_j coefficients[:, j−1] z_j: shape (len(coefficients), N, m)."""
    rows = z.transpose(0, 2, 1)
    out = coefficients @ rows.reshape(len(rows), -1)
    return out.reshape(-1, *rows.shape[1:]).transpose(0, 2, 1)


def evaluate(coefficients: Array, omega: Array, bandwidth: float) -> NDArray[np.complex128]:
    """Σ_j coefficients[j−1] (w/(iω+w))^j at ω [rad/s], shape (len(ω),)."""
    base = bandwidth / (1j * omega + bandwidth)
    return sum(c * base ** (j + 1) for j, c in enumerate(coefficients))  # type: ignore[return-value]
