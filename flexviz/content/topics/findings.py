"""The effects that are missing: candidates, what was added with its laws, what they are worth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from flexviz.analysis.diagnosis import Diagnosis, Finding
from flexviz.content import wording
from flexviz.content.blocks import (
    LISTED,
    SMALL_HEIGHT,
    Block,
    Cell,
    Details,
    Figures,
    Item,
    Items,
    Meter,
    Paragraph,
    Section,
    TableBlock,
    explanation,
    section,
    table,
    warning,
)
from flexviz.content.records import (
    CandidateEffect,
    EffectEntry,
    FoundEffect,
    finding_key,
    found_shares,
)
from flexviz.content.results import ResultDocument, evidence_chart, law_chart, law_difference
from flexviz.content.topics.story import Story
from flexviz.content.topics.topic import Topic, register
from flexviz.content.topics.verdict import joints_of
from flexviz.model.effects import EFFECTS, free_curve
from flexviz.robot.model import EffectValue

MIN_DEVIATIONS = 3.0  # [standard errors] a parameter must have changed by to count as absorbing an effect
NOT_CREDIBLE = "Tried, but not credible explanations of the residual:"
Merged = wording.MergedFinding[Finding]


class Findings(Topic):
    """By the names that commands take; a report adds laws and equations."""

    name = "added"
    title = "Which effects"

    def blocks(self, result: ResultDocument) -> Iterator[Block]:
        joints = joints_of(result)
        candidates = wording.merged_findings(result.candidates, found_shares(result))
        if candidates:
            yield Items([_candidate(k, one, joints) for k, one in enumerate(candidates)], ranked=True)
        yield from map(Paragraph, _then_added(result))

    def section(self, story: Story) -> Section | None:
        if story.diagnosis is None:
            return None
        kinds = [(_known(story, texts), texts) for texts in _merged_texts(story)]
        added = [merged for merged, _ in kinds if merged is not None]
        by_hand = [texts for merged, texts in kinds if merged is None]
        proposed = story.proposed
        every = [*added, *([proposed] if proposed else [])]
        moves = [a for a in wording.moved(story.found) if a.deviations >= MIN_DEVIATIONS]
        named = wording.absorbed_list(moves, LISTED)
        hinted = "" if proposed is None else _absorbing(proposed.members)
        return section(
            self.title,
            None if kinds or proposed else Paragraph("No effect was added and none is proposed."),
            _members("Added", added, story.joints) if added else None,
            *(Paragraph(_by_hand(story, texts)) for texts in by_hand),
            _members("Proposed", [proposed], story.joints) if proposed else None,
            *_figures(every, story.joints),
            _explanations(every),
            Paragraph(f"Before, other parameters had absorbed what was added: {named}.") if moves else None,
            Paragraph(hinted) if hinted else None,
            _ranking(story),
        )


register(Findings())


def _candidate(rank: int, merged: wording.MergedFinding[CandidateEffect], joints: Sequence[str]) -> Item:
    """A candidate on one line, with the name that commands take; what it is like below."""
    first, *others = merged.members
    values = "" if others else wording.values_text(first)
    told = "; ".join(filter(None, (values, f"{wording.removes_text(merged)}, {_sure(merged.members)}")))
    below = [wording.kinds_text(first)] if merged.tied else []
    if others:
        below += map(_row, merged.by_joint(joints))
    else:
        below += map(wording.tie_text, first.inseparable_from)
    if first.inseparable_from and rank == 0 and not others:
        tie = first.inseparable_from[0]
        pair = first.text, EffectValue(tie.effect, tie.joint).text
        options = " ".join(f"--separate {text}" for text in pair)
        below.append(f"the motion that would decide: flexviz design SET {options} --out DIR")
    return Item(f"{merged.statement(joints)} ({first.effect}): {told}", below)


def _sure(members: Sequence[CandidateEffect]) -> str:
    return f"confidence {wording.confidence_range(members)}"


def _row(one: CandidateEffect) -> str:
    ties = ", ".join(wording.lower(wording.effect_title(tie.effect)) for tie in one.inseparable_from)
    return f"{one.joint}: {wording.values_text(one)}" + (f" (hard to tell from {ties})" if ties else "")


def _then_added(result: ResultDocument) -> Iterator[str]:
    """Effects of the last model that are not among the candidates: next to the set's own model."""

    def key(one: FoundEffect | EffectEntry) -> tuple[str | None, ...]:
        return one.effect, one.joint, one.group, one.payload

    listed = {(key(candidate), candidate.confidence) for candidate in result.candidates}
    last = {key(effect): effect for effect in result.model.effects} if result.model is not None else {}
    forms = {(one.effect, one.joint): f"its form is that of {one.form}" for one in result.curves if one.form}
    later = [step.added for step in result.steps if step.added is not None]
    shares = found_shares(result)
    for added in sorted(later, key=lambda one: -shares.get(finding_key(one), 0.0)):
        if (key(added), added.confidence) not in listed:
            share = shares.get(finding_key(added))
            told = [
                wording.values_text(last[key(added)]) if key(added) in last else "",
                "" if share is None else f"removes {wording.share_text(share)} of the error",
                "" if added.stopgap else f"confidence {wording.share_text(wording.confidence_of(added))}",
                forms.get((added.effect, added.joint), ""),
            ]
            said = "; ".join(filter(None, told))
            yield f"then added: {wording.finding_name(added)} ({added.effect}){said and f': {said}'}"


