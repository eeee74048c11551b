"""Tables of friction by speed and load, and of deflection by torque, for feed-forward in any controller."""

from __future__ import annotations

import numpy as np

from flexviz.model.compensation import (
    ELASTICITY_FILE,
    FRICTION_FILE,
    elasticity_text,
    friction_table,
)
from flexviz.outlets.exporting.identified import FormatFiles, IdentifiedRobot

BEYOND = 1.2  # times the recorded speed and torque, up to which the tables go
SPAN = 0.02  # [s] over which a speed is taken


def tables(identified: IdentifiedRobot) -> FormatFiles:
    """`friction.csv` and `elasticity.csv`, up to a fifth beyond what the set reaches."""
    segments = [segment for group in identified.measurements.groups for segment in group.segments]
    spans = [max(min(round(SPAN / s.step), len(s) - 1), 1) for s in segments]
    moved = zip(segments, spans, strict=True)
    fastest = np.max(
        [np.abs(s.theta[k:] - s.theta[:-k]).max(axis=0) / (k * s.step) for s, k in moved], axis=0
    )
    largest = np.max([np.abs(s.tau).max(axis=0) for s in segments], axis=0)
    model = identified.model
    missing = identified.left_out("table")
    lines = [*identified.heading, *(f"NOT CONTAINED: {text}" for text in missing)]
    head = "".join(f"# {line}\n" for line in lines)
    files = {
        FRICTION_FILE: friction_table(model, BEYOND * fastest).text,
        ELASTICITY_FILE: elasticity_text(model, BEYOND * largest),
    }
    return FormatFiles({name: (head + text).encode() for name, text in files.items()}, missing)
