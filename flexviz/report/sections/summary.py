"""Verdict, warnings and key figures."""

from __future__ import annotations

from collections.abc import Sequence

from flexviz.diagnosis import Step
from flexviz.report.blocks import Callout, Section, Tile, Tiles, Tone, explanation, section
from flexviz.report.content import ReportContent
from flexviz.view import total_rms
from flexviz.wording import INERTIAL, effect_text_name, number, plural, verdict_text

TONES: dict[str, Tone] = {"missing": "missing", "nothing-missing": "good", "unknown": "unknown"}


def summary(content: ReportContent) -> Section:
    """Verdict, warnings and key figures."""
    diagnosis = content.diagnosis
    verdict = Callout("Not diagnosed yet: the model may be incomplete.", "unknown")
    if diagnosis is not None:
        verdict = Callout(sentence(content), TONES.get(diagnosis.verdict, "unknown"))
    notes = () if diagnosis is None else diagnosis.notes
    return section(
        "Summary",
        verdict,
        *(Callout(warning, "warn") for warning in warnings(content)),
        Tiles(numbers(content)),
        *(explanation(_sentence(note.text, content.joints)) for note in notes),
    )


def sentence(content: ReportContent) -> str:
    """The verdict, with the added effects and the fall of the error."""
    if content.diagnosis is None:
        return "Not diagnosed."
    names = [effect_text_name(name) for name, _ in content.added]
    words = verdict_text(content.diagnosis, names)
    return f"{words} {fall(content.steps)}".strip() if names else words


def fall(steps: Sequence[Step]) -> str:
    """How far the error fell, as a sentence."""
    if len(steps) < 2:
        return ""
    first, last = error_of(steps[0]), error_of(steps[-1])
    what = "error on held-out groups" if steps[0].rms_validation is not None else "error"
    times = f", {number(first / last, 2)} times less" if last > 0 and first > last else ""
    return f"The {what} went from {number(first, 3)} to {number(last, 3)} Nm{times}."


def error_of(step: Step) -> float:
    """Rms error of the held-out groups, else of the fitted ones, over all joints [Nm]."""
    return total_rms(step.rms if step.rms_validation is None else step.rms_validation)


def numbers(content: ReportContent) -> list[Tile]:
    """Error, noise floor, effects, parameters."""
    tiles: list[Tile] = []
    steps = content.steps
    if steps:
        held_out = steps[-1].rms_validation is not None
        shown = [number(error_of(step), 3) for step in (steps[0], steps[-1])[-len(steps) :]]
        note = "rms torque, all joints" + ("; groups that were not fitted" if held_out else "")
        tiles.append(Tile("Error", f"{' → '.join(shown)} Nm", note))
        if steps[-1].noise_floor:
            floor = number(total_rms(steps[-1].noise_floor), 3)
            tiles.append(Tile("Noise floor", f"{floor} Nm", "expected from measurement noise alone"))
    elif content.identification is not None:
        found = content.identification.residual
        values = found.rms if found.rms_validation is None else found.rms_validation
        note = "fitted groups" if found.rms_validation is None else "groups that were not fitted"
        tiles.append(Tile("Error", f"{number(total_rms(values), 3)} Nm", f"rms torque; {note}"))
    own = len(content.measurements.effects)
    beside = f"beside {plural(own, 'effect')} of the set" if own else ""
    tiles.append(Tile("Effects added", str(len(content.analysis.effects)), beside))
    main = [p for p in content.parameters if p.name not in INERTIAL]
    if main:
        good = sum(p.identifiable == "yes" for p in main)
        what = "parameters of joints and effects, without inertias"
        tiles.append(Tile("Identifiable", f"{good} of {len(main)}", what))
    return tiles


def warnings(content: ReportContent) -> list[str]:
    """Warnings about the validity of the results."""
    out = []
    analysis = content.analysis
    if content.changed:
        out.append(
            f"The data have changed since: {', '.join(content.changed)}. All results here are of the older "
            "data."
        )
    elif analysis.diagnosis is not None and content.diagnosis is None:
        out.append("Model or groups have changed since the last diagnosis, which is not shown.")
    if analysis.identification is not None and content.identification is None:
        out.append("The settings have changed since the last identification, which is not shown.")
    if content.diagnosis is not None and content.diagnosis.stopped:
        out.append("The diagnosis was stopped early: these are the findings so far.")
    found = content.identification
    if found is not None and not found.converged:
        out.append(f"The identification did not converge: {found.message}")
    if not content.changed:
        out += [_sentence(warning, (warning,)) for warning in content.measurements.warnings]
    return out


def _sentence(note: str, names: tuple[str, ...] = ()) -> str:
    """A note as a sentence; names keep their first letter."""
    note = note.strip()
    begins = note if note.startswith(names or "\0") else note[:1].upper() + note[1:]
    return begins + ("" if note.endswith((".", "!", "?")) else ".")
