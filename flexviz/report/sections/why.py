"""Why these effects: the moves that the search tried."""

from __future__ import annotations

from flexviz.report.blocks import Cell, Paragraph, Section, explanation, section, table
from flexviz.report.content import ReportContent
from flexviz.wording import TRACE_TITLE, added_families, capitalised, decoys_text, told_moves

REFUSED = 10  # refused moves in the table
DECOYS = "candidates that cannot be right and compete in the same search, to estimate its false rate"


def why(content: ReportContent) -> Section | None:
    """Accepted moves and the best refused ones; None where the diagnosis keeps none."""
    diagnosis = content.diagnosis
    if diagnosis is None or not (diagnosis.trace or diagnosis.decoys):
        return None
    families = added_families(diagnosis) | content.families
    moves = told_moves(diagnosis.trace, content.joints, families, refused=REFUSED)
    rows = [
        [
            Cell(move.text, strong=move.accepted),
            move.delta,
            move.resolution,
            "accepted" if move.accepted else move.why or "refused",
        ]
        for move in moves
    ]
    head = ("move", "decrease [nats]", "resolution", "")
    about = (
        "The search adds, drops and swaps effects. It accepts a move that lowers its objective, which is "
        "measured in nats, by clearly more than the standard error of the decrease. Accepted moves come "
        "first, those of one kind together, then the best of the refused ones."
    )
    caption = "Moves of the search: decrease of the objective ± its standard error"
    decoys = diagnosis.decoys
    return section(
        TRACE_TITLE,
        explanation(about) if rows else None,
        table(head, rows, (1,), caption) if rows else None,
        None if decoys is None else Paragraph(f"{capitalised(decoys_text(*decoys))}: {DECOYS}."),
    )
