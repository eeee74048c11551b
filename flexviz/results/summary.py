"""A result as tables and sentences for terminals, notebooks and logs."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike
from rich import box
from rich.console import Console
from rich.table import Table

from flexviz import wording
from flexviz.results.entries import (
    AbsorbedEntry,
    CandidateEntry,
    CombinationEntry,
    ParameterEntry,
    PlaceEntry,
    ResidualEntry,
    ResultFields,
)
from flexviz.wording import escape, number, unit_text, verdict_text

WIDE = 110  # columns from which a table has room for ties between parameters
SHOWN_ABSORBED = 3  # parameters named per added effect


def text(result: ResultFields, width: int) -> str:
    """The whole result, `width` columns wide."""
    console = Console(file=io.StringIO(), width=width, markup=False, highlight=False, emoji=False)
    for part in parts(result, width):
        console.print(part, soft_wrap=isinstance(part, str))
    return console.file.getvalue().rstrip("\n")  # type: ignore[attr-defined]


def html(result: ResultFields) -> str:
    """The whole result for a notebook."""
    out = []
    for part in parts(result, WIDE):
        if isinstance(part, str):
            out.append(f"<div>{escape(part)}</div>")
            continue
        head = "".join(f"<th>{escape(column.header)}</th>" for column in part.columns)
        rows = zip(*(column.cells for column in part.columns), strict=True)
        body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
        out.append(f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>")
    return "".join(out)


def parts(result: ResultFields, width: int) -> list[Table | str]:
    """Tables and lines of text in their order; narrow ones list ties below the table."""
    if result.verdict is not None:
        return list(diagnosis_lines(result))
    wide = width >= WIDE
    out: list[Table | str] = [parameter_table(result.all_parameters, ties=wide)]
    out += [] if wide else tied_lines(result.all_parameters)
    out.append(combination_table(result.base_parameters))
    if result.residual is not None:
        out.append(residual_table(result.residual))
    return out + run_lines(result)


def run_lines(result: ResultFields) -> list[str]:
    """Facts about the run of an identification."""
    lines = [f"{result.set}: {result.message}"]
    if result.observer is not None and result.seconds is not None:
        lines.append(
            f"{result.iterations} iterations in {result.seconds:.2f} s; observer {result.observer.name}, "
            + bandwidth_text(result.observer.bandwidth)
        )
    held_out = f"; validated on {', '.join(result.validation_groups)}" if result.validation_groups else ""
    lines.append(f"fitted on {', '.join(result.groups or ())}{held_out}")
    if result.condition_number is not None:
        lines.append(f"condition number {result.condition_number:.3g}")
    return lines


def bandwidth_text(bandwidth: ArrayLike) -> str:
    """One number or one per joint, in rad/s."""
    return ", ".join(f"{value:.4g}" for value in np.atleast_1d(bandwidth)) + " rad/s"


def diagnosis_lines(result: ResultFields) -> list[str]:
    """Verdict, candidates, steps, notes."""
    out = [verdict_text(result)]
    for rank, candidate in enumerate(result.candidates, 1):
        out.append(f"{rank:3d}. {described(candidate)}")
        for tie in candidate.inseparable_from:
            place = f" on {tie.joint}" if tie.joint else ""
            out.append(f"     not told apart from {tie.effect}{place} (correlation {tie.correlation:.2f})")
            out += [f"     {tie.would_separate}"] if tie.would_separate else []
    for step in result.steps:
        label = "present model" if step.added is None else f"with {effect_text(step.added)}"
        held_out = "" if step.rms_validation is None else f", held out {_numbers(step.rms_validation)} Nm"
        out.append(f"{label}: rms {_numbers(step.rms)} Nm{held_out} → {step.verdict}")
        if step.added is not None and step.added.absorbed:
            moved = "; ".join(map(_moved, step.added.absorbed[:SHOWN_ABSORBED]))
            out.append(f"     previously absorbed by {moved}")
    if result.final_verdict == "unknown" and result.where:
        place = result.where[0]
        low, high = (f"{value:.3g}" if value is not None else "–" for value in place.range)
        out.append(f"what is left on {place.joint} follows {place.variable}, mostly {low} … {high}")
    if result.steps and result.steps[-1].noise_floor:
        out.append(f"noise floor: {_numbers(result.steps[-1].noise_floor)} Nm")
    out += [f"note: {note}" for note in result.notes]
    return [*out, "stopped; this is what was found so far"] if result.stopped else out


def described(candidate: CandidateEntry) -> str:
    """A candidate with its place and values."""
    place = candidate.joint or candidate.payload or "the whole robot"
    group = f" in group {candidate.group}" if candidate.group else ""
    values = ", ".join(
        f"{name} {' ± '.join(interval(v.value, v.std))} {unit_text(v.unit)}".rstrip()
        for name, v in candidate.parameters.items()
    )
    return (
        f"{candidate.effect} on {place}{group}: {values}; explains {100 * candidate.score:.0f} % of the "
        f"held-out excess, confidence {candidate.confidence:.2f}"
    )


def effect_text(added: PlaceEntry) -> str:
    """`coulomb_friction:joint1`, `external_contact:joint1@g2`"""
    place = added.joint or added.payload
    return added.effect + (f":{place}" if place else "") + (f"@{added.group}" if added.group else "")


def _moved(absorbed: AbsorbedEntry) -> str:
    place = f" of {absorbed.joint}" if absorbed.joint else ""
    change = f"{absorbed.before:.4g} → {absorbed.after:.4g} {absorbed.unit}"
    deviations = "" if absorbed.deviations is None else f", {absorbed.deviations:.0f} standard errors"
    return f"{absorbed.name.replace('_', ' ')}{place} ({change}{deviations})"


def _numbers(values: Sequence[float]) -> str:
    return " ".join(f"{value:.4g}" for value in values)


# -- tables --------------------------------------------------------------------------------------------------


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
    shown, half = wording.interval(value, std)
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
