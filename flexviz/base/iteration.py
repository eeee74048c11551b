"""A step of a solver."""

from __future__ import annotations

from dataclasses import dataclass

from flexviz.base.fields import Floats


@dataclass(frozen=True, eq=False)
class Iteration:
    """One step of a solver.

    Attributes:
        number: counted from 0 (the start) over all stages.
        stage: what the solver is doing.
        cost: ½ Σ (r/σ)² + prior.
        step: length of the step in standard deviations of the parameters.
        values: shape (P,), parameters in the units of the result (stiffness, not compliance).
        names: shape (P,), "stiffness:joint1".
    """

    number: int
    stage: str
    cost: float
    step: float
    values: Floats
    names: tuple[str, ...]
