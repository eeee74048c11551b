"""Cases that do not run every time."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable
from typing import Any

import pytest


def slow(*values: Any) -> Any:
    """A case that takes more than ten seconds, or repeats what another one shows every time."""
    return pytest.param(*values, marks=pytest.mark.slow)


def study(*values: Any) -> Any:
    """A case of a study."""
    return pytest.param(*values, marks=pytest.mark.study)


def with_slow(cases: Iterable[Any], names: Container[str], name: Callable[[Any], str] = str) -> list[Any]:
    """The cases, those whose name is among `names` as slow ones."""
    return [slow(case) if name(case) in names else case for case in cases]
