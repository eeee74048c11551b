"""Work on several cores gives what one core gives, and survives what happens to its processes."""

from __future__ import annotations

import gc
import os
import signal
import time
import weakref
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.base import parallel
from flexviz.base.errors import InputError
from flexviz.base.parallel import (
    existing_objects_kept,
    on_cores,
    shared,
    stopped_by,
    usable_cores,
)

TWO = pytest.mark.skipif(usable_cores() < 2, reason="one core, or a system on which processes are not forked")


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Others join at once, as they do where there is much to do."""
    monkeypatch.setattr(parallel, "ALONE_SECONDS", 0.0)


def test_one_core_is_the_default() -> None:
    here = os.getpid()
    assert shared(lambda k: (k, os.getpid()), range(3)) == [(k, here) for k in range(3)]


@TWO
@pytest.mark.parametrize("count", [0, 1, 2, 300])
def test_results_come_in_order(count: int) -> None:
    with on_cores(2):
        assert shared(lambda k: k**2, range(count)) == [k**2 for k in range(count)]


@TWO
def test_the_work_is_shared() -> None:
    def piece(_: int) -> int:
        time.sleep(0.05)
        return os.getpid()

    with on_cores(2):
        assert len(set(shared(piece, range(6)))) == 2


@TWO
def test_what_is_little_work_is_not_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "ALONE_SECONDS", 0.03)
    monkeypatch.setattr(os, "fork", lambda: pytest.fail("forked"))
    with on_cores(2):
        assert shared(abs, range(6)) == list(range(6))


@TWO
def test_one_core_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    def piece(_: int) -> int:
        time.sleep(0.02)
        return os.getpid()

    monkeypatch.setattr(parallel, "ALONE_SECONDS", 0.03)
    with on_cores(2):
        here = [process == os.getpid() for process in shared(piece, range(12))]
    assert all(here[:2]) and not all(here)


@TWO
def test_what_fails_in_a_process_fails_here() -> None:
    def piece(k: int) -> int:
        time.sleep(0.02)
        if k == 3:
            raise InputError("no number", file="a.csv", place=f"row {k}")
        return k

    with on_cores(2), pytest.raises(InputError, match="row 3: no number") as raised:
        shared(piece, range(6))
    assert raised.value.place == "row 3"


@TWO
def test_the_work_of_a_killed_process_is_done_here() -> None:
    here = os.getpid()

    def piece(k: int) -> int:
        time.sleep(0.02)
        if os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)
        return k

    with on_cores(2):
        assert shared(piece, range(6)) == list(range(6))


@TWO
def test_no_process_and_no_file_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    here, files = os.getpid(), len(os.listdir("/proc/self/fd"))
    with on_cores(2):
        shared(abs, range(4))
        assert not active_children()
        monkeypatch.setattr(parallel, "wait", interrupted)
        with pytest.raises(KeyboardInterrupt):
            shared(lambda _: os.getpid() == here or time.sleep(60), range(4))
        assert not active_children()
    gc.collect()
    assert len(os.listdir("/proc/self/fd")) == files


@TWO
def test_a_stop_ends_the_processes() -> None:
    here, begin = os.getpid(), time.monotonic()

    def work(_: int = 0) -> str:
        if os.getpid() != here:
            time.sleep(60)
        return "here"

    with on_cores(2), stopped_by(lambda: time.monotonic() > begin + 0.2):
        assert shared(work, range(3)) == 3 * ["here"]
    assert time.monotonic() < begin + 30


@TWO
@pytest.mark.parametrize("call", ["fork", "pipe"])
def test_without_more_processes_or_files_one_core_works(monkeypatch: pytest.MonkeyPatch, call: str) -> None:
    def refused(*_: object) -> None:
        raise BlockingIOError("Resource temporarily unavailable")

    if call == "fork":
        monkeypatch.setattr(os, "fork", refused)
    else:
        monkeypatch.setattr(parallel.os, "pipe", refused)
    with on_cores(2):
        assert shared(lambda k: k**2, range(4)) == [0, 1, 4, 9]


def test_existing_objects_are_kept_from_the_garbage_collector_for_a_while() -> None:
    assert gc.get_freeze_count() == 0
    with pytest.raises(ZeroDivisionError), existing_objects_kept():
        kept, new = gc.get_freeze_count(), [[k] for k in range(1000)]
        with existing_objects_kept():
            # those of whoever froze them, of which another thread may free some, and no new ones
            assert 0 < gc.get_freeze_count() <= kept
        assert 0 < gc.get_freeze_count() <= kept and len(new) == 1000
        _ = 1 / 0
    assert gc.get_freeze_count() == 0


def test_what_a_context_leaves_in_cycles_is_collected_at_its_end() -> None:
    class Node:
        pass

    with existing_objects_kept():
        node: Any = Node()
        node.itself = node
        alive = weakref.ref(node)
        del node
    assert alive() is None


def resident() -> float:
    """Resident memory of this process [MB]."""
    fields = Path("/proc/self/status").read_text().split()
    return int(fields[fields.index("VmRSS:") + 1]) / 1024


@pytest.mark.skipif(not hasattr(parallel._libc, "malloc_trim"), reason="the C library returns memory itself")
def test_what_lies_below_a_block_in_use_is_returned() -> None:
    blocks = [np.ones(8000) for _ in range(3000)]  # 64 kB each, 190 MB
    last = blocks[-1]
    before = resident()
    del blocks
    parallel._return_freed()
    assert resident() < before - 150 and last.sum() == 8000


def test_without_such_a_library_nothing_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "_libc", None)
    parallel._return_freed()
