"""An identification as readable tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.table import Table

if TYPE_CHECKING:
    import numpy as np

    from flexviz.identification import Identification, ParameterEstimate, ResidualSummary

TWO_SIDED_95 = 1.96  # standard errors in half a 95 % interval


def parameter_table(parameters: Iterable[ParameterEstimate]) -> Table:
    """Name, joint, start, value ± 95 %, unit, whether the data determine it and what it is tied to."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("parameter", no_wrap=True)
    table.add_column("joint")
    for title in ("start", "value", "± 95 %"):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    table.add_column("identifiable")
    table.add_column("tied to", overflow="fold")
    for p in parameters:
        half = TWO_SIDED_95 * p.std if p.std is not None else math.nan
        table.add_row(
            p.name,
            p.joint or "",
            number(p.start),
            number(p.value, half),
            number(half, half),
            p.unit,
            p.identifiable + (", at bound" if p.at_bound else ""),
            ", ".join(p.tied_to),
            style="" if p.identifiable == "yes" else "dim",
        )
    return table


def residual_table(residual: ResidualSummary) -> Table:
    """Torque error per joint: root mean square on the fitted and the held-out groups, and the noise floor."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("joint")
    for title in ("rms fit [Nm]", "rms validation [Nm]", "noise floor [Nm]"):
        table.add_column(title, justify="right", no_wrap=True)
    columns = (residual.rms, residual.rms_validation, residual.noise_floor)
    for index, joint in enumerate(residual.joints):
        table.add_row(joint, *(number(None if c is None else c[index]) for c in columns))
    return table


def summary(result: Identification) -> list[str]:
    """The run in a few lines of text."""
    state = "stopped" if result.stopped else "converged" if result.converged else "did not converge"
    lines = [
        f"{result.set_name}: {state} after {len(result.iterations)} iterations in {result.seconds:.2f} s",
        f"observer {result.observer_name}, {bandwidth_text(result.bandwidth)}",
        f"fitted on {', '.join(result.groups)}"
        + (f"; validated on {', '.join(result.validation_groups)}" if result.validation_groups else ""),
    ]
    if result.condition_number is not None and math.isfinite(result.condition_number):
        lines.append(f"condition number {result.condition_number:.3g}")
    if result.message:
        lines.append(str(result.message))
    return lines


def bandwidth_text(bandwidth: float | Sequence[float] | np.ndarray) -> str:
    """One number or one a joint, in rad/s."""
    values = [bandwidth] if isinstance(bandwidth, int | float) else list(bandwidth)
    return ", ".join(f"{float(value):.4g}" for value in values) + " rad/s"


def number(value: float | None, half_width: float | None = None) -> str:
    """A number for a table; with a half width, to the digit where that has its second one.

    >>> number(1000.2345, 0.8123), number(0.8123, 0.8123), number(3.0), number(float("nan"))
    ('1000.23', '0.81', '3', '–')
    """
    if value is None or not math.isfinite(value):
        return "–"
    if half_width is None or not math.isfinite(half_width) or half_width <= 0.0:
        return f"{value:.6g}"
    decimals = 1 - math.floor(math.log10(half_width))
    largest = max(abs(value), half_width)
    if largest >= 1e7 or decimals > 9:
        return f"{value:.4g}"
    return f"{round(value, decimals):.{max(decimals, 0)}f}"
