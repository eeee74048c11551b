"""The rows of a fleet as an HTML list, for the app."""

from __future__ import annotations

from collections.abc import Sequence

from flexviz.content.blocks import Block, Paragraph, warning
from flexviz.content.wording import escape, number, percent, plural
from flexviz.outlets.batch.fleet import Outlier
from flexviz.outlets.batch.page import counted_verdicts, found_text, verdict_words
from flexviz.outlets.batch.repeatability_page import parameter_words
from flexviz.outlets.batch.rows import DONE, FAILED, FleetRow

LISTED = 300  # rows on the page around the chosen one: each costs the browser time
LONGEST_NAME = 14  # characters of a folder's name on one line
MARK = "data-fleet"  # attribute of a row: its number


def fleet_html(rows: Sequence[FleetRow], chosen: int, shown: int | None) -> str:
    """The sets as a table; `chosen` is marked, `shown` is the open one."""
    said, robots = escape(counted_verdicts(rows)), plural(len({row.robot for row in rows}), "robot")
    first = min(max(chosen - LISTED // 2, 0), max(len(rows) - LISTED, 0))
    listed = range(first, min(first + LISTED, len(rows)))
    body = "".join(_row(i, rows[i], i == chosen, i == shown) for i in listed)
    cut = "" if len(listed) == len(rows) else f"; {listed[0] + 1} to {listed[-1] + 1} are listed"
    head = "<tr><th>no.</th><th>set</th><th>date</th><th>verdict</th><th>error</th></tr>"
    return (
        f'<div class="fv"><b>{plural(len(rows), "set")} of {robots}</b>: {said}{cut}. '
        'A click opens a set.<div class="fv-fleet"><table class="fv-table fv-left">'
        f"{head}{body}</table></div></div>"
    )


def _row(index: int, row: FleetRow, chosen: bool, shown: bool) -> str:
    kind = " ".join(["fv-chosen"] * chosen + ["fv-open"] * shown)
    verdict = verdict_words(row) + (f": {found_text(row)}" if row.found else "")
    error = "–" if row.residual is None else percent(row.residual)
    cells = [escape(cell) for cell in (str(index + 1), row.set, row.day, verdict, error)]
    cells[1] = "/<wbr>".join(_whole(part) for part in cells[1].split("/"))
    text = "".join(f"<td>{cell}</td>" for cell in cells)
    return f'<tr {MARK}="{index + 1}" class="{kind}" title="{escape(row.error or row.set)}">{text}</tr>'


def _whole(name: str) -> str:
    """A name without a line break, unless it is long."""
    return f'<span style="white-space: nowrap">{name}</span>' if len(name) <= LONGEST_NAME else name


def about_set(row: FleetRow, apart: Sequence[Outlier], index: int) -> list[Block]:
    """What the batch found about one set."""
    out: list[Block] = [Paragraph(f"{row.set} ({row.robot}): {verdict_words(row)}", strong=True)]
    if row.state == FAILED:
        out.append(warning(row.error))
    if row.state == DONE and row.residual_before is not None and row.residual is not None:
        after = f", {row.error_text} with {found_text(row)}" if row.found else ""
        out.append(Paragraph(f"error {row.error_text_before}{after}"))
    if row.date_from == "file":
        out.append(Paragraph("The set states no date: * is that of its files."))
    for one in apart:
        if one.row == index:
            value = f"{number(one.value)}, median of {one.of}: {number(one.median)} {one.unit}"
            out.append(Paragraph(f"{parameter_words(one.parameter)} stands out: {value}"))
    return out
