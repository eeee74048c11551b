"""A result as tables and sentences for terminals, notebooks and logs."""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Sequence

from rich.console import Console
from rich.table import Table

from flexviz.base.units import unit_of_all
from flexviz.content.records import (
    PERCENT,
    Combination,
    CurveTable,
    JointErrors,
    ParameterEstimate,
    ResidualSummary,
)
from flexviz.content.results.assessment import assessment
from flexviz.content.results.diagnosis_summary import diagnosis_parts
from flexviz.content.results.fields import ResultFields
from flexviz.content.results.link_side import LinkSide
from flexviz.content.results.tables import fold, in_ascii, interval, plain_table
from flexviz.content.wording import (
    as_markdown,
    effect_title,
    escape,
    estimate_cells,
    markdown_table,
    number,
    told,
)
from flexviz.model.effects import free_curve

WIDE = 110  # columns from which a table has room for ties between parameters
WIDEST = 130  # … and for the words "not determined"


def text(result: ResultFields, width: int) -> str:
    """The whole result, `width` columns wide."""
    console = Console(file=io.StringIO(), width=width, markup=False, highlight=False, emoji=False)
    for part in parts(result, width):
        console.print(part, soft_wrap=isinstance(part, str))
    return console.file.getvalue().rstrip("\n")  # type: ignore[attr-defined]


