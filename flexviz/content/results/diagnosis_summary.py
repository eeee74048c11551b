"""A diagnosis as text: verdict, candidates, errors step by step, what stays, notes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import zip_longest

from rich.table import Table

from flexviz.content import wording
from flexviz.content.records import (
    CandidateEffect,
    EffectEntry,
    FoundEffect,
    JointErrors,
    StepEntry,
    finding_key,
    found_shares,
)
from flexviz.content.results.assessment import hints
from flexviz.content.results.fields import ResultFields
from flexviz.content.results.tables import fold, in_ascii, plain_table
from flexviz.model.effects import free_curve
from flexviz.robot.model import EffectValue

SHOWN_ABSORBED = 4  # parameters
TRACE_LINES = 6  # of what was tried
LABEL_WIDTH, COLUMN_WIDTH = 40, 10  # columns of a table with room for the models' names, and for a joint


def diagnosis_parts(result: ResultFields, width: int) -> list[Table | str]:
    """Verdict, candidates, table of the steps, what stays, notes; `width` columns wide."""
    joints = joints_of(result)
    last = result.steps[-1] if result.steps else None
    spread = result.torque.spread if result.torque is not None else []
    worst, left_over = wording.what_stays(joints, last, spread)
    out: list[Table | str] = [wording.verdict_text(result, joints=joints, worst=worst)]
    candidates = wording.merged_findings(result.candidates, found_shares(result))
    for rank, merged in enumerate(candidates, 1):
        out += candidate_lines(rank, merged, joints)
    out += added_lines(result)
    out += trace_lines(result, joints)
    if last is not None:
        out += steps_parts(result, joints, spread, width)
        if absorbed := wording.moved(step.added for step in result.steps if step.added is not None):
            by = in_ascii(wording.absorbed_list(absorbed, SHOWN_ABSORBED))
            out.append(f"before, this had been absorbed by {by}")
        if result.final_verdict == "unknown" and left_over:
            out.append(left_over)
    place = wording.location(result.where)
    if result.final_verdict == "unknown" and place is not None:
        units = {(one.joint, one.variable): one.unit for one in result.maps}
        groups = [group.name for group in last.groups] if last is not None else []
        span = in_ascii(wording.span_text(place, units.get((place.joint, place.variable), ""), groups))
        curved = {effect.joint for effect in result.all_effects if free_curve(effect.effect) is not None}
        left = "no effect explains" if place.joint in curved else "is left"
        out.append(f"what {left} on {place.joint} follows {place.variable}, mostly {span}")
    motor = {p.joint: p for p in result.all_parameters if p.name == "stiffness"}
    for entry in result.link_side:
        found = motor[entry.joint]
        out.append(
            f"stiffness of {entry.joint}: by the motor side {in_ascii(wording.estimate_words(found))} "
            f"({found.identifiable}); "
            f"by its link encoder {entry.text}"
        )
    skipped = {note.text for note in result.typed_notes if spread and note.kind in wording.SAID_AS_SHARES}
    skipped |= {note.text for note in result.typed_notes if note.text in str(out[0])}  # the verdict's reason
    out += [f"recording: {entry.message}" for entry in result.recording]
    out += [f"note: {note}" for note in result.notes if note not in skipped]
    out += [f"note: {hint}" for hint in hints(result.all_parameters)]
    return [*out, "stopped; this is what was found so far"] if result.stopped else out


def joints_of(result: ResultFields) -> tuple[str, ...]:
    """The robot's joints."""
    if result.torque is not None:
        return tuple(result.torque.joints)
    return tuple(dict.fromkeys(p.joint for p in result.all_parameters if p.joint is not None))


