"""What to do next: one step, one button, one sentence."""

from __future__ import annotations

from dataclasses import dataclass

from flexviz.session import Analysis


@dataclass(frozen=True)
class Next:
    """The next thing to do.

    Attributes
    ----------
    step: the step it is done in.
    button: the button that does it; empty where there is none.
    text: a sentence for the step line (HTML).
    """

    step: str
    button: str
    text: str


def next_step(analysis: Analysis, current: str, running: bool) -> Next:
    """What a person who does not know the program should do now."""
    if running:
        return Next(current, "", "Working: <b>Stop</b> ends it early.")
    if not analysis.groups_with("fit"):
        return Next("Data", "", "Next: set a group to <b>Fit</b> in step Data.")
    if not analysis.diagnosis_up_to_date:
        where = "press" if current == "Diagnose" else "step Diagnose, then"
        return Next("Diagnose", "find", f"Next: {where} <b>Find the missing effect</b>.")
    diagnosis = analysis.diagnosis
    if diagnosis is not None and diagnosis.verdict == "missing" and diagnosis.findings:
        where = "press" if current == "Diagnose" else "step Diagnose, then"
        return Next("Diagnose", "add", f"Next: {where} <b>Add and refit</b> and watch the error fall.")
    if len(analysis.model_steps) > 1:
        return Next("", "", "Done: the tab <b>Compare</b> shows how the error fell.")
    return Next("", "", "Done: the tab <b>Where it fails</b> shows what is left.")


def steps_done(analysis: Analysis) -> tuple[str, ...]:
    """The steps behind one."""
    done = ("Data", "Observer", "Identify") if analysis.identification is not None else ()
    return (*done, "Diagnose") if analysis.diagnosis is not None else done
