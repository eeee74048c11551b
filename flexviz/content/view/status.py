"""Step line, status line, suggested next step, and scene legend."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from flexviz.analysis.diagnosis import PredictionErrors
from flexviz.analysis.diagnosis import Step as DiagnosisStep
from flexviz.analysis.identification import Identification
from flexviz.content import wording
from flexviz.content.records import stated_errors
from flexviz.content.session import Analysis, standing
from flexviz.content.view.link_colours import LEAST_END
from flexviz.content.wording import error_hover, error_in_torque, error_short, escape, number

LEFT = "Where it fails</b> shows what is left"
OF_EARLIER = "of an earlier model"


def step_line_html(steps: tuple[str, ...], current: str, done: tuple[str, ...] = ()) -> str:
    """1 Data → 2 Observer → …, with current and completed steps marked."""
    parts = []
    for number_, name in enumerate(steps, start=1):
        if name == current:
            parts.append(f'<span class="fv-now">{number_} {name} ●</span>')
        else:
            parts.append(f"<span>{number_} {name}{' ✓' if name in done else ''}</span>")
    return f'<div class="fv fv-steps">{" → ".join(parts)}</div>'


def shown_errors(
    analysis: Analysis, judged: PredictionErrors | None
) -> PredictionErrors | DiagnosisStep | None:
    """The error of the present model that every page states; `judged` is that of its fit."""
    diagnosis = analysis.current_diagnosis
    if diagnosis is None or standing(analysis).errors != "verdict":
        return judged
    return diagnosis.steps[-1]


def worst_joint(result: Identification | None) -> int:
    """The joint with the largest error; the first one without a result."""
    return 0 if result is None else stated_errors(result.residual, result.residual.torque_spread).order[0]


def stated_error(
    result: Identification | None,
    errors: PredictionErrors | DiagnosisStep | None,
    failed: bool = False,
    earlier: bool = False,
) -> tuple[str, str]:
    """The error of the validation groups, else of the fitted ones, with the largest; what hover tells of it.

    `failed`: it cannot be known; `earlier`: the settings have changed since.
    """
    if result is None:
        return "no model yet", ""
    if errors is None:
        return "the error of the model cannot be computed" if failed else "computing the error", ""
    found = stated_errors(errors, result.residual.torque_spread)
    if not found.rms or not all(map(math.isfinite, found.rms)):
        return "the model has no error to show", ""
    text = f"{'fit' if found.rms is errors.rms else 'validation'} error {wording.error_text(found)}"
    if len(found.rms) > 1:
        most = found.order[0]
        text += f", most on {result.residual.joints[most]}: {error_short(found, most)}"
    return f"{text}, {OF_EARLIER}" if earlier else text, error_hover(found)


def error_text(
    result: Identification | None, errors: PredictionErrors | DiagnosisStep | None, earlier: bool = False
) -> str:
    """`stated_error` in one line, for a terminal."""
    text, rest = stated_error(result, errors, earlier=earlier)
    return f"{text} ({rest})" if rest else text


def status_html(step: str, message: str, error: str, tone: str = "", hover: str = "") -> str:
    """The status line: step, message, error and its `hover`; `tone` is "", "busy", "warn" or "bad"."""
    parts = [_unbroken(escape(part)) for part in (f"Step {step}", message) if part]
    if error:
        tip = f' title="{escape(hover)}" class="fv-tip"' if hover else ""
        parts.append(f"<b{tip}>{counted(_unbroken(escape(error)), 'error')}</b>")
    return f'<div class="fv fv-status {tone}">{"&nbsp;· ".join(parts)}</div>'


def _unbroken(text: str) -> str:
    """Numbers stay on one line with their units."""
    return re.sub(r"\(?\d[\d.]* (?:s|m?Nm|%)(?!\w)\)?", r"<span>\g<0></span>", text)


def counted(text: str, name: str) -> str:
    """A text (HTML) whose first number counts down on the page when an effect is added (`fall.js`)."""
    return re.sub(r"\d[\d.]*", rf'<span data-fv-count="{name}">\g<0></span>', text, count=1)


def wrong_html(
    analysis: Analysis,
    errors: PredictionErrors | DiagnosisStep | None,
    joints: Sequence[str],
    spread: Sequence[float],
) -> str:
    """How wrong a fitted model is before anyone has looked why; "" if it is near the noise or unknown."""
    now = standing(analysis)
    if errors is None or now.fit != "present" or now.verdict != "none":
        return ""
    found = stated_errors(errors, spread)
    worst = found.order[0]
    if found.noise and found.rms[worst] < LEAST_END * found.noise[worst]:
        return ""
    share = found.shares[worst]
    error = f"{number(share, 2)} %" if math.isfinite(share) else error_in_torque(found, worst)
    return (
        f'<div class="fv fv-wrong" title="rms residual, {found.percent} of that joint">This arm\'s model is '
        f"wrong by {error} on {escape(joints[worst])}. Find out why.</div>"
    )


@dataclass(frozen=True)
class NextStep:
    """Suggested next step."""

    step: str  # of the app; may be empty
    button: str  # to press; may be empty
    text: str  # sentence for below the status line (HTML); may be empty


def next_step(analysis: Analysis, current: str, running: bool) -> NextStep:
    """The next step to suggest, from what the results belong to."""
    now, diagnosis = standing(analysis), analysis.current_diagnosis

    def go(step: str, button: str, what: str, why: str = "") -> NextStep:
        where = "press" if current == step else f"step {step}, then"
        return NextStep(step, button, f"Next: {where} <b>{what}</b>{why}.")

    if running:
        return NextStep(current, "", "Working: <b>Stop</b> ends it early.")
    if not analysis.groups_with("fit"):
        return NextStep("Data", "", "Next: set a group to <b>Fit</b> in step Data.")
    if now.fit == "present" and now.bounds and now.errors == "fit":
        return NextStep("Observer", "", "Next: values are at their bounds; try another bandwidth.")
    if now.fit == "earlier":
        return go("Identify", "run", "Run", ": the settings have changed since this model")
    if now.verdict == "earlier":
        return go("Diagnose", "find", "Find the missing effect", ": the verdict is of an earlier model")
    if diagnosis is None and current == "Diagnose":
        return NextStep(current, "find", "")  # the step itself says so, at the button
    if diagnosis is None:
        return go("Diagnose", "find", "Find the missing effect")
    if diagnosis.verdict == "missing" and diagnosis.findings:
        return go("Diagnose", "add", "Add and refit", " and watch the error fall")
    seen = "Compare</b> shows how the error fell" if len(analysis.model_steps) > 1 else LEFT
    take = "<b>Export model</b>" if current == "Data" else "step Data, then <b>Export model</b>,"
    return NextStep("Data", "export", f"Done: the tab <b>{seen}; {take} takes the model along.")


def steps_done(analysis: Analysis) -> tuple[str, ...]:
    """The completed steps; one whose result is of an earlier model is to be done again."""
    now = standing(analysis)
    done = ("Data", "Observer") if now.fit != "none" else ()
    done = (*done, "Identify") if now.fit == "present" else done
    return (*done, "Diagnose") if now.verdict == "present" else done
