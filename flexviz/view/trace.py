"""What the search for missing effects tried, as a folded table."""

from __future__ import annotations

from collections.abc import Sequence

from flexviz.diagnosis import Diagnosis
from flexviz.wording import (
    TRACE_TITLE,
    added_families,
    capitalised,
    decoys_text,
    escape,
    told_moves,
)

REFUSED = 8  # refused moves in the table
DECREASE = "decrease of the objective ± its standard error [nats]"


def trace_html(diagnosis: Diagnosis | None, joints: Sequence[str] = ()) -> str:
    """Accepted and best refused moves, folded; empty where none are kept."""
    if diagnosis is None or not diagnosis.trace:
        return ""
    moves = told_moves(diagnosis.trace, joints, added_families(diagnosis), refused=REFUSED)
    rows = "".join(
        f"<tr><td>{'✓' if move.accepted else '–'} {escape(move.text)}</td><td>{escape(move.delta)}</td>"
        f"<td>{escape(move.why)}</td></tr>"
        for move in moves
    )
    decoys = "" if diagnosis.decoys is None else f"<p>{capitalised(decoys_text(*diagnosis.decoys))}.</p>"
    return (
        f'<div class="fv"><details class="fv-card"><summary>{TRACE_TITLE}</summary>'
        f'<table class="fv-table fv-left"><tr><th>move</th><th title="{DECREASE}">Δ [nats]</th><th></th></tr>'
        f'{rows}</table>{decoys}<p class="fv-dim">✓ accepted, – refused; Δ: {DECREASE}.</p></details></div>'
    )
