"""A diagnosis as plain text: verdict, findings and their values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from flexviz.effects import EFFECTS
from flexviz.wording.numbers import interval, listed, number, plain_name, plural, unit_text

BEGINNINGS = {"nothing-missing": "Nothing is missing:", "missing": "Missing:", "unknown": "Unknown:"}
WITH_ADDED = {
    "missing": "this is still missing",
    "nothing-missing": "nothing is missing",
    "unknown": "not all of the error is explained",
}
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
MIN_NAMED_SHARE = 0.005  # of the residual: a location that explains less is not named


class Placed(Protocol):
    """A parameter or an effect of a joint, a payload or a group, or of the whole robot."""

    @property
    def joint(self) -> str | None: ...
    @property
    def payload(self) -> str | None: ...
    @property
    def group(self) -> str | None: ...


class FindingLike(Placed, Protocol):
    """A candidate of a diagnosis or of a results document."""

    @property
    def effect(self) -> str: ...
    @property
    def score(self) -> float: ...
    @property
    def confidence(self) -> float: ...
    @property
    def parameters(self) -> Mapping[str, ValueLike]: ...


class ValueLike(Protocol):
    """A value with its standard error."""

    @property
    def value(self) -> float: ...
    @property
    def std(self) -> float | None: ...
    @property
    def unit(self) -> str: ...


class LocationLike(Protocol):
    """A joint and variable with a structured residual."""

    @property
    def joint(self) -> str: ...
    @property
    def variable(self) -> str: ...
    @property
    def explained(self) -> float | None: ...


class VerdictLike(Protocol):
    """A diagnosis or a results document."""

    @property
    def verdict(self) -> str | None: ...
    @property
    def findings(self) -> Sequence[FindingLike]: ...
    @property
    def where(self) -> Sequence[LocationLike]: ...


class TieLike(Protocol):
    """An effect that the data hardly tell from another."""

    @property
    def effect(self) -> str: ...
    @property
    def joint(self) -> str | None: ...
    @property
    def correlation(self) -> float: ...


class AbsorbedLike(Protocol):
    """A parameter that moved when an effect was added."""

    @property
    def name(self) -> str: ...
    @property
    def joint(self) -> str | None: ...
    @property
    def before(self) -> float: ...
    @property
    def after(self) -> float: ...
    @property
    def unit(self) -> str: ...


def effect_title(name: str) -> str:
    """The effect's title; its readable name if it is not in the library."""
    effect = EFFECTS.get(name)
    return effect.title if effect is not None else plain_name(name)


def where_text(joint: str | None, payload: str | None = None, group: str | None = None) -> str:
    """ " on joint2", " in payload p2", " on joint1 in group g2", or nothing."""
    text = f" on {joint}" if joint else f" in payload {payload}" if payload else ""
    return text + (f" in group {group}" if group else "")


def finding_name(finding: FindingLike) -> str:
    """ "Coulomb friction on joint2"."""
    return effect_title(finding.effect) + where_text(finding.joint, finding.payload, finding.group)


def effect_text_name(text: str) -> str:
    """ "coulomb_friction:joint2" as "Coulomb friction on joint2"."""
    name, _, where = text.partition(":")
    place, _, group = where.partition("@")
    return effect_title(name) + where_text(place or None, None, group or None)


def share_text(share: float) -> str:
    """0.62 as "62 %"; never 0 or 100 %."""
    if share < 0.01:
        return "< 1 %"
    if share > 0.99:
        return "> 99 %"
    return f"{100 * share:.0f} %"


def verdict_text(diagnosis: VerdictLike, added: Sequence[str] = ()) -> str:
    """The verdict, beginning with "Nothing is missing:", "Missing:" or "Unknown:".

    `added` are names of effects that the diagnosis found and added; if there are any, they come first.
    """
    if added:
        beginning, _, rest = verdict_text(diagnosis).partition(":")
        now = WITH_ADDED.get(diagnosis.verdict or "", beginning.lower())
        them = "it" if len(added) == 1 else "them"
        return f"{BEGINNINGS['missing']} {listed(added)} (added here). With {them} {now}:{rest}"
    beginning = BEGINNINGS.get(diagnosis.verdict or "", "Unknown:")
    if diagnosis.verdict == "missing" and diagnosis.findings:
        best = diagnosis.findings[0]
        return (
            f"{beginning} {finding_name(best)}. It explains {share_text(best.score)} of the error above the "
            f"noise; confidence {share_text(best.confidence)}."
        )
    if diagnosis.verdict == "missing":
        return f"{beginning} an effect that could not be named."
    if diagnosis.verdict == "nothing-missing":
        return f"{beginning} the residual looks like noise, and no effect of the library explains any of it."
    place = next((p for p in diagnosis.where if (p.explained or 0.0) > MIN_NAMED_SHARE), None)
    if place is None:
        return f"{beginning} no effect of the library explains the structured residual."
    return (
        f"{beginning} no effect of the library explains the structured residual, mostly on {place.joint}, "
        f"where {share_text(place.explained or 0.0)} follows {ALONG.get(place.variable, place.variable)}."
    )


def values_text(finding: FindingLike) -> str:
    """ "coulomb 3.000 ± 0.012 Nm", with 95 % intervals."""
    parts = []
    for name, found in finding.parameters.items():
        shown, error = interval(found.value, found.std)
        parts.append(f"{plain_name(name)} {shown} ± {error} {unit_text(found.unit)}".rstrip())
    return ", ".join(parts)


def tie_text(tie: TieLike) -> str:
    """The effect that a finding is hard to tell from, and what would decide."""
    other = effect_title(tie.effect) + where_text(tie.joint)
    text = f"Hard to tell from {other} (signatures similar to {share_text(min(abs(tie.correlation), 1.0))})."
    breaks = getattr(tie, "breaks", "")
    return f"{text} {breaks}".strip()


def absorbed_list(absorbed: Sequence[AbsorbedLike], most: int = 3) -> str:
    """The first parameters that had absorbed the effect, and the number of others."""
    more = len(absorbed) - most
    others = [f"and {plural(more, 'other')}"] if more > 0 else []
    return "; ".join([absorbed_text(entry) for entry in absorbed[:most]] + others)


def absorbed_text(absorbed: AbsorbedLike) -> str:
    """A parameter that had absorbed the effect: its value before and after."""
    place = f" of {absorbed.joint}" if absorbed.joint else ""
    name, unit = INERTIA.get(absorbed.name, plain_name(absorbed.name)), unit_text(absorbed.unit)
    return f"{name}{place}: {number(absorbed.before)} → {number(absorbed.after)} {unit}".rstrip()
