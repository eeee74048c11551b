"""The state of one analysis with its history, and how it is kept in a file."""

from flexviz.session.saving import SESSION_FILE, load_session, save_session, zipped
from flexviz.session.state import HISTORY, ROLES, Analysis, Role, Session, Stair, Step, with_roles

__all__ = [
    "HISTORY",
    "ROLES",
    "SESSION_FILE",
    "Analysis",
    "Role",
    "Session",
    "Stair",
    "Step",
    "load_session",
    "save_session",
    "with_roles",
    "zipped",
]
