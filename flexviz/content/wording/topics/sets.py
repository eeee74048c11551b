"""Measurement sets: what looked odd while they were read, and what was done about it."""

from __future__ import annotations

from collections.abc import Sequence

from flexviz.base.errors import choose_from
from flexviz.base.facts import Fact
from flexviz.base.spelling import plural
from flexviz.content.wording.facts import says
from flexviz.content.wording.issues import IssueLike, issue_message


def first_file(files: Sequence[str]) -> str:
    """The first file in full, and how many more there are."""
    return files[0] + (f" and {len(files) - 1} more" if len(files) > 1 else "")


@says("odd-step")
def odd_step(fact: Fact) -> str:
    """A clock that is slow or fast for a flexible joint."""
    step = fact.values["step"]
    how = "slow for flexible joints" if step > 1e-3 else "uncommonly short"
    return f"the step is {step:g} s, {how}: is time in seconds?"


@says("wrong-unit")
def wrong_unit(fact: Fact) -> str:
    """Why a set is refused: a column in a unit that is orders of magnitude off."""
    found: IssueLike = fact.values["issue"]
    return f"{issue_message(found)}; {_unit_meant(found)}"


def _unit_meant(issue: IssueLike) -> str:
    """What the unit of a column seems to be, and what is expected."""
    units = [fix.value for fix in issue.fixes if fix.key == "unit"]
    if issue.signal in ("tau", "tau_joint"):
        small = "mNm" if issue.values["times"] > 1 else "kNm, or the motor's torque before the gear"
        return f"is this {units[0] if units else small}? expected Nm at the joint side"
    meant = "" if units else ", or the motor's angle before the gear"
    return f"are these degrees{meant}? expected radians at the joint side (after the gear)"


@says("constant-column")
def constant_column(fact: Fact) -> str:
    """A column that never changes."""
    return f"column {fact.columns[0]} never changes"


@says("unused-column")
def unused_column(fact: Fact) -> str:
    """A column of a joint that the set does not have."""
    name = fact.columns[0]
    meant = choose_from(name, fact.values["used"])
    return f"column {name} belongs to no joint of the set and is not used; {meant}"


@says("samples-not-used")
def samples_not_used(fact: Fact) -> str:
    """Samples between gaps."""
    count, least = fact.values["count"], fact.values["least"]
    return f"{count} samples in stretches of fewer than {least} between gaps are not used"


@says("group-too-short")
def group_too_short(fact: Fact) -> str:
    """A group of which gaps leave nothing."""
    least = fact.values["least"]
    return f'no stretch without a gap has {least} samples or more: group "{fact.groups[0]}" is left out'


@says("same-samples")
def same_samples(fact: Fact) -> str:
    """Groups that are copies."""
    first, second = fact.groups
    return (
        f'groups "{first}" and "{second}" hold the same samples: intervals are narrower than one recording '
        "allows"
    )


@says("time-jitters")
def time_jitters(fact: Fact) -> str:
    """Tables whose clock is not uniform."""
    files = first_file(fact.values["files"])
    return f"{files}: the time jitters: the signals were resampled to a uniform step"


@says("samples-filled")
def samples_filled(fact: Fact) -> str:
    """Single samples that were missing."""
    count = fact.values["count"]
    what = "1 single missing sample was" if count == 1 else f"{count} single missing samples were"
    return f"{first_file(fact.values['files'])}: {what} interpolated"


@says("gaps-bridged")
def gaps_bridged(fact: Fact) -> str:
    """What was done to the gaps of a table."""
    values = fact.values
    were = "was" if values["count"] == 1 else "were"
    text = (
        f"{plural(values['count'], 'gap')} of up to {1e3 * values['longest']:.3g} ms, short against the "
        f"content of the signals, {were} interpolated"
    )
    if not values["left"]:
        return text
    return f"{text}; longer gaps, {values['left']} of up to {1e3 * values['longest_left']:.3g} ms, split it"


@says("no-rest")
def no_rest(fact: Fact) -> str:
    """A static test without a hold."""
    return f"no rest of {fact.values['least']:g} s was found in this static test"


@says("meshes-missing")
def meshes_missing(fact: Fact) -> str:
    """Meshes that do not go with a robot into a set."""
    count = fact.values["count"]
    text = f"{fact.values['first']}: the robot can be identified but not drawn"
    return f"{count} meshes are missing, {text}" if count > 1 else text


@says("set-changed")
def set_changed(fact: Fact) -> str:
    """Files that are not those of a session's results."""
    files = ", ".join(fact.values["files"])
    return f"{files} changed since the session was saved: its results belong to the older data"


@says("contradiction")
def contradiction(fact: Fact) -> str:
    """What the robot contradicts."""
    return str(fact.values["issue"])


@says("issue")
def issue(fact: Fact) -> str:
    """What looks wrong or odd in a recording, without its signal and joints."""
    return issue_message(fact.values["issue"])


@says("comparing-torques")
def comparing_torques(fact: Fact) -> str:
    """What takes time."""
    return "comparing the torques with the robot's masses"
