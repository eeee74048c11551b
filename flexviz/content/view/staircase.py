"""The error after each added effect, as chart and table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.analysis.diagnosis import BAND_HERTZ, PredictionErrors, Step
from flexviz.content import wording
from flexviz.content.charts import Chart, no_chart
from flexviz.content.records import FOLLOWING, JointErrors, ParameterEstimate, percent_of, stated_errors
from flexviz.content.results import staircase_chart
from flexviz.content.session import Analysis, ModelStep
from flexviz.content.wording import error_hover, error_short
from flexviz.model.effects import free_curve

NO_STEPS = (
    "The error of every group after each added effect appears here, with the noise of the recording: "
    "press Find the missing effect (step 4, Diagnose), then Add and refit."
)
COMPARED_IN = f"Error: rms residual below {BAND_HERTZ:g} Hz, the same measure for every model and observer"
COMPARED_FREE = "Error: rms of simulated minus measured angle, from the goals alone, without a restart"
KEY = (
    '<div class="fv-stair-key"><span class="fit"></span> fit <span class="held"></span> validation '
    "┊ noise</div>"
)
RISE = 1.01  # times the error before, from which a row is said to rise


@dataclass(frozen=True, eq=False)
class StaircaseRun:
    """A *Run* in the staircase: name, errors, the model after which it was made, whether it is shown."""

    name: str
    errors: PredictionErrors
    after: int  # -1: before every diagnosis
    shown: bool


def staircase_charts(
    model_steps: Sequence[ModelStep], joint: int, joints: Sequence[str], spread: Sequence[float] = ()
) -> tuple[Chart, ...]:
    """The error over all joints, and of the selected joint; neighbouring effects of one kind are one step."""
    if not model_steps:
        return no_chart("all", NO_STEPS), no_chart("joint")
    runs = model_runs(model_steps, joints)
    steps = [model_steps[last].step for _, _, last in runs]
    hatched = [k for k, (_, texts, _) in enumerate(runs) if any(map(is_stopgap, texts))]
    charts = [staircase_chart(steps, spread=spread, hatched=hatched)]
    if len(steps[0].rms) > 1:
        charts.append(staircase_chart(steps, joint, joints[joint], spread=spread, hatched=hatched))
    return tuple(charts)


def model_runs(model_steps: Sequence[ModelStep], joints: Sequence[str]) -> list[tuple[str, list[str], int]]:
    """Name, texts of the added effects and last model of each run of effects of one kind."""
    added, before = [], set(model_steps[0].effects)
    for one in model_steps:
        added.append([text for text in one.effects if text not in before])
        before |= set(one.effects)
    return wording.text_runs(added, joints, dict(pair for one in model_steps for pair in one.families))


def model_name(
    model_steps: Sequence[ModelStep], joints: Sequence[str], index: int, spread: Sequence[float] = ()
) -> str:
    """ "model 1 (1.02 %)": its number in the staircase, and its error over all joints, held out if known."""
    ends = [last for _, _, last in model_runs(model_steps, joints)]
    found = next((count for count, last in enumerate(ends) if last >= index), index)
    return name_with_error(f"model {found}", model_steps[index].step, spread)


def name_with_error(name: str, errors: Step | PredictionErrors | None, spread: Sequence[float] = ()) -> str:
    """A name with the error over all joints, held out if known, as far as there are `errors`."""
    if errors is None:
        return name
    return f"{name} ({error_short(stated_errors(errors, spread))})"


def is_stopgap(text: str) -> bool:
    """Whether an effect, by its text, is a free curve."""
    return free_curve(text) is not None


def staircase_html(
    model_steps: Sequence[ModelStep],
    joints: Sequence[str],
    spread: Sequence[float] = (),
    parameters: Sequence[ParameterEstimate] = (),
    shown: int = -1,
    runs: Sequence[StaircaseRun] = (),
) -> str:
    """The errors of the steps as bars and numbers; effects of one kind unfold to their values per joint.

    Args:
        model_steps: the models.
        joints: of the robot.
        spread: of each joint's torque, shape (n,) [Nm].
        parameters: of the model that is shown.
        shown: the model that the rest of the page shows, if it shows none of the runs.
        runs: fits that are no model of the staircase.
    """
    if not (model_steps or runs):
        return ""
    judged = [one.step for one in model_steps] + [run.errors for run in runs]
    top = max(one.mean for step in judged for one in _judged(step, spread))
    table = _Rows(spread, top)
    table.add_runs([run for run in runs if run.after < 0])
    placed = 0  # models whose runs are in the table
    for count, (name, texts, last) in enumerate(model_runs(model_steps, joints) if model_steps else ()):
        own = [wording.effect_text_name(text) for text in model_steps[0].effects]
        what = f"+ {name}" if texts else ", ".join(own) or "no effect added"
        found = "".join(f"<div>{wording.escape(text)}</div>" for text in effect_values(texts, parameters))
        label = f"{count}. {wording.escape(what)}"
        if last == shown and not any(run.shown for run in runs):
            label = f"<b>{label}</b> ● shown"
        stopgap = any(map(is_stopgap, texts))
        if stopgap:
            label = f'<span class="fv-hatched">{label}</span>'
        if found:
            label = f"<details><summary>{label}</summary>{found}</details>"
        table.add(label, model_steps[last].step, stopgap)
        table.add_runs([run for run in runs if placed <= run.after <= last])
        placed = last + 1
    table.add_runs([run for run in runs if run.after >= placed])
    rows = table.rows
    last_step = next((run.errors for run in runs if run.shown), judged[len(model_steps) - 1])
    stated = stated_errors(last_step, spread)
    if stated.mark is not None:
        floor = _error_cell(stated.mark)
        rows.append(f"<tr><td>noise</td>{floor}{floor}</tr>")
    left = f"Largest: {wording.left_text(joints, stated)}. " if spread else ""
    return (
        f'<div class="fv"><table class="fv-table"><tr><th>Error [{stated.unit}]</th><th>fit</th>'
        f'<th>validation</th></tr>{"".join(rows)}</table><div class="fv-dim">{KEY}{wording.escape(left)}'
        f"{COMPARED_FREE if stated.unit == FOLLOWING else COMPARED_IN}.</div></div>"
    )


class _Rows:
    """The rows of the table so far; one whose error rises against the row before says so."""

    def __init__(self, spread: Sequence[float], top: float) -> None:
        self._spread, self._top, self._before = spread, top, math.inf
        self.rows: list[str] = []

    def add(self, label: str, step: Step | PredictionErrors, hatched: bool = False) -> None:
        found = _judged(step, self._spread)
        error = found[-1].mean
        rises, self._before = error > RISE * self._before, error
        mark = ' <span class="fv-rises">▲ rises</span>' if rises else ""
        cells = "".join(_error_cell(one) for one in (*found, None)[:2])
        bars = _bars(step, self._spread, self._top, hatched)
        self.rows += [f"<tr><td>{label}{mark}</td>{cells}</tr>", f'<tr><td colspan="3">{bars}</td></tr>']

    def add_runs(self, runs: Sequence[StaircaseRun]) -> None:
        for run in runs:
            name = wording.escape(run.name)
            self.add(f"<b>{name}</b> ● shown" if run.shown else name, run.errors)


def run_name(analysis: Analysis, joints: Sequence[str], roles: object = None) -> str:
    """ "Run with Torque offset on joint1: eso, 80 rad/s"; `roles` are those of the present analysis."""
    result, fitted = analysis.identification, analysis.fitted
    if result is None or fitted is None:
        return ""
    width = wording.listed([f"{w:.3g}" for w in dict.fromkeys(np.ravel(result.bandwidth).tolist())])
    added = ", ".join(wording.text_names(fitted.effects, joints))
    run, goals = f"Run{f' with {added}' if added else ''}", percent_of(result.residual.units) == FOLLOWING
    return (
        (run if goals else f"{run}: {result.observer_name}, {width} rad/s")
        + ("" if result.refined or not result.iterations else ", plain fit")
        + (", other groups" if roles not in (None, fitted.roles) else "")
    )


def _judged(step: Step | PredictionErrors, spread: Sequence[float]) -> list[JointErrors]:
    """Errors of the fitted and of the validation groups, as far as they are known."""
    rows = (row for row in (step.rms, step.rms_validation) if row)
    return [JointErrors(row, spread, step.noise_floor, step.units) for row in rows]


def _bars(step: Step | PredictionErrors, spread: Sequence[float], top: float, hatched: bool) -> str:
    """Bars from zero: fit above held out; the dotted line is the noise; of a free curve hatched."""
    mark = stated_errors(step, spread).mark
    floor = math.nan if mark is None else mark.mean
    line = f'<i style="left:{100 * floor / top:.2f}%"></i>' if floor <= top else ""
    bars = "".join(
        f'<span class="{kind}" style="width:{100 * one.mean / top:.2f}%"></span>'
        for kind, one in zip(("fit", "held"), _judged(step, spread), strict=False)
    )
    look = 'class="fv-stair hatched" title="a free curve: not physics"' if hatched else 'class="fv-stair"'
    return f"<div {look}>{bars}{line}</div>"


def _error_cell(errors: JointErrors | None) -> str:
    if errors is None:
        return "<td>–</td>"
    return f'<td title="{error_hover(errors)}">{wording.number(errors.mean, 3)}</td>'


def effect_values(texts: Sequence[str], parameters: Sequence[ParameterEstimate]) -> list[str]:
    """ "joint2: coulomb 3.000 ± 0.012 Nm" of each effect that the parameters know."""
    out = []
    for text in texts:
        effect, _, place = text.partition(":")
        values, own = [], []
        for p in parameters:
            of, dot, name = p.name.partition(".")
            if dot and of == effect and place and place in (p.joint, p.payload):
                values.append(f"{wording.plain_name(name)} {wording.estimate_words(p)}")
                own.append(p)
        values = [wording.curve_text(own)] if own and free_curve(effect) is not None else values
        out += [f"{place}: {', '.join(values)}"] if values else []
    return out