def finding_panel(merged: Merged, rank: int, full: bool, joints: Sequence[str] = ()) -> list[Block]:
    """A finding: name, values, share, confidence; with `full` also all ties and absorbing parameters.

    Of effects of one kind on several `joints` the values are folded.
    """
    members = merged.members
    likely = min(map(wording.confidence_of, members))
    sure = f"{_sure(merged.members)}, {wording.removes_text(merged)}"
    out: list[Block] = [
        Paragraph(f"{rank}. {merged.statement(joints)}", strong=True),
        Meter(sure, likely, likely >= wording.LIKELY),
    ]
    out += [explanation(wording.kinds_text(members[0]))] if merged.tied else []
    if len(members) == 1:
        values = wording.values_text(members[0])
        out += [Paragraph(values)] if values else []
        out += [warning(wording.tie_text(tie)) for tie in members[0].inseparable_from[: None if full else 1]]
    else:
        out.append(Details("Values per joint", [Paragraph(_row(one)) for one in merged.by_joint(joints)]))
    absorbed = wording.moved(members)
    if full and absorbed:
        out.append(explanation(f"Other parameters had absorbed it: {wording.absorbed_list(absorbed)}."))
    return out


def heading(diagnosis: Diagnosis | None) -> list[Block]:
    """The heading above findings of which none is credible."""
    if diagnosis is None or diagnosis.verdict == "missing" or not diagnosis.findings:
        return []
    return [explanation(NOT_CREDIBLE)]


def _merged_texts(content: Story) -> list[tuple[str, ...]]:
    """The added effects, those of one kind together; what removes most of the error comes first."""
    kinds = wording.merged_texts([name for name, _ in content.added], content.joints, content.families)
    return sorted(kinds, key=lambda texts: -(content.share_of(texts) or 0.0))


def _known(content: Story, texts: Sequence[str]) -> wording.MergedFinding[Finding] | None:
    """The findings of added effects of one kind; None if one of them was not found by a diagnosis."""
    known = {name: finding for name, finding in content.added}
    found = tuple(finding for text in texts if (finding := known[text]) is not None)
    return wording.MergedFinding(found, content.share_of(texts)) if len(found) == len(texts) else None


def _by_hand(content: Story, texts: Sequence[str]) -> str:
    name = wording.text_names(texts, content.joints, content.families)[0]
    if all(map(free_curve, texts)):
        return f"Added: {name}. Not physics: it lowers the error of the recorded motion only."
    return f"Added: {name}, by hand, or by a diagnosis that is not in the session any more."


def _absorbing(findings: Sequence[Finding]) -> str:
    moves = [a for a in wording.moved(findings) if a.deviations >= MIN_DEVIATIONS]
    return f"Other parameters have absorbed it: {wording.absorbed_list(moves)}." if moves else ""


def _members(
    caption: str, found: Sequence[wording.MergedFinding[Finding]], joints: Sequence[str]
) -> TableBlock:
    rows: list[list[str | Cell]] = []
    for merged in found:
        share = "" if merged.share is None else wording.share_text(merged.share)
        name = wording.capitalised(wording.finding_title(merged.members[0]))
        for k, one in enumerate(merged.by_joint(joints)):
            effect = EFFECTS.get(one.effect)
            sure = wording.share_text(wording.confidence_of(one))
            rows.append(
                [
                    Cell("" if k else f"{caption}: {name}", strong=True),
                    wording.where_text(one.joint, one.payload, one.group).strip().removeprefix("on ")
                    or "all",
                    wording.values_text(one),
                    "" if k else share,
                    "not physics" if effect is not None and effect.stopgap else sure,
                ]
            )
    head = ("effect", "joint", "value ± 95 %", "removes", "confidence")
    return table(head, rows, (3, 4))


def _figures(found: Sequence[wording.MergedFinding[Finding]], joints: Sequence[str]) -> list[Figures]:
    """The law of every finding through its data; without one its signature in the residual."""
    charts = []
    for merged in found:
        for one in merged.by_joint(joints):
            if one.law is None:
                chart = evidence_chart(one, height=SMALL_HEIGHT)
            else:
                chart = law_chart(one.law, SMALL_HEIGHT)
                title = chart.title.partition(":")[0]
                note = f"Its law through the data; they differ by {law_difference(one.law)}."
                chart = replace(chart, title=title, note=note)
            charts += [chart] if chart.series else []
    return [Figures(charts)] if charts else []


def _explanations(found: Sequence[wording.MergedFinding[Finding]]) -> Paragraph | None:
    """A few words on every kind, its law, and what it cannot be told apart from."""
    out: dict[str, str] = {}
    for merged in found:
        effect = EFFECTS.get(merged.effect)
        if effect is not None:
            out.setdefault(effect.name, f"{effect.title}: {effect.equation}. {effect.explanation}")
            alike = f" {wording.kinds_text(merged.members[0])}" if merged.tied else ""
            out[effect.name] += alike if alike not in out[effect.name] else ""
    return explanation(" ".join(out.values())) if out else None


def _ranking(content: Story) -> TableBlock | None:
    """Candidates that were not added later, the best of every model."""
    rows: list[list[str | Cell]] = []
    later = {text for one in content.rounds for text in one.added}
    for index, one in enumerate(content.rounds):
        found = (
            wording.merged_findings(one.diagnosis.findings, found_shares(one.diagnosis))
            if one.diagnosis
            else []
        )
        left = [one for one in found if not all(finding.text in later for finding in one.members)]
        for merged in left[:LISTED]:
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
    return table(head, rows, (3, 4), caption) if rows else None
