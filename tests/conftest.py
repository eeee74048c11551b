"""Long studies run only where they are asked for by name: `pytest -m study`."""

from __future__ import annotations

import pytest


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave studies out, whatever other marks are chosen; they are not skipped tests but work of an hour."""
    if "study" in (config.getoption("markexpr") or ""):
        return
    studies = [item for item in items if item.get_closest_marker("study")]
    config.hook.pytest_deselected(items=studies)
    items[:] = [item for item in items if item not in set(studies)]