def added_lines(result: ResultFields) -> Iterator[str]:
    """Effects of the last model that are not among the candidates: next to the set's own model."""

    def key(one: FoundEffect | EffectEntry) -> tuple[str | None, ...]:
        return one.effect, one.joint, one.group, one.payload

    listed = {(key(candidate), candidate.confidence) for candidate in result.candidates}
    last = {key(effect): effect for effect in result.model.effects} if result.model is not None else {}
    forms = {
        (curve.effect, curve.joint): f"; its form is that of {curve.form}"
        for curve in result.curves
        if curve.form
    }
    later = [step.added for step in result.steps if step.added is not None]
    shares = found_shares(result)
    for added in sorted(later, key=lambda one: -shares.get(finding_key(one), 0.0)):
        if (key(added), added.confidence) not in listed:
            found = f": {values(last[key(added)])}" if key(added) in last else ""
            share = shares.get(finding_key(added))
            less = f"; removes {wording.share_text(share)} of the error" if share is not None else ""
            sure = f"; confidence {wording.confidence_of(added):.2f}" if not added.stopgap else ""
            form = in_ascii(forms.get((added.effect, added.joint), ""))
            yield f"then added: {named(added)} on {place_text(added)}{found}{less}{sure}{form}"


def candidate_lines(
    rank: int, merged: wording.MergedFinding[CandidateEffect], joints: Sequence[str]
) -> Iterator[str]:
    """A candidate with its place and values; of several joints, one value per joint."""
    first, *others = merged.members
    if not others:
        yield (
            f"{rank:3d}. {named(first)} on {place_text(first)}: {values(first)}; "
            f"{wording.removes_text(merged)}, confidence {wording.confidence_of(first):.2f}"
        )
        for tie in first.inseparable_from:
            place = f" on {tie.joint}" if tie.joint else ""
            yield f"     not told apart from {tie.effect}{place} (correlation {tie.correlation:.2f})"
            if tie.breaks:
                yield f"     {tie.breaks}"
        if first.inseparable_from and rank == 1:
            tie = first.inseparable_from[0]
            pair = first.text, EffectValue(tie.effect, tie.joint).text
            options = " ".join(f"--separate {text}" for text in pair)
            yield f"     the motion that would decide: flexviz design SET {options} --out DIR"
        return
    yield (
        f"{rank:3d}. {named(first)} on {merged.place(joints)}: {wording.removes_text(merged)}, confidence "
        f"{wording.confidence_range(merged.members)}"
    )
    for member in merged.by_joint(joints):
        twins = ", ".join(
            tie.effect + (f" on {tie.joint}" if tie.joint != member.joint else "")
            for tie in member.inseparable_from
        )
        yield f"     {member.joint}: {values(member)}" + (f"; not told apart from {twins}" if twins else "")


def named(one: FoundEffect) -> str:
    """The effect by its name on the command line, after the family that it stands for."""
    family = wording.tied_family(one)
    if family is None:
        return one.effect
    return f"{wording.family_title(family.name)} ({wording.UNTOLD}; here {one.effect})"


def place_text(one: FoundEffect) -> str:
    """The joint, payload or whole robot, and the group of an episode."""
    place = one.joint or one.payload or "the whole robot"
    return f"{place} in group {one.group}" if one.group else place


def values(candidate: CandidateEffect | EffectEntry) -> str:
    """ "coulomb 3.000 ± 0.012 Nm"; of a free curve its range and its extremes."""
    if free_curve(candidate.effect) is not None:
        return in_ascii(wording.curve_text(list(candidate.parameters.values())))
    return ", ".join(
        in_ascii(f"{name} {wording.value_text(candidate.effect, name, one)}")
        for name, one in candidate.parameters.items()
    )