def html(result: ResultFields) -> str:
    """The whole result for a notebook."""
    out = []
    for part in parts(result, WIDEST):
        if isinstance(part, str):
            out.append(f"<div>{escape(part)}</div>")
            continue
        titles, *rows = rows_of(part)
        head = "".join(f"<th>{escape(title)}</th>" for title in titles)
        body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
        out.append(f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>")
    return "".join(out)


def markdown(result: ResultFields) -> str:
    """The whole result as Markdown; indented lines are entries of lists."""
    out = []
    for part in parts(result, WIDEST):
        if isinstance(part, str):
            out.append(("   - " if part.startswith("     ") else "") + as_markdown(part.strip()))
        else:
            head, *rows = ([as_markdown(cell) for cell in row] for row in rows_of(part))
            out.append("\n".join(markdown_table(head, rows)))
    return "\n\n".join(out)


def rows_of(table: Table) -> list[list[str]]:
    """The titles of a table's columns, then its rows."""
    columns = ((str(column.header), *map(str, column.cells)) for column in table.columns)
    return [list(row) for row in zip(*columns, strict=True)]


def parts(result: ResultFields, width: int) -> list[Table | str]:
    """Tables and lines of text in their order; narrow ones list ties below the table."""
    if result.verdict is not None:
        return diagnosis_parts(result, width)
    wide = width >= WIDE
    shown = [p for p in result.all_parameters if free_curve(p.name) is None]
    words = width >= WIDEST
    out: list[Table | str] = [parameter_table(shown, ties=wide, words=words, link_side=result.link_side)]
    out += [] if words or all(map(told, shown)) else ["a value – is not determined by these data"]
    out += [] if wide else tied_lines(shown)
    out += [part for curve in result.curves for part in curve_parts(curve)]
    out.append(combination_table(result.base_parameters))
    if result.residual is not None:
        out += residual_parts(result.residual)
    return [*out, *run_lines(result), *filter(None, [assessment(result)])]


def run_lines(result: ResultFields) -> list[str]:
    """Facts about the run of an identification."""
    lines = [f"{result.set}: {result.message}"]
    lines += [f"recording: {entry.message}" for entry in result.recording]
    if result.observer is not None and result.seconds is not None:
        lines.append(
            f"{result.iterations} iterations in {result.seconds:.2f} s; observer {result.observer.name}, "
            + result.observer.tuning
        )
    held_out = f"; validated on {', '.join(result.validation_groups)}" if result.validation_groups else ""
    lines.append(f"fitted on {', '.join(result.groups or ())}{held_out}")
    if math.isfinite(result.condition_number):
        lines.append(f"condition number {result.condition_number:.3g}")
    return lines


def parameter_table(
    parameters: Iterable[ParameterEstimate],
    *,
    ties: bool = True,
    words: bool = True,
    link_side: Iterable[LinkSide] = (),
) -> Table:
    """One row per parameter; with `ties` also the parameters it is tied to, with `words` "not determined".

    `link_side`: what link encoders show of the stiffness, in a column of its own.
    """
    encoders = {entry.joint: entry.text for entry in link_side}
    table = plain_table(
        "parameter", "joint", numbers=("start", "value", "± 95 %"), end=("unit", "identifiable")
    )
    fold(table, 1)
    if encoders:
        table.add_column("by link encoder", overflow="fold")
    if ties:
        table.add_column("tied to", overflow="fold")
    for p in parameters:
        table.add_row(
            p.name,
            p.joint or "",
            in_ascii(number(p.start)),
            *(map(in_ascii, estimate_cells(p)) if words or told(p) else ("–", "–")),
            p.unit,
            p.identifiable + (", at bound" if p.at_bound else ""),
            *([encoders.get(p.joint or "", "") if p.name == "stiffness" else ""] if encoders else []),
            *([", ".join(p.tied_to)] if ties else []),
            style="" if p.identifiable == "yes" else "dim",
        )
    return table


def tied_lines(parameters: Iterable[ParameterEstimate]) -> list[str]:
    """Ties between parameters as lines of text, for a narrow terminal."""
    tied = [p for p in parameters if p.tied_to]
    return [f"{p.name}{f':{p.joint}' if p.joint else ''} is tied to {', '.join(p.tied_to)}" for p in tied]


def curve_parts(curve: CurveTable) -> tuple[str, Table]:
    """A free curve: what it is, and its torque at the nodes."""
    title = f"{effect_title(curve.effect)} on {curve.joint}: not physics"
    title += f"; its form is that of {curve.form}" if curve.form else ""
    numbers = [f"{way} ± 95 % [Nm]".strip() for way in curve.directions]
    table = plain_table(numbers=(f"{curve.variable} [{curve.unit}]", *numbers))
    for k, at in enumerate(curve.at):
        cells = (
            " ± ".join(interval(value[k], std[k])) for value, std in zip(curve.value, curve.std, strict=True)
        )
        table.add_row(in_ascii(number(at)), *cells)
    return title, table


def combination_table(combinations: Iterable[Combination]) -> Table:
    """Identifiable combinations of inertial parameters."""
    table = plain_table("inertial combination", numbers=("value", "± 95 %"), end=("unit", "identifiable"))
    fold(table, 0)
    for c in combinations:
        style = "" if c.identifiable == "yes" else "dim"
        table.add_row(c.name, *map(in_ascii, estimate_cells(c)), c.unit, c.identifiable, style=style)
    return table


def residual_parts(residual: ResidualSummary) -> tuple[str, Table]:
    """Rms error per joint on the fitted and the held-out groups, and the noise: of the torque, and in Nm."""
    rows = {"fit": residual.rms, "held out": residual.rms_validation, "noise": residual.noise_floor}
    rows = {name: row for name, row in rows.items() if row is not None}
    columns: dict[str, Sequence[float]] = {}
    if residual.torque_spread:
        columns = {
            f"{name} [%]": JointErrors(row, residual.torque_spread).shares for name, row in rows.items()
        }
    torque = unit_of_all(residual.units)
    columns |= {f"{name} [{torque}]": row for name, row in rows.items()}
    mixed = len(set(residual.units)) > 1
    table = plain_table("joint", numbers=tuple(columns), end=("unit",) if mixed else ())
    fold(table, 0)
    for index, joint in enumerate(residual.joints):
        cells = [number(column[index]) for column in columns.values()]
        table.add_row(joint, *cells, *([residual.units[index]] if mixed else []))
    measure = f"in {PERCENT} (its standard deviation) and" if residual.torque_spread else ""
    measure = f"{measure} in {torque.replace(', ', ' and ')}".strip()
    return f"error: rms residual {measure}", table
