"""Where the files shipped with flexviz lie.

In a checkout they are the top-level folders `robots/` and `sessions/`; in an installed wheel the same
folders are packed as `flexviz/_data/robots` and `flexviz/_data/sessions`.
"""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def data_dir(name: str) -> Path:
    """The folder `name` ("robots", "sessions") of this checkout or of the installed package."""
    checkout = _PACKAGE.parent
    if (checkout / "pyproject.toml").is_file() and (checkout / name).is_dir():
        return checkout / name
    return _PACKAGE / "_data" / name


def robots_dir() -> Path:
    """Folder of the robot descriptions and settings shipped with flexviz."""
    return data_dir("robots")


def sessions_dir() -> Path:
    """Folder of the example measurement sets and sessions shipped with flexviz."""
    return data_dir("sessions")
