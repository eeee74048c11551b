"""Evidence: the residual with the signature of a candidate over it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexviz.charts import COLOURS, Plot, no_plot, time_plot

if TYPE_CHECKING:
    from flexviz.diagnosis import Finding

KEY = "evidence"


def evidence_plot(finding: Finding | None, group: str, height: int = 190) -> Plot:
    """Residual and signature over time, of the shown group where the finding has it, else of its first."""
    from flexviz.wording import finding_name

    evidence = None if finding is None else getattr(finding, "evidence", None)
    if finding is None or evidence is None or not len(evidence.time):
        return no_plot(KEY, "" if finding is None else "No evidence is kept for this one.")
    spans = {name: (first, last) for name, first, last in evidence.groups}
    chosen = group if group in spans else next(iter(spans), "")
    first, last = spans.get(chosen, (0, len(evidence.time)))
    rows = slice(first, last)
    time = np.asarray(evidence.time[rows])
    if len(time) < 2:
        return no_plot(KEY, "")
    plot = time_plot(
        KEY,
        f"{finding_name(finding)}, {chosen}",
        "Nm",
        time,
        [
            (f"residual of {evidence.joint}", COLOURS.residual, np.asarray(evidence.residual[rows])),
            ("signature", COLOURS.model, np.asarray(evidence.signature[rows])),
        ],
        height=height,
    )
    return replace(plot, playhead=None)
