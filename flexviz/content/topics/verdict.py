"""The verdict with its warnings, notes and key figures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from flexviz.analysis.diagnosis import Diagnosis, Step
from flexviz.content import wording
from flexviz.content.blocks import Block, Callout, Section, Tile, Tiles, Tone, explanation, section, warning
from flexviz.content.records import JointErrors, mean_nrms, stated_errors
from flexviz.content.results import ResultDocument, hints
from flexviz.content.topics.story import Story
from flexviz.content.topics.topic import Topic, register
from flexviz.content.wording import error_in_torque, error_short, error_whole
from flexviz.model.effects import free_curve
from flexviz.robot.model import INERTIAL_NAMES

TONES: dict[str | None, Tone] = {"missing": "missing", "nothing-missing": "good", "unknown": "unknown"}
STOPPED = "Stopped before the end: these are the findings so far."
NOT_YET = "Fits the model and tries every known effect on what it leaves unexplained."
EARLIER = "of an earlier model · look again: press Find the missing effect"


class Verdict(Topic):
    """Whether the model is complete, or what it lacks."""

    name = "summary"
    title = "Summary"

    def blocks(self, result: ResultDocument) -> Iterator[Block]:
        if result.verdict is not None:
            yield verdict(result, joints_of(result))

    def section(self, story: Story) -> Section:
        found, said = Callout("Not diagnosed yet: the model may be incomplete.", "unknown"), []
        if story.diagnosis is not None:
            found = Callout(sentence(story), TONES.get(story.diagnosis.verdict, "unknown"))
            said = notes(story.diagnosis, found.text, story.joints, story.spread)
        told = [explanation(" ".join(said))] if said else []
        figures = Tiles(numbers(story))
        return section(self.title, found, *map(warning, warnings(story)), figures, *told)


class Notes(Topic):
    """What accompanies a verdict; a report's summary has it."""

    name = "notes"

    def blocks(self, result: ResultDocument) -> Iterator[Block]:
        if result.verdict is None:
            return
        joints = joints_of(result)
        last = result.steps[-1] if result.steps else None
        for text in notes(result, verdict(result, joints).text, joints):
            yield explanation(text)
        yield from map(warning, hints(result.all_parameters))
        if last is not None and result.stopped:
            yield warning(STOPPED)

    def section(self, story: Story) -> None:
        return None


register(Verdict())
register(Notes())


def joints_of(result: ResultDocument | Diagnosis) -> tuple[str, ...]:
    """The robot's joints."""
    if isinstance(result, Diagnosis):
        return () if result.model is None else result.model.joints
    if result.torque is not None:
        return tuple(result.torque.joints)
    return tuple(dict.fromkeys(p.joint for p in result.all_parameters if p.joint is not None))


def verdict(
    result: ResultDocument | Diagnosis,
    joints: Sequence[str],
    added: Sequence[str] = (),
    spread: Sequence[float] = (),
) -> Callout:
    """The verdict in a box of its colour.

    Args:
        result: of a model.
        joints: of the robot.
        added: effects that led to the model, by name.
        spread: of each joint's torque [Nm]; empty: what the result knows.
    """
    last = result.steps[-1] if result.steps else None
    worst, _ = wording.what_stays(joints, last, spread or result.torque_spread)
    text = wording.verdict_text(result, added, joints=joints, worst=worst)
    return Callout(text, TONES.get(result.verdict, "unknown"))


def notes(
    result: ResultDocument | Diagnosis, said: str, joints: Sequence[str], spread: Sequence[float] = ()
) -> list[str]:
    """What is left where something is unknown, and the notes that neither verdict nor shares have `said`."""
    spread, last = spread or result.torque_spread, result.steps[-1] if result.steps else None
    final = last.verdict if isinstance(result, ResultDocument) and last is not None else result.verdict
    skipped = {*(wording.SAID_AS_SHARES if spread else ()), *(["free-curve"] if result.free_curve else [])}
    texts = [note.text for note in result.typed_notes if note.kind not in skipped and note.text not in said]
    left = wording.what_stays(joints, last, spread)[1] if final == "unknown" else ""
    return [_sentence(text, tuple(joints)) for text in (left, *texts) if text]


def verdict_panel(
    diagnosis: Diagnosis | None, up_to_date: bool, joints: Sequence[str] = (), spread: Sequence[float] = ()
) -> list[Block]:
    """The verdict with what accompanies it, struck through where the model has changed since."""
    if diagnosis is None:
        return [explanation(NOT_YET)]
    joints = joints or joints_of(diagnosis)
    found = verdict(diagnosis, joints, (), spread)
    if not up_to_date:
        return [Callout(found.text, "old"), warning(EARLIER)]
    told = map(explanation, notes(diagnosis, found.text, joints, spread))
    stopped = [warning(STOPPED)] if diagnosis.stopped else []
    return [found, *told, *map(warning, hints(diagnosis.parameters)), *stopped]


def sentence(content: Story) -> str:
    """The verdict, with the added effects and the fall of the error."""
    if content.diagnosis is None:
        return "Not diagnosed."
    added = [name for name, _ in content.added]
    names = added_names(content)
    curved = list(dict.fromkeys(name.partition(":")[2] for name in added if free_curve(name) is not None))
    words = [verdict(content.diagnosis, content.joints, names, content.spread).text]
    if curved:
        words.append(
            f"A free curve on {wording.listed(curved)}, which is not physics, stands for what is unknown."
        )
    return " ".join((*words, fall(content.steps, content.spread))).strip() if added else words[0]


def added_names(content: Story) -> list[str]:
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


def numbers(content: Story) -> list[Tile]:
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


def warnings(content: Story) -> list[str]:
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
