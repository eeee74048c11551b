"""Effects that the data cannot distinguish, and experiments that would."""

from __future__ import annotations

from flexviz.diagnosis import Finding, ResidualLocation
from flexviz.effects import EFFECTS
from flexviz.report.blocks import Block, Items, Paragraph, Section, table
from flexviz.report.content import ReportContent
from flexviz.view import parameter_names
from flexviz.wording import (
    ALONG,
    INERTIAL,
    effect_text_name,
    effect_title,
    finding_name,
    share_text,
    where_text,
)

MAX_LOCATIONS = 4  # of unexplained residual
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


def telling_apart(content: ReportContent) -> Section | None:
    """Ties, confirmations and recommended experiments; None without a diagnosis."""
    if content.diagnosis is None:
        return None
    found = [finding for _, finding in content.added if finding is not None]
    if content.diagnosis.verdict == "missing":
        found += list(content.diagnosis.findings[:1])
    blocks: list[Block] = []
    ties = [(f, tie) for f in found for tie in f.inseparable_from]
    if ties:
        rows = [
            [
                finding_name(f),
                effect_title(tie.effect) + where_text(tie.joint),
                share_text(min(abs(tie.correlation), 1.0)),
                tie.breaks or "no motion is known that distinguishes them",
            ]
            for f, tie in ties
        ]
        head = ("found", "hard to tell from", "similarity", "distinguished by")
        blocks.append(table(head, rows, (2,), "Effects that these data hardly distinguish"))
    else:
        blocks.append(Paragraph("No two effects are alike in these data."))
    blocks += _undetermined(content)
    steps = next_experiments(content, found)
    if steps:
        blocks.append(Paragraph("Worth recording next:"))
        blocks.append(Items(tuple(steps)))
    return Section("What could not be told apart, and what would decide", tuple(blocks))


def next_experiments(content: ReportContent, found: list[Finding]) -> list[str]:
    """One sentence per experiment, the most urgent first."""
    out = [
        f"{finding_name(f)}, or {effect_title(tie.effect)}{where_text(tie.joint)}? {tie.breaks}"
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
        if effect is not None:
            out.append(f"To confirm {effect_text_name(name)}: {_lower(effect.confirm)}")
    return list(dict.fromkeys(out))


def _places(where: tuple[ResidualLocation, ...]) -> list[ResidualLocation]:
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
    along = ALONG.get(place.variable, place.variable)
    return f"To find the residual's dependence on {along} of {place.joint}: {motion}."


def _undetermined(content: ReportContent) -> list[Block]:
    weak = [p for p in content.parameters if p.identifiable != "yes" and p.name not in INERTIAL]
    if not weak:
        return []
    names = parameter_names(weak)
    return [Paragraph(f"Parameters of joints and effects that these data do not determine well: {names}.")]


def _lower(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:]
