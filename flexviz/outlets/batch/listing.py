"""The rows of a fleet as an HTML list, for the app."""

from __future__ import annotations

from collections.abc import Sequence

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


def about_html(row: FleetRow, apart: Sequence[Outlier], index: int) -> str:
    """What the batch found about one set."""
    lines = [f"<b>{escape(row.set)}</b> ({escape(row.robot)}): {escape(verdict_words(row))}"]
    if row.state == FAILED:
        lines.append(f'<span class="fv-warn">{escape(row.error)}</span>')
    if row.state == DONE and row.residual_before is not None and row.residual is not None:
        errors = f"error {row.error_text_before}"
        after = f", {row.error_text} with {found_text(row)}" if row.found else ""
        lines.append(escape(errors + after))
    if row.date_from == "file":
        lines.append("The set states no date: * is that of its files.")
    lines += [
        f"{escape(parameter_words(one.parameter))} stands out: {number(one.value)}, median of {one.of}: "
        f"{number(one.median)} {escape(one.unit)}"
        for one in apart
        if one.row == index
    ]
    return f'<div class="fv">{"".join(f"<div>{line}</div>" for line in lines)}</div>'
