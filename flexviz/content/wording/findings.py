"""Findings of a diagnosis as plain text: names, values, ties, what had absorbed them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from flexviz.base.spelling import listed, number, plural
from flexviz.base.statistics import NORMAL_95
from flexviz.content.records import Absorbed, CandidateEffect, EffectParameter, Family, FoundEffect, Tie
from flexviz.content.wording.estimates import NOT_DETERMINED, determined
from flexviz.content.wording.numbers import measured, plain_name, si_scale, unit_text
from flexviz.model.effects import EFFECTS, free_curve

FAMILY_TITLES = {
    "dry_friction": "dry friction",
    "constant_torque": "a constant torque",
    "torque_scale": "torque scale or load-dependent friction",
}
UNTOLD = "these data do not tell which kind"
ALONG = {
    "position": "the position",
    "velocity": "the velocity",
    "acceleration": "the acceleration",
    "load": "the load",
    "time": "time",
    "group": "the groups",
    "frequency": "frequency",
}
INERTIA = {f"m{axis}": f"first moment m·{axis}" for axis in "xyz"} | {
    name: f"inertia {name[1:]}" for name in ("ixx", "ixy", "iyy", "ixz", "iyz", "izz")
}


def family_title(name: str) -> str:
    """ "dry friction"; the readable name of a family that has no title."""
    return FAMILY_TITLES.get(name, plain_name(name))


def tied_family(finding: FoundEffect) -> Family | None:
    """The family that a finding stands for; None if the data tell which of its members acts."""
    return finding.family if finding.family is not None and finding.family.tied else None


def capitalised(text: str) -> str:
    """The text with a capital first letter."""
    return text[:1].upper() + text[1:]


def effect_title(name: str) -> str:
    """The effect's title; its readable name if it is not in the library."""
    effect = EFFECTS.get(name)
    return effect.title if effect is not None else plain_name(name)


def where_text(joint: str | None, payload: str | None = None, group: str | None = None) -> str:
    """ " on joint2", " in payload p2", " on joint1 in group g2", or nothing."""
    text = f" on {joint}" if joint else f" in payload {payload}" if payload else ""
    return text + (f" in group {group}" if group else "")


def finding_title(finding: FoundEffect) -> str:
    """ "Coulomb friction"; "Dry friction" where the data do not tell which kind."""
    family = tied_family(finding)
    return effect_title(finding.effect) if family is None else capitalised(family_title(family.name))


def finding_name(finding: FoundEffect) -> str:
    """ "Coulomb friction on joint2"; "Dry friction on joint2" where the data do not tell which kind."""
    return finding_title(finding) + where_text(finding.joint, finding.payload, finding.group)


def member_name(finding: FoundEffect) -> str:
    """ "Coulomb friction on joint2", also where it stands for a family."""
    return effect_title(finding.effect) + where_text(finding.joint, finding.payload, finding.group)


def kinds_text(finding: FoundEffect) -> str:
    """Of a tied family: the kinds that are alike in the data, and which of them the model contains."""
    family = tied_family(finding)
    if family is None:
        return ""
    kinds = [effect_title(name) for name in family.members]
    titles = [title if k == 0 else lower(title) for k, title in enumerate(kinds)]
    alike = f"Alike in these data: {listed(titles)}. " if len(titles) > 1 else ""
    return f"{alike}The model uses the simplest, {lower(effect_title(finding.effect))}."


def lower(title: str) -> str:
    """A title inside a sentence; proper names keep their capital."""
    names = ("Coulomb", "Stribeck")
    return title if title.startswith(names) else title[:1].lower() + title[1:]


def confidence_of(finding: FoundEffect) -> float:
    """Confidence of what a finding says: of its family where the data do not tell which kind."""
    family = tied_family(finding)
    sure = finding.confidence if family is None else family.confidence
    return 0.0 if math.isnan(sure) else sure


