"""The falling staircase: the error of each group after every added effect, with the noise floor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexviz.charts import COLOURS, Line, Plot, no_plot
from flexviz.session import ModelStep
from flexviz.view.status import total_rms
from flexviz.wording import effect_text_name, escape, number

if TYPE_CHECKING:
    from flexviz.diagnosis import Step

Array = NDArray[np.float64]

EMPTY = (
    "The error of every group after each added effect appears here, with the noise floor: "
    "press Find the missing effect (step 4, Diagnose), then Add and refit."
)
BAND = "rms residual in the band that the diagnosis compares models in, the same for every model"
HELD_OUT = "validation"
LINES = 10  # groups drawn at most
FLOOR = 1e-6  # [Nm] least value of a logarithmic axis


def curves(steps: Sequence[Step], joint: int | None) -> dict[str, tuple[list[float], bool]]:
    """Name -> (error [Nm] at each step, held out?) of every group; fit and validation where groups lack.

    `joint` None: root of the mean square over the joints.
    """

    def value(row: Sequence[float]) -> float:
        values = np.asarray(row, dtype=float)
        return total_rms(values) if joint is None else float(values[joint])

    if all(step.groups for step in steps):
        names = [(name, held_out) for name, _, held_out in steps[-1].groups]
        found: dict[str, tuple[list[float], bool]] = {}
        for name, held_out in names[:LINES]:
            rows = [next((row for other, row, _ in step.groups if other == name), None) for step in steps]
            if all(row is not None for row in rows):
                found[name] = [value(row) for row in rows if row is not None], held_out
        return found
    found = {"fit": ([value(step.rms) for step in steps], False)}
    if all(step.rms_validation is not None for step in steps):
        found[HELD_OUT] = [value(step.rms_validation or ()) for step in steps], True
    return found


def staircase_plots(model_steps: Sequence[ModelStep], joint: int, name: str) -> tuple[Plot, ...]:
    """All joints together, and the selected joint."""
    if not model_steps:
        return no_plot("all", EMPTY), no_plot("joint", "")
    steps = [stair.step for stair in model_steps]
    plots = [_plot("all", "Error after each added effect, all joints [Nm]", steps, None)]
    if len(steps[0].rms) > 1:
        plots.append(_plot("joint", f"The same of {name} [Nm]", steps, joint))
    return tuple(plots)


def _plot(key: str, title: str, steps: Sequence[Step], joint: int | None) -> Plot:
    lines = [
        Line(
            f"{group} (validation)" if held_out and group != HELD_OUT else group,
            COLOURS.series[place % (len(COLOURS.series) - 1)],
            stepped(np.maximum(values, FLOOR)),
            2.6 if held_out else 1.6,
            dashed=held_out,
            points=len(steps) == 1,
        )
        for place, (group, (values, held_out)) in enumerate(curves(steps, joint).items())
    ]
    floors = [step.noise_floor for step in steps]
    if all(len(floor) for floor in floors):
        low = [total_rms(np.asarray(f)) if joint is None else float(np.asarray(f)[joint]) for f in floors]
        if np.isfinite(low).all():
            lines.append(Line("noise floor", COLOURS.reference, stepped(np.maximum(low, FLOOR)), 1.6))
    x = treads(len(steps))
    return Plot(
        key, title, x, tuple(lines), "effects added", logarithmic=True, height=230,
        span=(float(x[0]), float(x[-1])), whole_x=True,
    )  # fmt: skip


def treads(count: int) -> Array:
    """x of the steps' corners: each tread reaches half a step to both sides of its number."""
    return np.repeat(np.arange(count + 1, dtype=float) - 0.5, 2)[1:-1]


def stepped(values: Sequence[float] | Array) -> Array:
    """The values at the corners of the treads."""
    return np.repeat(np.asarray(values, dtype=float), 2)


def staircase_html(model_steps: Sequence[ModelStep]) -> str:
    """The steps in words and numbers."""
    if not model_steps:
        return ""
    rows = []
    before: set[str] = set()
    for count, stair in enumerate(model_steps):
        added = [effect_text_name(name) for name in stair.effects if name not in before]
        before |= set(stair.effects)
        what = ", ".join(added) if added else "the model as it is"
        held_out = stair.step.rms_validation
        rows.append(
            f"<tr><td>{count}. {'+ ' if added and count else ''}{escape(what)}</td>"
            f"<td>{number(total_rms(np.asarray(stair.step.rms)), 3)}</td>"
            f"<td>{'–' if held_out is None else number(total_rms(np.asarray(held_out)), 3)}</td></tr>"
        )
    return (
        '<div class="fv"><table class="fv-table"><tr><th>Error [Nm]</th><th>fit</th><th>validation</th></tr>'
        f'{"".join(rows)}</table><div class="fv-dim">{BAND}.</div></div>'
    )
