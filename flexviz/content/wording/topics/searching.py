"""News of a search, and what it has tried."""

from __future__ import annotations

from flexviz.base.facts import Fact
from flexviz.base.spelling import listed
from flexviz.content.records import JointErrors
from flexviz.content.wording.errors import error_short, error_text, error_whole
from flexviz.content.wording.facts import says
from flexviz.content.wording.merging import text_names
from flexviz.content.wording.verdicts import MOST_NAMED
from flexviz.model.effects import EFFECTS

STAGES = {
    "own-model": "fitting the set's own model to the noise",
    "survey": "estimating what each effect alone would remove",
    "usual": "fitting all usual effects on all joints",
    "search": "searching for what the usual effects leave",
    "found": "checking what was found",
    "fine": "refining the model in units of the sensors' noise",
    "stairs": "fitting the models on the way",
    "location": "locating the residual",
    "place": "looking for the place of an unmodelled torque",
    "free-curve": "adding a free curve",
    "bandwidth": "checking parameters against the observer's bandwidth",
}
REFUSED = {
    "cost": "it costs more than it gains",
    "held-out": "held-out groups are described less well",
    "": "it is not needed",
}
MOTIONS = {
    "slow": "slow motion and reversals of {joint}",
    "fast": "fast motion of {joint}",
    "unloaded": "torque near zero on {joint}",
    "loaded": "high torque on {joint}",
    "accelerated": "strong acceleration of {joint}",
    "low": "low positions of {joint}",
    "high": "high positions of {joint}",
    "group": "motion and payload of group {group} (payload {payload})",
}
MOST, MORE = "They differ most in ", ": record more data of this kind."  # around the motion


@says("search-stage")
def stage(fact: Fact) -> str:
    """A stage of a diagnosis."""
    return STAGES[fact.values["stage"]]


@says("trying-effect")
def trying(fact: Fact) -> str:
    """A candidate of the coarse search."""
    return f"trying: {EFFECTS[fact.values['effect']].title}"


@says("testing-effect")
def testing(fact: Fact) -> str:
    """A candidate of the fine search."""
    return f"testing candidate: {EFFECTS[fact.values['effect']].title}"


@says("fitting-curve")
def fitting_curve(fact: Fact) -> str:
    """A free curve in place of what no effect explains."""
    return f"fitting a free curve to an unknown law on {fact.joints[0]}"


@says("best-so-far")
def best_so_far(fact: Fact) -> str:
    """The best model, for whoever waits."""
    model = _model(fact)
    return f"so far: {model} (being checked): {_error(fact)}" if model else f"so far: {_error(fact)}"


@says("stopped-at-best")
def stopped_at_best(fact: Fact) -> str:
    """The best model, for whoever has stopped the search."""
    if not (model := _model(fact)):
        return f"stopped before any candidate was tried; {_error(fact)}"
    return f"best so far, not confirmed: {model}: {_error(fact)}"


def _model(fact: Fact) -> str:
    """What the model adds, "Coulomb friction on joint2"; empty without additions."""
    names = text_names(fact.values["added"], fact.joints)
    more = len(names) - MOST_NAMED
    if more > 0:
        names = [*names[:MOST_NAMED], f"{more} more"]
    return listed(names) if names else ""


def _error(fact: Fact) -> str:
    """ "validation error 25 % → 0.6 % of the torque (31 mNm)"."""
    values, kind = fact.values, "validation" if fact.values["held_out"] else "fit"
    now, before = (
        JointErrors(values[name], values["spread"], (), values["units"]) for name in ("rms", "before")
    )
    if values["before"]:
        return f"{kind} error {error_short(before)} → {error_whole(now)}"
    worst = now.order[0]
    most = f"{fact.joints[worst]} {error_text(now, worst)}"
    return f"{kind} error of the present model {error_whole(now)}; most: {most}"


@says("move-refused")
def move_refused(fact: Fact) -> str:
    """Why the search did not make a move."""
    return REFUSED[fact.values["why"]]


@says("alike-in-all-motion")
def alike(fact: Fact) -> str:
    """Two effects that no motion of the set separates."""
    return "The two effects look the same in every motion of this set: record a different kind of motion."


@says("differ-in-motion")
def differ(fact: Fact) -> str:
    """The motion in which two effects differ most."""
    return f"{MOST}{_motion(fact)}{MORE}"


def separating_motion(breaks: Fact | str) -> str:
    """What separates two effects, for a table: "fast motion of joint2 (2.1 times the average)"."""
    if isinstance(breaks, Fact) and breaks.kind == "differ-in-motion":
        return _motion(breaks)
    return str(breaks).removeprefix(MOST).removesuffix(MORE)  # of a document, or of an older session


def _motion(fact: Fact) -> str:
    values = fact.values
    names = {"joint": "".join(fact.joints), "group": "".join(fact.groups), "payload": values.get("payload")}
    motion = MOTIONS[values["motion"]].format(**names)
    return f"{motion} ({values['ratio']:.1f} times the average)"