def effect_text_name(text: str, family: str = "") -> str:
    """ "coulomb_friction:joint2" as "Coulomb friction on joint2"; of a `family`, "Dry friction on joint2"."""
    name, _, where = text.partition(":")
    place, _, group = where.partition("@")
    title = capitalised(family_title(family)) if family else effect_title(name)
    return title + where_text(place or None, None, group or None)


def share_text(share: float) -> str:
    """0.62 as "62 %"; never 0 or 100 %."""
    if share < 0.01:
        return "< 1 %"
    if share > 0.99:
        return "> 99 %"
    return f"{100 * share:.0f} %"


def values_text(finding: CandidateEffect) -> str:
    """ "coulomb 3.000 ± 0.012 Nm", with 95 % intervals; of a free curve its range and its extremes."""
    if free_curve(finding.effect) is not None:
        return curve_text(list(finding.parameters.values()))
    values = finding.parameters.items()
    return ", ".join(f"{plain_name(name)} {value_text(finding.effect, name, one)}" for name, one in values)


def value_text(effect: str, name: str, found: EffectParameter) -> str:
    """ "3.000 ± 0.012 Nm", with the 95 % interval.

    "not determined" where half of that is wider than the value, or than the allowed range.
    """
    bounds = (
        next((p for p in EFFECTS[effect].parameters if p.name == name), None) if effect in EFFECTS else None
    )
    beyond = bounds is not None and NORMAL_95 * found.std > bounds.upper - bounds.lower
    if beyond or not determined(found):
        return NOT_DETERMINED
    return measured(found.value, found.std, found.unit)


def curve_text(values: Sequence[EffectParameter]) -> str:
    """ "from −1.00 to 1.20 rad: −3.1 … 4.2 Nm", from the values of a free curve's parameters."""
    low, high, *nodes = values
    torques = [node.value for node in nodes]
    return (
        f"from {number(low.value, 3)} to {number(high.value, 3)} {unit_text(low.unit)}: "
        f"{number(min(torques), 3)} … {number(max(torques), 3)} {unit_text(nodes[0].unit)}"
    )


def tie_text(tie: Tie) -> str:
    """The effect that a finding is hard to tell from, and what would decide."""
    other = lower(effect_title(tie.effect)) + where_text(tie.joint)
    text = f"Hard to tell from {other}: {share_text(min(abs(tie.correlation), 1.0))} alike in these data."
    return f"{text} {tie.breaks}".strip()


def moved(findings: Iterable[FoundEffect]) -> list[Absorbed]:
    """Every parameter that had absorbed any of the effects, once; `findings` in the order of their addition.

    Its value before the first and after the last of these effects; the largest change (in standard errors)
    comes first.
    """
    out: dict[tuple[str, str | None], Absorbed] = {}
    for a in (entry for finding in findings for entry in finding.absorbed):
        first = out.get((a.name, a.joint))
        before, least = (a.before, 0.0) if first is None else (first.before, first.deviations)
        largest = max(least, abs(a.deviations))  # NaN: unknown
        out[a.name, a.joint] = Absorbed(a.name, a.joint, before, a.after, a.unit, largest)
    return sorted(out.values(), key=lambda m: -m.deviations)


def absorbed_list(absorbed: Sequence[Absorbed], most: int = 3) -> str:
    """The first parameters that had absorbed the effect, and the number of others."""
    more = len(absorbed) - most
    others = [f"and {plural(more, 'other')}"] if more > 0 else []
    return "; ".join([absorbed_text(entry) for entry in absorbed[:most]] + others)


def absorbed_text(absorbed: Absorbed) -> str:
    """A parameter that had absorbed the effect: its value before and after."""
    place = f" of {absorbed.joint}" if absorbed.joint else ""
    name = INERTIA.get(absorbed.name, plain_name(absorbed.name))
    factor, unit = si_scale(max(abs(absorbed.before), abs(absorbed.after)), absorbed.unit)
    before, after = (number(factor * value) for value in (absorbed.before, absorbed.after))
    return f"{name}{place}: {before} → {after} {unit_text(unit)}".rstrip()
