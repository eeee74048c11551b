"""Friction and elasticity as feed-forward tables."""

from flexviz.model.compensation.friction import ELASTIC, by_speed_and_load, deflection, sliding_friction
from flexviz.model.compensation.table import (
    ELASTICITY_FILE,
    FRICTION_FILE,
    FrictionTable,
    elasticity_text,
    friction_table,
    read_friction_table,
)

__all__ = [
    "ELASTIC",
    "ELASTICITY_FILE",
    "FRICTION_FILE",
    "FrictionTable",
    "by_speed_and_load",
    "deflection",
    "elasticity_text",
    "friction_table",
    "read_friction_table",
    "sliding_friction",
]
