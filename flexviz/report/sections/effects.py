"""Effects added and proposed, why, those that the data cannot distinguish, and experiments that would."""

from __future__ import annotations

from collections.abc import Sequence

from flexviz import wording
from flexviz.diagnosis import Finding, ResidualLocation
from flexviz.effects import EFFECTS, free_curve
from flexviz.report import blocks
from flexviz.report.content import ReportContent
from flexviz.view import evidence_chart, law_chart, parameter_names

MIN_DEVIATIONS = 3.0  # [standard errors] a parameter must have changed by to count as absorbing an effect
MAX_ABSORBED = 4  # parameters named
MAX_CANDIDATES = 6  # listed per model, effects of one kind together
MAX_LOCATIONS = 4  # of unexplained residual
MIN_EXPLAINED = 0.05  # of a joint's residual: a variable that explains less is not worth an experiment
REFUSED = 10  # refused moves in the table
DECOYS = "candidates that cannot be right and compete in the same search, to estimate its false rate"
FOLLOW = {
    "position": "slow motion of {joint} over its whole range, in both directions",
    "position × direction": "slow motion of {joint} over its whole range, in both directions",
    "velocity": "{joint} at many constant speeds, very slow ones included, in both directions",
    "acceleration": "the same path of {joint} at clearly different accelerations",
    "load": "the same motion of {joint} with two payloads, or in poses of opposite gravity load",
    "time": "the same motion repeated for long, from a cold start; and once more after a pause",
    "group": "every group once more, to see whether the residual recurs",
    "frequency": "{joint} at rest with its drive on, and fast motion of the other joints, to find vibrations",
}


def effects(content: ReportContent) -> blocks.Section | None:
    """One part per kind of added or proposed effects, and the ranking; None without a diagnosis."""
    if content.diagnosis is None:
        return None
    parts = [_added(content, texts) for texts in _merged_texts(content)]
    if content.proposed is not None:
        parts.append(_part("Proposed", content.proposed, content.joints, absorbed=True))
    ranking = _ranking(content)
    candidates = blocks.explanation(
        "Candidates tried on each model, best first. A candidate “explains” the share of the held-out error "
        "above the noise that it removes from that model after refitting; these shares do not add up."
    )
    moves = [a for a in wording.moved(content.found) if a.deviations >= MIN_DEVIATIONS]
    absorbed = (
        f"Before, other parameters had absorbed what was added: {wording.absorbed_list(moves, MAX_ABSORBED)}."
    )
    return blocks.section(
        "Which effects",
        None if parts else blocks.Paragraph("No effect was added and none is proposed."),
        blocks.Paragraph(absorbed) if moves else None,
        *(() if ranking is None else (candidates, ranking)),
        parts=parts,
    )


def _merged_texts(content: ReportContent) -> list[tuple[str, ...]]:
    """The added effects, those of one kind together; what removes most of the error comes first."""
    kinds = wording.merged_texts([name for name, _ in content.added], content.joints, content.families)
    return sorted(kinds, key=lambda texts: -(content.share_of(texts) or 0.0))


def _added(content: ReportContent, texts: Sequence[str]) -> blocks.Section:
    known = {name: finding for name, finding in content.added}
    found = tuple(finding for text in texts if (finding := known[text]) is not None)
    if len(found) == len(texts):
        return _part("Added", wording.MergedFinding(found, content.share_of(texts)), content.joints)
    name = wording.text_names(texts, content.joints, content.families)[0]
    if all(map(free_curve, texts)):
        stopgap = "Not physics: it lowers the error of the recorded motion only."
        return blocks.section(f"Added: {name}", blocks.Paragraph(stopgap))
    unknown = "Added by hand, or by a diagnosis that is not in the session any more."
    return blocks.section(f"Added: {name}", blocks.Paragraph(unknown))


def _part(
    title: str, merged: wording.MergedFinding[Finding], joints: Sequence[str], absorbed: bool = False
) -> blocks.Section:
    first, effect = merged.members[0], EFFECTS.get(merged.effect)
    many = len(merged.members) > 1
    values = f"{wording.values_text(first)}. " if first.parameters and not many else ""
    stopgap = effect is not None and effect.stopgap
    sure = "not physics" if stopgap else f"confidence {wording.confidence_range(merged.members)}"
    moves = [a for a in wording.moved(merged.members) if a.deviations >= MIN_DEVIATIONS] if absorbed else []
    charts = (
        evidence_chart(finding, height=blocks.FIGURE_HEIGHT)
        if finding.law is None
        else law_chart(finding.law, blocks.FIGURE_HEIGHT)
        for finding in merged.members
    )
    return blocks.section(
        f"{title}: {merged.statement(joints)}",
        blocks.Paragraph(f"{values}{wording.capitalised(wording.removes_text(merged))}; {sure}."),
        blocks.Paragraph(wording.kinds_text(first)) if merged.tied else None,
        _members(merged, joints) if many else None,
        None
        if effect is None
        else blocks.explanation(f"{effect.explanation} Law: {effect.equation}. {effect.signature}"),
        blocks.Paragraph(f"Other parameters have absorbed it: {wording.absorbed_list(moves)}.")
        if moves
        else None,
        *(chart for chart in charts if chart.series),
    )


def _members(merged: wording.MergedFinding[Finding], joints: Sequence[str]) -> blocks.ReportTable:
    rows = [
        [str(one.joint), wording.values_text(one), wording.share_text(wording.confidence_of(one))]
        for one in merged.by_joint(joints)
    ]
    return blocks.table(("joint", "value ± 95 %", "confidence"), rows, (2,))


