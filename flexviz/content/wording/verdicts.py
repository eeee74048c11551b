"""The verdict of a diagnosis as a sentence."""

from __future__ import annotations

import math
from collections.abc import Sequence

from flexviz.base.spelling import number
from flexviz.content.records import (
    DetectionLimit,
    DiagnosisLike,
    FoundEffect,
    LimitReason,
    ResidualLocation,
    StepEntry,
    found_shares,
    stated_errors,
)
from flexviz.content.wording.errors import left_text, percent
from flexviz.content.wording.findings import ALONG, UNTOLD, share_text
from flexviz.content.wording.merging import MergedFinding, confidence_range, joint_score, merged_findings
from flexviz.content.wording.numbers import unit_text
from flexviz.model.effects import free_curve

BEGINNINGS = {
    "nothing-missing": "Nothing is missing:",
    "missing": "Missing:",
    "unknown": "Unknown:",
    "not-searched": "Not searched:",
}
WITH_ADDED = {
    "missing": "this is still missing",
    "nothing-missing": "nothing is missing",
    "unknown": "not all of the error is explained",
    "not-searched": "nothing was tried",
}
STOPPED = "The diagnosis was stopped before its end: this is the best model so far."
HIDES: dict[LimitReason, str] = {
    "noise": "the noise of the sensors hides what is smaller",
    "filter": "the filter that the recording has passed hides what is smaller",
    "resolution": "the resolution of the sensors hides what is smaller",
    "tolerance": "the equations of the model are no more accurate",
}
MOST_NAMED = 4  # added effects in a verdict, those of one kind together
MIN_NAMED_SHARE = 0.005  # of the residual: a location that explains less is not named


def verdict_text(
    diagnosis: DiagnosisLike, added: Sequence[str] = (), *, joints: Sequence[str] = (), worst: str = ""
) -> str:
    """The verdict, beginning with one of `BEGINNINGS`, or "Added:"; one of a stopped diagnosis says so.

    Args:
        diagnosis: the diagnosis.
        added: names of effects that it found and added, the largest first; if there are any, they come first.
        joints: all joints of the robot.
        worst: joint with the largest share of its torque unexplained, named with the one with the largest
            structured residual, which the free curve is for.
    """
    if added:
        beginning, _, rest = verdict_text(diagnosis, joints=joints, worst=worst).partition(":")
        now = WITH_ADDED.get(diagnosis.verdict or "", beginning.lower())
        them = "it" if len(added) == 1 else "them"
        more = f"; {len(added) - MOST_NAMED} more" if len(added) > MOST_NAMED else ""
        named = "; ".join(added[:MOST_NAMED])
        return f"Added: {named}{more}. With {them} {now}:{rest}"
    if diagnosis.verdict == "not-searched":
        return f"{BEGINNINGS[diagnosis.verdict]} the diagnosis was stopped before it tried any effect."
    text = f"{BEGINNINGS.get(diagnosis.verdict or '', 'Unknown:')} {_found(diagnosis, joints, worst)}."
    return f"{text} {STOPPED}" if diagnosis.stopped else text


def _found(diagnosis: DiagnosisLike, joints: Sequence[str], worst: str) -> str:
    """What follows the beginning of a verdict, without the full stop."""
    if diagnosis.verdict == "missing":
        return _largest(diagnosis, joints)
    if diagnosis.verdict == "nothing-missing":
        pulses = any(note.kind == "pulses" for note in diagnosis.typed_notes)
        left = "noise, but for reversals and backlash crossings," if pulses else "noise,"
        holds = "" if diagnosis.limit is None else f". {limit_text(diagnosis.limit)}"
        return f"the residual looks like {left} and no effect of the library explains any of it{holds}"
    for kind in ("drowned", "changing"):
        if text := next((note.text for note in diagnosis.typed_notes if note.kind == kind), ""):
            return text
    acting = next((f"; {note.text}" for note in diagnosis.typed_notes if note.kind == "place"), "")
    nothing = "no effect tried so far" if diagnosis.stopped else "no effect of the library"
    unknown = f"{nothing} explains the structured residual"
    places = [p for p in diagnosis.where if not acting or p.joint == diagnosis.where[0].joint]
    clearest = location(places)
    place = clearest if acting else location(diagnosis.where, worst)
    if place is None or clearest is None:
        return f"{unknown}{acting}"
    share, along = share_text(clearest.explained), ALONG.get(clearest.variable, clearest.variable)
    follows = f", where {share} of it follows {along}"
    if place.joint != clearest.joint:
        follows = f"; of the residual of {clearest.joint}, {share} follows {along}"
    return f"{unknown}, mostly on {place.joint}{follows}{acting}"


def limit_text(limit: DetectionLimit) -> str:
    """ "This holds down to 0.020 % of the torque: the noise of the sensors hides what is smaller"."""
    return f"This holds down to {percent(limit.share)} of the torque: {HIDES[limit.because]}"


def _largest(diagnosis: DiagnosisLike, joints: Sequence[str]) -> str:
    """What removes most of the error, on all its joints, with share and confidence."""
    shares, findings = found_shares(diagnosis), diagnosis.findings
    later = [step.added for step in diagnosis.steps[1:] if step.added is not None]
    added = [one for one in later if free_curve(one.effect) is None]
    if not added and not findings:
        return "an effect that could not be named"
    merged: Sequence[MergedFinding[FoundEffect]] = merged_findings(added or findings, shares)
    best = merged[0]
    sure = f"confidence {confidence_range(best.members)}" + (f"; {UNTOLD}" if best.tied else "")
    if best.share is not None:
        return f"{best.name(joints)}: {share_text(best.share)} of the error, {sure}"
    scored = merged_findings(findings)[0]
    explain = "It explains" if len(best.members) == 1 else "Together they explain"
    above = share_text(joint_score(scored.members))
    return f"{scored.name(joints)}. {explain} {above} of the error above the noise; {sure}"


def what_stays(joints: Sequence[str], step: StepEntry | None, spread: Sequence[float]) -> tuple[str, str]:
    """The joint with the largest error of a model, and what it leaves of all; empty without a spread."""
    if step is None or not spread:
        return "", ""
    errors = stated_errors(step, spread)
    return joints[errors.order[0]], f"what is left: {left_text(joints, errors)}"


def location(where: Sequence[ResidualLocation], worst: str = "") -> ResidualLocation | None:
    """The first location that explains something, on the joint `worst` if there is one."""
    found = [place for place in where if place.explained > MIN_NAMED_SHARE]
    return next((place for place in found if place.joint == worst), found[0] if found else None)


def span_text(place: ResidualLocation, unit: str, groups: Sequence[str]) -> str:
    """Where along its variable the residual is largest, "-0.2 … 0.7 rad"; of `groups` the name."""
    low, high = place.range
    if place.variable == "group" and math.isfinite(low) and 0 <= round(low) < len(groups):
        return groups[round(low)]
    ends = " … ".join(number(end, 3) for end in (low, high))
    return f"{ends} {unit_text(unit)}".rstrip()
