"""Tables of a result, for a terminal or a page."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich import box
from rich.table import Table

from flexviz.results.entries import CombinationEntry, ParameterEntry, ResidualEntry
from flexviz.statistics import NORMAL_95
from flexviz.wording import number, with_error

WIDE = 110  # columns from which a table has room for ties between parameters


def parameter_table(parameters: Iterable[ParameterEntry], *, ties: bool = True) -> Table:
    """One row per parameter; with `ties` also the parameters it is tied to."""
    table = plain_table(
        "parameter", "joint", numbers=("start", "value", "± 95 %"), end=("unit", "identifiable")
    )
    if ties:
        table.add_column("tied to", overflow="fold")
    for p in parameters:
        table.add_row(
            p.name,
            p.joint or "",
            _ascii(number(p.start)),
            *interval(p.value, p.std),
            p.unit,
            p.identifiable + (", at bound" if p.at_bound else ""),
            *([", ".join(p.tied_to)] if ties else []),
            style="" if p.identifiable == "yes" else "dim",
        )
    return table


def tied_lines(parameters: Iterable[ParameterEntry]) -> list[str]:
    """Ties between parameters as lines of text, for a narrow terminal."""
    tied = [p for p in parameters if p.tied_to]
    return [f"{p.name}{f':{p.joint}' if p.joint else ''} is tied to {', '.join(p.tied_to)}" for p in tied]


def combination_table(combinations: Iterable[CombinationEntry]) -> Table:
    """Identifiable combinations of inertial parameters."""
    table = plain_table("inertial combination", numbers=("value", "± 95 %"), end=("unit", "identifiable"))
    for c in combinations:
        style = "" if c.identifiable == "yes" else "dim"
        table.add_row(c.name, *interval(c.value, c.std), c.unit, c.identifiable, style=style)
    return table


def residual_table(residual: ResidualEntry) -> Table:
    """Torque error per joint: root mean square on the fitted and the held-out groups, and the noise floor."""
    table = plain_table("joint", numbers=("rms fit [Nm]", "rms validation [Nm]", "noise floor [Nm]"))
    columns = (residual.rms, residual.rms_validation, residual.noise_floor)
    for index, joint in enumerate(residual.joints):
        table.add_row(joint, *(number(None if column is None else column[index]) for column in columns))
    return table


def interval(value: float, std: float | None) -> tuple[str, str]:
    """A value and half its 95 % interval, rounded to the second digit of the interval."""
    shown, half = with_error(value, None if std is None else NORMAL_95 * std)
    shown = _ascii(shown)
    return (shown.lstrip("-") if not shown.strip("-0.") else shown), half


def plain_table(*texts: str, numbers: Sequence[str] = (), end: Sequence[str] = ()) -> Table:
    """An empty table: columns of text, of numbers, and of text again."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    for title in (*texts, *numbers, *end):
        table.add_column(title, justify="right" if title in numbers else "left", no_wrap=True)
    return table


def _ascii(text: str) -> str:
    """Replace the minus sign by a hyphen, so that numbers can be copied into a program."""
    return text.replace("−", "-")
