"""Verdict, warnings and key figures."""

from __future__ import annotations

from collections.abc import Sequence

from flexviz.analysis.diagnosis import Step
from flexviz.content import wording
from flexviz.content.records import JointErrors, mean_nrms, stated_errors
from flexviz.content.results import hints
from flexviz.content.wording import error_in_torque, error_short, error_whole
from flexviz.model.effects import free_curve
from flexviz.outlets.report.blocks import Callout, Section, Tile, Tiles, Tone, explanation, section
from flexviz.outlets.report.content import ReportContent
from flexviz.robot.model import INERTIAL_NAMES

TONES: dict[str, Tone] = {"missing": "missing", "nothing-missing": "good", "unknown": "unknown"}


def summary(content: ReportContent) -> Section:
    """Verdict, warnings and key figures."""
    diagnosis = content.diagnosis
    verdict, notes = Callout("Not diagnosed yet: the model may be incomplete.", "unknown"), []
    if diagnosis is not None:
        said = sentence(content)
        verdict = Callout(said, TONES.get(diagnosis.verdict, "unknown"))
        told = (note for note in diagnosis.notes if note.kind not in wording.SAID_AS_SHARES)
        notes = [note.text for note in told if note.text not in said]
    if diagnosis is not None and diagnosis.verdict == "unknown" and content.steps:
        notes.insert(0, wording.what_stays(content.joints, content.steps[-1], content.spread)[1])
    return section(
        "Summary",
        verdict,
        *(Callout(warning, "warn") for warning in warnings(content)),
        Tiles(numbers(content)),
        *([explanation(" ".join(_sentence(note, content.joints) for note in notes))] if notes else []),
    )


def sentence(content: ReportContent) -> str:
    """The verdict, with the added effects and the fall of the error."""
    if content.diagnosis is None:
        return "Not diagnosed."
    joints, last = content.joints, content.steps[-1] if content.steps else None
    worst, _ = wording.what_stays(joints, last, content.spread)
    added = [name for name, _ in content.added]
    names = added_names(content)
    curved = list(dict.fromkeys(name.partition(":")[2] for name in added if free_curve(name) is not None))
    words = [wording.verdict_text(content.diagnosis, names, joints=joints, worst=worst)]
    if curved:
        words.append(
            f"A free curve on {wording.listed(curved)}, which is not physics, stands for what is unknown."
        )
    return " ".join((*words, fall(content.steps, content.spread))).strip() if added else words[0]


def added_names(content: ReportContent) -> list[str]:
    """The added effects with their shares of the error, the largest first; those of one kind together."""
    texts = [name for name, _ in content.added if free_curve(name) is None]
    kinds = wording.merged_texts(texts, content.joints, content.families)
    kinds.sort(key=lambda kind: -(content.share_of(kind) or 0.0))
    out = []
    for kind in kinds:
        share = content.share_of(kind)
        (name,) = wording.text_names(kind, content.joints, content.families)
        untold = f" ({wording.UNTOLD})" if kind[0] in content.families else ""
        removed = "" if share is None else f": {wording.share_text(share)} of the error"
        out.append(name + untold + removed)
    return out


def fall(steps: Sequence[Step], spread: Sequence[float]) -> str:
    """How far the error fell, as a sentence."""
    if len(steps) < 2:
        return ""
    what = "error on held-out groups" if steps[0].rms_validation else "error"
    before, after = (error_whole(stated_errors(step, spread)) for step in (steps[0], steps[-1]))
    return f"The {what} went from {before} to {after}."


def numbers(content: ReportContent) -> list[Tile]:
    """Error, noise, effects, parameters."""
    tiles: list[Tile] = []
    found = content.steps or content.identified
    ends = (found[0], found[-1])[-len(found) :] if found else ()
    errors = [stated_errors(one, content.spread) for one in ends]
    floor = found[-1].noise_floor if found else ()
    if errors:
        held_out = bool(found[-1].rms_validation)
        shown = " → ".join(error_short(one) for one in errors)
        rest = " → ".join(error_in_torque(one) for one in errors)
        groups = "groups that were not fitted" if held_out else "fitted groups"
        tiles.append(Tile("Error", shown, f"{errors[-1].unit}, mean of the joints; {groups}; {rest}"))
    if floor:
        torque = error_in_torque(JointErrors(floor, (), (), found[-1].units))
        note = f"rms of the joints {torque}, of the sensors alone: the same for all models"
        tiles.append(Tile("Noise", wording.percent(mean_nrms(floor, content.spread)), note))
    own = len(content.measurements.effects)
    beside = f"in addition to {wording.plural(own, 'effect')} of the set" if own else ""
    effects = [text for text in content.analysis.effects if free_curve(text) is None]
    tiles.append(Tile("Effects added", str(len(effects)), beside))
    main = [p for p in content.parameters if p.name not in INERTIAL_NAMES]
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
        out.append("Model, observer or groups have changed since the last diagnosis, which is not shown.")
    if analysis.identification is not None and content.identification is None:
        out.append("The settings have changed since the last identification, which is not shown.")
    if content.diagnosis is not None and content.diagnosis.stopped:
        out.append("The diagnosis was stopped early: these are the findings so far.")
    found = content.identification
    if found is not None and not found.converged:
        out.append(f"The identification did not converge: {found.message}")
    out += hints(content.parameters)
    if not content.changed:
        result = content.identification or content.diagnosis
        entries = result.recording if result is not None else ()
        known = {"contradiction"} if entries else set()
        other = [str(fact) for fact in content.measurements.warnings if fact.kind not in known]
        told = dict.fromkeys((*(entry.message for entry in entries), *other))
        out += [_sentence(warning, (warning,)) for warning in told]
    return out


def _sentence(note: str, names: tuple[str, ...] = ()) -> str:
    """A note as a sentence; names keep their first letter."""
    note = note.strip()
    begins = note if note.startswith(names or "\0") else note[:1].upper() + note[1:]
    return begins + ("" if note.endswith((".", "!", "?")) else ".")
