"""Analysis sessions: state, history, saving and autosave."""

from flexviz.content.session.autosave import Autosave, Unsaved, find_unsaved
from flexviz.content.session.document import SESSION_FILE
from flexviz.content.session.history import effect_added, first_fit, fit_before, runs
from flexviz.content.session.loading import OpenedSession, is_session, open_session, relocate
from flexviz.content.session.saving import SessionChanged, save_session, zipped
from flexviz.content.session.staircase import diagnosed_models, model_chain
from flexviz.content.session.standing import ResultStanding, standing
from flexviz.content.session.state import (
    HISTORY,
    ROLES,
    Analysis,
    ModelStep,
    Session,
    Settings,
    identified_errors,
    now,
    with_roles,
    with_settings,
)

__all__ = [
    "HISTORY",
    "ROLES",
    "SESSION_FILE",
    "Analysis",
    "Autosave",
    "ModelStep",
    "OpenedSession",
    "ResultStanding",
    "Session",
    "SessionChanged",
    "Settings",
    "Unsaved",
    "diagnosed_models",
    "effect_added",
    "find_unsaved",
    "first_fit",
    "fit_before",
    "identified_errors",
    "is_session",
    "model_chain",
    "now",
    "open_session",
    "relocate",
    "runs",
    "save_session",
    "standing",
    "with_roles",
    "with_settings",
    "zipped",
]
