"""What is run (studies only with `-m study`), Ctrl+C in the background, the demonstration, its diagnosis."""

from __future__ import annotations

import os
import signal

# matrices are small, and tests share the cores already: more threads would only wait for one another
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest

from flexviz.diagnosis import Diagnosis, diagnose
from flexviz.importing import importing
from flexviz.measurements import MeasurementSet, read_set
from flexviz.resources import sessions_dir


@pytest.fixture(scope="session")
def demo() -> MeasurementSet:
    """The bundled set: a soft arm without gravity, rich motion, friction that its model does not name."""
    return read_set(sessions_dir() / "planar-2r-demo")


@pytest.fixture(scope="session")
def diagnosed_demo(demo: MeasurementSet) -> Diagnosis:
    """What is missing in it, found once for all tests."""
    return diagnose(demo, apply=True)


@pytest.fixture
def no_delay(monkeypatch: pytest.MonkeyPatch) -> None:
    """An import without the delay of the torque, which takes seconds."""
    monkeypatch.setattr(importing, "torque_delay", lambda *arguments: None)


def pytest_configure() -> None:
    """Let what tests start be interrupted: a shell's background jobs inherit an ignored SIGINT."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave studies out, whatever other marks are chosen; they are not skipped tests but work of an hour."""
    if "study" in (config.getoption("markexpr") or ""):
        return
    studies = [item for item in items if item.get_closest_marker("study")]
    config.hook.pytest_deselected(items=studies)
    items[:] = [item for item in items if item not in set(studies)]
