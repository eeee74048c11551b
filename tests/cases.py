"""Cases that are left to `make slow`."""

from __future__ import annotations

from typing import Any

import pytest


def slow(*values: Any, id: str | None = None) -> Any:
    """A case that takes more than ten seconds, or repeats what another one shows every time."""
    return pytest.param(*values, marks=pytest.mark.slow, id=id)
