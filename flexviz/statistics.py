"""Statistics that every room shares."""

from __future__ import annotations

from math import erfc, exp, gamma, sqrt

NORMAL_95 = 1.96  # standard errors in half a 95 % interval of a normal distribution


def chi_square_tail(value: float, degrees: int) -> float:
    """Probability that χ² with an odd number of degrees of freedom is larger than `value`.

    Abramowitz, Stegun: Handbook of Mathematical Functions, 26.4.4. SciPy would have to load its special
    functions for this alone, which takes a tenth of a second.
    """
    half = 0.5 * value
    terms = (half ** (k - 0.5) / gamma(k + 0.5) for k in range(1, degrees // 2 + 1))
    return erfc(sqrt(half)) + exp(-half) * sum(terms)
