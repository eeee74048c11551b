"""Results side by side: parameters, errors, effects, and the friction that a compensation removed."""

from flexviz.content.comparing.comparison import (
    KnownResults,
    ParameterRow,
    ResultComparison,
    ResultSummary,
    compare,
    effects_of,
)
from flexviz.content.comparing.friction import ComparedFriction, SpeedRange, compare_friction
from flexviz.content.comparing.tables import comparison_blocks, facts, numbers, remarks

__all__ = [
    "ComparedFriction",
    "KnownResults",
    "ParameterRow",
    "ResultComparison",
    "ResultSummary",
    "SpeedRange",
    "compare",
    "compare_friction",
    "comparison_blocks",
    "effects_of",
    "facts",
    "numbers",
    "remarks",
]
