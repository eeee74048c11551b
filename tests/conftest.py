"""What is run (studies only where `-m study` asks for them), and that Ctrl+C works in the background."""

from __future__ import annotations

import signal

import pytest


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
