"""What could not be told apart, and what would decide."""

from __future__ import annotations

from collections.abc import Sequence

from flexviz.analysis.diagnosis import Finding
from flexviz.content import wording
from flexviz.content.blocks import LISTED, Block, Items, Paragraph, Section, section, table
from flexviz.content.records import ResidualLocation, Tie
from flexviz.content.topics.story import Story
from flexviz.content.topics.topic import Topic, register
from flexviz.model.effects import EFFECTS

MIN_EXPLAINED = 0.05  # of a joint's residual: a variable that explains less is not worth an experiment
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


class TellingApart(Topic):
    """Ties, confirmations and recommended experiments of a session; one result's stand at its findings."""

    name = "next_experiments"
    title = "What could not be told apart, and what would decide"

    def section(self, story: Story) -> Section | None:
        if story.diagnosis is None:
            return None
        found = _candidates(story)
        steps = _beyond_ties(story, found)
        more = (Paragraph("Worth recording next:"), Items(steps)) if steps else ()
        return section(self.title, _ties(found, story.joints), *more)

    def numbers(self, story: Story) -> list[str]:
        return next_experiments(story, story.found)


register(TellingApart())


def _candidates(story: Story) -> list[Finding]:
    return [*story.found, *(story.proposed.members if story.proposed is not None else ())]


def _ties(found: Sequence[Finding], joints: Sequence[str]) -> Block:
    pairs: dict[tuple[str, str], list[tuple[Finding, Tie]]] = {}
    for finding in found:
        for tie in finding.inseparable_from:
            same = tie.joint == finding.joint
            other = wording.effect_title(tie.effect) + ("" if same else wording.where_text(tie.joint))
            pairs.setdefault((finding.effect, other), []).append((finding, tie))
    if not pairs:
        return Paragraph("No two effects are alike in these data.")
    rows = []
    for (_, other), both in pairs.items():
        merged = wording.MergedFinding(tuple(finding for finding, _ in both))
        if len(both) == 1:
            other = wording.effect_title(both[0][1].effect) + wording.where_text(both[0][1].joint)
        likeness = [min(abs(tie.correlation), 1.0) for _, tie in both]
        texts = dict.fromkeys(wording.separating_motion(tie.breaks) for _, tie in both)
        decides = "; ".join(text for text in texts if text) or "no motion is known that distinguishes them"
        rows.append([_place(merged, joints), other, wording.share_text(min(likeness)), decides])
    head = ("found", "hard to tell from", "similarity", "distinguished by")
    return table(head, rows, (2,), "Effects that these data hardly distinguish")


def _place(merged: wording.MergedFinding[Finding], joints: Sequence[str]) -> str:
    """ "Coulomb friction on joints 1, 2 and 4", also where it stands for a family."""
    first = merged.members[0]
    if len(merged.members) == 1:
        return wording.member_name(first)
    return f"{wording.effect_title(first.effect)} on {merged.place(joints)}"


def next_experiments(content: Story, found: Sequence[Finding]) -> list[str]:
    """One sentence per experiment, the most urgent first."""
    ties = [
        f"{wording.member_name(f)}, or {wording.effect_title(tie.effect)}"
        f"{wording.where_text(tie.joint)}? {tie.breaks}"
        for f in found
        for tie in f.inseparable_from
        if tie.breaks
    ]
    return list(dict.fromkeys([*ties, *_beyond_ties(content, found)]))


def _beyond_ties(content: Story, found: Sequence[Finding]) -> list[str]:
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
    return list(first.values())[:LISTED]


def _follow(place: ResidualLocation) -> str:
    motion = FOLLOW[place.variable].format(joint=place.joint)
    along = wording.ALONG.get(place.variable, place.variable)
    return f"To find the residual's dependence on {along} of {place.joint}: {motion}."
