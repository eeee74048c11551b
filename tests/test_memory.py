"""Freed memory goes back to the system, from which it can be had by others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexviz import memory
from flexviz.memory import return_freed


def resident() -> float:
    """Resident memory of this process [MB]."""
    fields = Path("/proc/self/status").read_text().split()
    return int(fields[fields.index("VmRSS:") + 1]) / 1024


@pytest.mark.skipif(not hasattr(memory._libc, "malloc_trim"), reason="the C library returns memory itself")
def test_what_lies_below_a_block_in_use_is_returned() -> None:
    blocks = [np.ones(8000) for _ in range(3000)]  # 64 kB each, 190 MB
    last = blocks[-1]
    before = resident()
    del blocks
    return_freed()
    assert resident() < before - 150 and last.sum() == 8000


def test_without_such_a_library_nothing_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "_libc", None)
    return_freed()
