"""Statistics that every room shares."""

from typing import Any

from flexviz.base._scipy import sp
from flexviz.base.arrays import Array

NORMAL_95 = 1.96  # standard errors in half a 95 % interval of a normal distribution


def student_95(freedom: float | Array) -> Any:
    """Student's 97.5 % quantile: `scipy.stats` has it too, but takes a second to load."""
    return sp.special.stdtrit(freedom, 0.975)