def trace_lines(result: ResultFields, joints: Sequence[str]) -> list[str]:
    """What the search tried: accepted moves, the best refused ones, decoys; six lines at most."""
    moves = wording.told_moves(result.trace, joints, wording.added_families(result))
    accepted, refused = ([m.line for m in moves if m.accepted == made] for made in (True, False))
    tried = result.decoys
    decoys = [] if tried is None else [wording.decoys_text(tried)]
    room = TRACE_LINES - 1 - len(decoys)
    room_refused = min(len(refused), max(room // 2, room - len(accepted)))
    shown = room - room_refused
    if len(accepted) > shown:
        accepted = [*accepted[: shown - 1], f"{len(accepted) - shown + 1} more accepted moves"]
    lines = [*accepted, *refused[:room_refused], *decoys]
    title = "why these effects: moves of the search, with the decrease of its objective"
    return [title, *(f"     {in_ascii(line)}" for line in lines)] if lines else []


def steps_parts(
    result: ResultFields, joints: Sequence[str], spread: Sequence[float], width: int
) -> list[Table | str]:
    """Errors per joint after each added kind of effect, in the unit of `records.JointErrors`.

    Where the table would be too wide, the models are numbered and their names precede it; where it still is,
    joints become rows.
    """
    held_out = all(step.rms_validation for step in result.steps)

    def error(step: StepEntry) -> JointErrors:
        rms = step.rms_validation if held_out and step.rms_validation else step.rms
        return JointErrors(rms, spread, step.noise_floor, step.units)

    def cells(values: Sequence[float]) -> list[str]:
        return [wording.number(value, 2 if narrow else 3) for value in values]

    first, last = result.steps[0], result.steps[-1]
    names = wording.short_names(tuple(joints)) if len(joints) == len(first.rms) else [""] * len(first.rms)
    unit = error(last).unit
    mean = ["mean"] if error(last).relative and len(names) > 1 else []
    torque = error(last).torque
    title = f"error of the {'held-out' if held_out else 'fitted'} groups [{unit}]"
    steps = list(named_steps(result.steps, joints))
    column = max(COLUMN_WIDTH, *(len(name) + 2 for name in names))
    narrow = width < LABEL_WIDTH + column * len(names) + COLUMN_WIDTH * len(mean) + len("nothing-missing")
    rows = [["model" if narrow else title, *names, *mean, *([] if narrow else ["verdict"])]]
    for k, (name, step) in enumerate(steps):
        shown = [*error(step).values, *([error(step).mean] if mean else [])]
        rows.append([str(k) if narrow else name, *cells(shown), *([] if narrow else [step.verdict])])
    models = len(rows)
    if spread:
        texts = [wording.explained(share / 100).strip("> %") for share in error(last).shares]
        model = "last" if len(result.steps) > 1 else "present"
        rows.append(["explained" if narrow else f"torque explained by the {model} model [%]", *texts])
        rows.append(
            [
                f"error {torque}" if narrow else f"error of the {model} model [{torque}]",
                *cells(error(last).rms),
            ]
        )
    noise = error(last).mark
    if noise is not None:
        if spread:
            of_all = [wording.number(noise.mean, 2)] if mean and not narrow else []
            rows.append(["noise %" if narrow else f"noise [{unit}]", *cells(noise.values), *of_all])
        rows.append([f"noise {torque}" if narrow else f"noise [{torque}]", *cells(noise.rms)])
    if not narrow:
        return [steps_table(rows, models, ("verdict",))]
    if sum(max(map(len, cells)) + 2 for cells in zip_longest(*rows, fillvalue="")) > width:
        across = [list(cells) for cells in zip_longest(*rows, fillvalue="")]
        across[0][0] = "joint"
        rows, models = across, len(names) + 1
    numbered = [f"  {k}: {name} → {step.verdict}" for k, (name, step) in enumerate(steps)]
    return [f"{title}:", *numbered, steps_table(rows, models)]


def steps_table(rows: Sequence[Sequence[str]], section: int, end: Sequence[str] = ()) -> Table:
    """A table of its first row's titles; a line after row `section`. Names fold, numbers stay whole."""
    label, *titles = rows[0]
    table = plain_table(label, numbers=[title for title in titles if title not in end], end=end)
    fold(table, 0)
    for k, row in enumerate(rows[1:], 1):
        table.add_row(*row, end_section=k + 1 == section)
    return table


def named_steps(steps: Sequence[StepEntry], joints: Sequence[str]) -> Iterator[tuple[str, StepEntry]]:
    """The first model, and the last one of every run of effects of one kind, with their names."""
    yield "present model", steps[0]
    added = [step.added for step in steps[1:] if step.added is not None]
    families = wording.tied_families(added)
    for name, _, last in wording.text_runs([[one.text] for one in added], joints, families):
        yield f"+ {name}", steps[last + 1]