def _ranking(content: ReportContent) -> blocks.ReportTable | None:
    rows: list[list[str | blocks.Cell]] = []
    for index, one in enumerate(content.rounds):
        found = (
            wording.merged_findings(one.diagnosis.findings, wording.found_shares(one.diagnosis))
            if one.diagnosis
            else []
        )
        chosen = content.rounds[index + 1].added if index + 1 < len(content.rounds) else ()
        leading = [finding for merged in found[:MAX_CANDIDATES] for finding in merged.members]
        for rank, finding in enumerate(leading, 1):
            added = finding.text in chosen
            rows.append(
                [
                    f"model {index}",
                    str(rank),
                    blocks.Cell(wording.finding_name(finding), strong=added),
                    wording.values_text(finding),
                    wording.share_text(finding.score),
                    "–" if finding.stopgap else wording.share_text(wording.confidence_of(finding)),
                    "added" if added else "",
                ]
            )
    head = ("tried on", "rank", "effect", "value ± 95 %", "explains", "confidence", "")
    return blocks.table(head, rows, (1, 4, 5), "Candidates") if rows else None


def why(content: ReportContent) -> blocks.Section | None:
    """Accepted moves and the best refused ones; None where the diagnosis keeps none."""
    diagnosis = content.diagnosis
    if diagnosis is None or not (diagnosis.trace or diagnosis.decoys):
        return None
    families = wording.added_families(diagnosis) | content.families
    moves = wording.told_moves(diagnosis.trace, content.joints, families, refused=REFUSED)
    rows = [
        [
            blocks.Cell(move.text, strong=move.accepted),
            move.delta,
            move.resolution,
            "accepted" if move.accepted else move.why or "refused",
        ]
        for move in moves
    ]
    head = ("move", "decrease [nats]", "resolution", "")
    about = (
        "The search adds, drops and swaps effects. It accepts a move that lowers its objective, which is "
        "measured in nats, by clearly more than the standard error of the decrease. Accepted moves come "
        "first, those of one kind together, then the best of the refused ones."
    )
    caption = "Moves of the search: decrease of the objective ± its standard error"
    decoys = diagnosis.decoys
    return blocks.section(
        wording.TRACE_TITLE,
        blocks.explanation(about) if rows else None,
        blocks.table(head, rows, (1,), caption) if rows else None,
        None
        if decoys is None
        else blocks.Paragraph(f"{wording.capitalised(wording.decoys_text(*decoys))}: {DECOYS}."),
    )


def telling_apart(content: ReportContent) -> blocks.Section | None:
    """Ties, confirmations and recommended experiments; None without a diagnosis."""
    if content.diagnosis is None:
        return None
    found = [*content.found, *(content.proposed.members if content.proposed is not None else ())]
    weak = [p for p in content.parameters if p.identifiable != "yes" and p.name not in wording.INERTIAL]
    names = (
        f"Parameters of joints and effects that these data do not determine well: {parameter_names(weak)}."
    )
    steps = next_experiments(content, found)
    return blocks.section(
        "What could not be told apart, and what would decide",
        _ties(found),
        blocks.Paragraph(names) if weak else None,
        *((blocks.Paragraph("Worth recording next:"), blocks.Items(steps)) if steps else ()),
    )


def _ties(found: Sequence[Finding]) -> blocks.Block:
    rows = [
        [
            wording.member_name(f),
            wording.effect_title(tie.effect) + wording.where_text(tie.joint),
            wording.share_text(min(abs(tie.correlation), 1.0)),
            tie.breaks or "no motion is known that distinguishes them",
        ]
        for f in found
        for tie in f.inseparable_from
    ]
    if not rows:
        return blocks.Paragraph("No two effects are alike in these data.")
    head = ("found", "hard to tell from", "similarity", "distinguished by")
    return blocks.table(head, rows, (2,), "Effects that these data hardly distinguish")


def next_experiments(content: ReportContent, found: Sequence[Finding]) -> list[str]:
    """One sentence per experiment, the most urgent first."""
    out = [
        f"{wording.member_name(f)}, or {wording.effect_title(tie.effect)}"
        f"{wording.where_text(tie.joint)}? {tie.breaks}"
        for f in found
        for tie in f.inseparable_from
        if tie.breaks
    ]
    diagnosis = content.diagnosis
    if diagnosis is not None and diagnosis.verdict == "unknown":
        out += [_follow(place) for place in _places(diagnosis.where)]
    names = [f.effect for f in found] or [text.partition(":")[0] for text, _ in content.added]
    for name in dict.fromkeys(names):
        effect = EFFECTS.get(name)
        if effect is not None and not effect.stopgap:
            confirm = effect.confirm[:1].lower() + effect.confirm[1:]
            out.append(f"To confirm {wording.effect_text_name(name)}: {confirm}")
    return list(dict.fromkeys(out))


def _places(where: Sequence[ResidualLocation]) -> list[ResidualLocation]:
    """The leading variable of each joint with a structured residual."""
    first: dict[str, ResidualLocation] = {}
    for place in where:
        if place.explained >= MIN_EXPLAINED and place.variable in FOLLOW:
            best = first.get(place.joint)
            if best is None or place.explained > best.explained:
                first[place.joint] = place
    return list(first.values())[:MAX_LOCATIONS]


def _follow(place: ResidualLocation) -> str:
    motion = FOLLOW[place.variable].format(joint=place.joint)
    along = wording.ALONG.get(place.variable, place.variable)
    return f"To find the residual's dependence on {along} of {place.joint}: {motion}."
