"""What is run (long tests when asked for), Ctrl+C in the background, the demonstration, its diagnosis."""

from __future__ import annotations

import os
import re
import signal

# matrices are small, and tests share the cores already: more threads would only wait for one another
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest

from flexviz.analysis.diagnosis import Diagnosis, diagnose
from flexviz.base.resources import sessions_dir
from flexviz.data.importing import importing
from flexviz.data.measurements import MeasurementSet, read_set


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
    """Leave out what is long unless it is chosen by its mark, or by the names of tests."""
    chosen = config.getoption("markexpr") or ""
    marks = {"slow", "study"} - set(re.findall(r"\w+", chosen))
    if any("::" in name for name in config.args):
        marks.discard("slow")
    left = {item for item in items if any(map(item.get_closest_marker, marks))}
    config.hook.pytest_deselected(items=list(left))
    items[:] = [item for item in items if item not in left]
