"""Sets and sessions that the app opens, and those that can be chosen."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from flexviz.base.errors import InputError
from flexviz.base.limits import read_json
from flexviz.base.resources import sessions_dir
from flexviz.checks import with_plausibility_warnings
from flexviz.content.scene import robot_shape
from flexviz.content.session import SESSION_FILE, Analysis, is_session, open_session, with_settings
from flexviz.content.view import truth_values
from flexviz.data.measurements import MeasurementSet, read_set, require_unchanged
from flexviz.outlets.app.state import Opened


def open_set(path: Path) -> Opened:
    """Read a measurement set, or a session and its set, and the robot's shape."""
    opened = open_session(path)
    measurements = opened.measurements
    shape, truth = robot_shape(measurements.robot), read_truth(measurements.path)
    if not is_session(path):
        return Opened(measurements, shape, truth)
    return Opened(measurements, shape, truth, opened.session, opened.folder.resolve())


def read_truth(folder: Path) -> dict[tuple[str, str | None], float] | None:
    """The true values of a simulated set, or None."""
    file = folder / "truth.json"
    if not file.is_file():
        return None
    try:
        return truth_values(read_json(file))
    except InputError:
        raise
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"not a usable truth file ({error})", file=file) from None


def chosen_set(analysis: Analysis) -> MeasurementSet:
    """The measurement set with the roles and servos of the analysis."""
    return with_settings(cached_set(analysis.path), analysis)


def cached_set(path: Path) -> MeasurementSet:
    """The set, cached until one of its files changes."""
    try:
        require_unchanged(_read(path))
    except InputError:
        _read.cache_clear()
    return _read(path)


@lru_cache(maxsize=1)
def _read(path: Path) -> MeasurementSet:
    return with_plausibility_warnings(read_set(path))


def sets_beside(*paths: Path) -> dict[str, Path]:
    """Name -> folder of available sets and sessions: `paths`, beside them, in ./sessions, bundled."""
    found: dict[str, Path] = {}
    for parent in (*(path.parent for path in paths), Path.cwd() / "sessions", sessions_dir()):
        names = ("measurements.toml", SESSION_FILE)
        for folder in sorted({file.parent for name in names for file in parent.glob(f"*/{name}")})[:200]:
            if folder.resolve() not in found.values():
                found.setdefault(folder.name, folder.resolve())
    for path in paths:
        found.setdefault(path.name, path.resolve())
    return found
