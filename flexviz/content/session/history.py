"""The fits in the history of a session: every *Run*, the first one, and the one before the present."""

from __future__ import annotations

from collections.abc import Sequence

from flexviz.analysis.identification import Identification
from flexviz.content.session.standing import standing
from flexviz.content.session.state import Analysis, Session


def runs(session: Session) -> list[Analysis]:
    """The states that show a *Run* which is no model of the staircase, one per fit, oldest first.

    A diagnosis with the observer of a new session makes a fit one of its models.
    """
    states = [state for state in _states(session) if state.identification is not None]
    judged = {id(state.identification) for state in states if standing(state).errors == "verdict"}
    found: dict[int, Analysis] = {}
    for state in states:
        if id(state.identification) not in judged:
            found.setdefault(id(state.identification), state)
    return list(found.values())


def first_fit(session: Session) -> Identification | None:
    """The first fit of a session."""
    return next((fit for state in _states(session) if (fit := state.identification) is not None), None)


def fit_before(session: Session) -> Identification | None:
    """The fit that was shown before the present one."""
    present = session.analysis.identification
    fits = (step.analysis.identification for step in reversed(session.past))
    return next((fit for fit in fits if fit is not None and fit is not present), None)


def effect_added(session: Session) -> bool:
    """Whether the present state has a new fit, with effects that the fit before it lacks."""
    states = [step.analysis for step in session.steps if step.analysis.identification is not None]
    if len(states) < 2 or states[-1] is not session.analysis:
        return False
    *earlier, present = states
    if any(state.identification is present.identification for state in earlier):
        return False
    before, now = earlier[-1].fitted, present.fitted
    return before is not None and now is not None and set(before.effects) < set(now.effects)


def _states(session: Session) -> Sequence[Analysis]:
    """All states, also those that *Redo* brings back."""
    return [step.analysis for step in (*session.steps, *session.future)]
