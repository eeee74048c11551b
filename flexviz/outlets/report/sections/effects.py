"""Effects added and proposed, why, those that the data cannot distinguish, and experiments that would."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from flexviz.analysis.diagnosis import Finding
from flexviz.content import wording
from flexviz.content.records import ResidualLocation, Tie
from flexviz.model.effects import EFFECTS, free_curve
from flexviz.outlets.report import blocks
from flexviz.outlets.report.content import ReportContent
from flexviz.outlets.view import evidence_chart, law_chart, law_difference

MIN_DEVIATIONS = 3.0  # [standard errors] a parameter must have changed by to count as absorbing an effect
MAX_ABSORBED = 4  # parameters named
MAX_CANDIDATES = 4  # listed per model, effects of one kind together
MAX_LOCATIONS = 4  # of unexplained residual
MIN_EXPLAINED = 0.05  # of a joint's residual: a variable that explains less is not worth an experiment
MOST, MORE = "They differ most in ", ": record more data of this kind."  # around each of several motions
REFUSED = 4  # refused moves in the table
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
    """What was added and is proposed, with its laws, and the other candidates; None without a diagnosis."""
    if content.diagnosis is None:
        return None
    kinds = [(_known(content, texts), texts) for texts in _merged_texts(content)]
    added = [merged for merged, _ in kinds if merged is not None]
    by_hand = [texts for merged, texts in kinds if merged is None]
    proposed = content.proposed
    moves = [a for a in wording.moved(content.found) if a.deviations >= MIN_DEVIATIONS]
    absorbed = (
        f"Before, other parameters had absorbed what was added: {wording.absorbed_list(moves, MAX_ABSORBED)}."
    )
    hinted = "" if proposed is None else _absorbing(proposed.members)
    ranking = _ranking(content)
    return blocks.section(
        "Which effects",
        None if kinds or proposed else blocks.Paragraph("No effect was added and none is proposed."),
        _members("Added", added, content.joints) if added else None,
        *(blocks.Paragraph(_by_hand(content, texts)) for texts in by_hand),
        _members("Proposed", [proposed], content.joints) if proposed else None,
        *_figures([*added, *([proposed] if proposed else [])], content.joints),
        _explanations([*added, *([proposed] if proposed else [])]),
        blocks.Paragraph(absorbed) if moves else None,
        blocks.Paragraph(hinted) if hinted else None,
        *(() if ranking is None else (ranking,)),
    )


def _merged_texts(content: ReportContent) -> list[tuple[str, ...]]:
    """The added effects, those of one kind together; what removes most of the error comes first."""
    kinds = wording.merged_texts([name for name, _ in content.added], content.joints, content.families)
    return sorted(kinds, key=lambda texts: -(content.share_of(texts) or 0.0))


def _known(content: ReportContent, texts: Sequence[str]) -> wording.MergedFinding[Finding] | None:
    """The findings of added effects of one kind; None if one of them was not found by a diagnosis."""
    known = {name: finding for name, finding in content.added}
    found = tuple(finding for text in texts if (finding := known[text]) is not None)
    return wording.MergedFinding(found, content.share_of(texts)) if len(found) == len(texts) else None


def _by_hand(content: ReportContent, texts: Sequence[str]) -> str:
    name = wording.text_names(texts, content.joints, content.families)[0]
    if all(map(free_curve, texts)):
        return f"Added: {name}. Not physics: it lowers the error of the recorded motion only."
    return f"Added: {name}, by hand, or by a diagnosis that is not in the session any more."


def _absorbing(findings: Sequence[Finding]) -> str:
    moves = [a for a in wording.moved(findings) if a.deviations >= MIN_DEVIATIONS]
    return f"Other parameters have absorbed it: {wording.absorbed_list(moves)}." if moves else ""


def _members(
    caption: str, found: Sequence[wording.MergedFinding[Finding]], joints: Sequence[str]
) -> blocks.ReportTable:
    rows: list[list[str | blocks.Cell]] = []
    for merged in found:
        share = "" if merged.share is None else wording.share_text(merged.share)
        name = wording.capitalised(wording.finding_title(merged.members[0]))
        for k, one in enumerate(merged.by_joint(joints)):
            effect = EFFECTS.get(one.effect)
            sure = wording.share_text(wording.confidence_of(one))
            rows.append(
                [
                    blocks.Cell("" if k else f"{caption}: {name}", strong=True),
                    wording.where_text(one.joint, one.payload, one.group).strip().removeprefix("on ")
                    or "all",
                    wording.values_text(one),
                    "" if k else share,
                    "not physics" if effect is not None and effect.stopgap else sure,
                ]
            )
    head = ("effect", "joint", "value ± 95 %", "removes", "confidence")
    return blocks.table(head, rows, (3, 4))


def _figures(found: Sequence[wording.MergedFinding[Finding]], joints: Sequence[str]) -> list[blocks.Figures]:
    """The law of every finding through its data; without one its signature in the residual."""
    charts = []
    for merged in found:
        for one in merged.by_joint(joints):
            if one.law is None:
                chart = evidence_chart(one, height=blocks.SMALL_HEIGHT)
            else:
                chart = law_chart(one.law, blocks.SMALL_HEIGHT)
                title = chart.title.partition(":")[0]
                note = f"Its law through the data; they differ by {law_difference(one.law)}."
                chart = replace(chart, title=title, note=note)
            charts += [chart] if chart.series else []
    return [blocks.Figures(charts)] if charts else []


def _explanations(found: Sequence[wording.MergedFinding[Finding]]) -> blocks.Paragraph | None:
    """A few words on every kind, its law, and what it cannot be told apart from."""
    out: dict[str, str] = {}
    for merged in found:
        effect = EFFECTS.get(merged.effect)
        if effect is not None:
            out.setdefault(effect.name, f"{effect.title}: {effect.equation}. {effect.explanation}")
            alike = f" {wording.kinds_text(merged.members[0])}" if merged.tied else ""
            out[effect.name] += alike if alike not in out[effect.name] else ""
    return blocks.explanation(" ".join(out.values())) if out else None


def _ranking(content: ReportContent) -> blocks.ReportTable | None:
    """Candidates that were not added later, the best of every model."""
    rows: list[list[str | blocks.Cell]] = []
    later = {text for one in content.rounds for text in one.added}
    for index, one in enumerate(content.rounds):
        found = (
            wording.merged_findings(one.diagnosis.findings, wording.found_shares(one.diagnosis))
            if one.diagnosis
            else []
        )
        left = [one for one in found if not all(finding.text in later for finding in one.members)]
        for merged in left[:MAX_CANDIDATES]:
            first = merged.members[0]
            rows.append(
                [
                    f"model {index}",
                    merged.name(content.joints),
                    wording.values_text(first) if len(merged.members) == 1 else "",
                    wording.share_text(wording.joint_score(merged.members)),
                    "–" if first.stopgap else wording.confidence_range(merged.members),
                ]
            )
    caption = "Candidates not added, and the share of the held-out error above the noise that each removes"
    head = ("tried on", "effect", "value ± 95 %", "explains", "confidence")
    return blocks.table(head, rows, (3, 4), caption) if rows else None


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
    caption = "Moves of the search, and the best that it refused: decrease of its objective"
    decoys = diagnosis.decoys
    return blocks.section(
        wording.TRACE_TITLE,
        blocks.table(head, rows, (1,), caption) if rows else None,
        None
        if decoys is None
        else blocks.Paragraph(f"{wording.capitalised(wording.decoys_text(decoys))}: {DECOYS}."),
    )


def telling_apart(content: ReportContent) -> blocks.Section | None:
    """Ties, confirmations and recommended experiments; None without a diagnosis."""
    if content.diagnosis is None:
        return None
    found = [*content.found, *(content.proposed.members if content.proposed is not None else ())]
    steps = _beyond_ties(content, found)
    return blocks.section(
        "What could not be told apart, and what would decide",
        _ties(found, content.joints),
        *((blocks.Paragraph("Worth recording next:"), blocks.Items(steps)) if steps else ()),
    )


def _ties(found: Sequence[Finding], joints: Sequence[str]) -> blocks.Block:
    pairs: dict[tuple[str, str], list[tuple[Finding, Tie]]] = {}
    for finding in found:
        for tie in finding.inseparable_from:
            same = tie.joint == finding.joint
            other = wording.effect_title(tie.effect) + ("" if same else wording.where_text(tie.joint))
            pairs.setdefault((finding.effect, other), []).append((finding, tie))
    if not pairs:
        return blocks.Paragraph("No two effects are alike in these data.")
    rows = []
    for (_, other), both in pairs.items():
        merged = wording.MergedFinding(tuple(finding for finding, _ in both))
        if len(both) == 1:
            other = wording.effect_title(both[0][1].effect) + wording.where_text(both[0][1].joint)
        likeness = [min(abs(tie.correlation), 1.0) for _, tie in both]
        texts = dict.fromkeys(tie.breaks.removeprefix(MOST).removesuffix(MORE) for _, tie in both)
        decides = "; ".join(text for text in texts if text) or "no motion is known that distinguishes them"
        rows.append([_place(merged, joints), other, wording.share_text(min(likeness)), decides])
    head = ("found", "hard to tell from", "similarity", "distinguished by")
    return blocks.table(head, rows, (2,), "Effects that these data hardly distinguish")


def _place(merged: wording.MergedFinding[Finding], joints: Sequence[str]) -> str:
    """ "Coulomb friction on joints 1, 2 and 4", also where it stands for a family."""
    first = merged.members[0]
    if len(merged.members) == 1:
        return wording.member_name(first)
    return f"{wording.effect_title(first.effect)} on {merged.place(joints)}"


def next_experiments(content: ReportContent, found: Sequence[Finding]) -> list[str]:
    """One sentence per experiment, the most urgent first."""
    ties = [
        f"{wording.member_name(f)}, or {wording.effect_title(tie.effect)}"
        f"{wording.where_text(tie.joint)}? {tie.breaks}"
        for f in found
        for tie in f.inseparable_from
        if tie.breaks
    ]
    return list(dict.fromkeys([*ties, *_beyond_ties(content, found)]))


def _beyond_ties(content: ReportContent, found: Sequence[Finding]) -> list[str]:
    """Experiments besides those that tell similar effects apart."""
    out = []
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
