"""Work on several cores gives what one core gives, and survives what happens to a copy of the process."""

from __future__ import annotations

import gc
import os
import signal
import time
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz import parallel
from flexviz.parallel import (
    Background,
    existing_objects_kept,
    on_cores,
    shared,
    stopped_by,
    usable_cores,
)

TWO = pytest.mark.skipif(usable_cores() < 2, reason="one core, or a system on which processes are not forked")


def test_one_core_is_the_default() -> None:
    here = os.getpid()
    assert shared(lambda k: (k, os.getpid()), range(3)) == [(k, here) for k in range(3)]
    assert Background(os.getpid).result() == here


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
        background = Background(os.getpid)
        assert background.result() != os.getpid()


@TWO
def test_work_says_when_it_is_done() -> None:
    assert Background(os.getpid).ready  # nobody else is waited for
    with on_cores(2):
        work = Background(lambda: time.sleep(0.3))
        assert not work.ready
        deadline = time.monotonic() + 20
        while not work.ready and time.monotonic() < deadline:
            time.sleep(0.02)
        assert work.ready and work.result() is None
        failing = Background(lambda: os.kill(os.getpid(), signal.SIGKILL))
        while not failing.ready and time.monotonic() < deadline:
            time.sleep(0.02)
        assert failing.ready
        failing.close()


@TWO
def test_a_core_on_which_work_was_begun_is_not_shared() -> None:
    here = os.getpid()
    end, begin = os.pipe()

    def piece(_: int) -> int:
        time.sleep(0.05)
        return os.getpid()

    with on_cores(2):
        work = Background(lambda: os.read(end, 1))
        assert shared(piece, range(4)) == 4 * [here]
        os.write(begin, b"x")
        assert work.result() == b"x"
        assert len(set(shared(piece, range(4)))) == 2  # it is free again
        work = Background(lambda: os.read(end, 1))
        work.close()
        assert len(set(shared(piece, range(4)))) == 2
    os.close(end)
    os.close(begin)


@TWO
def test_spare_work_leaves_the_cores_to_other_work_and_is_never_waited_for() -> None:
    def nice() -> int:
        return os.getpriority(os.PRIO_PROCESS, 0)

    here, usual = os.getpid(), nice()
    assert Background(nice, spare=True).result() == usual  # in the process itself nothing else is changed
    end, begin = os.pipe()
    with on_cores(2):
        assert Background(nice).result() == usual
        work = Background(nice, spare=True)
        while not work.ready:
            time.sleep(0.01)
        assert work.result() == min(usual + parallel.SPARE_NICENESS, 19)
        begun = Background(lambda: os.getpid() if os.getpid() == here else time.sleep(60), spare=True)
        assert begun.result() == here  # on a busy machine its copy would not have begun
        work = Background(lambda: os.read(end, 1), spare=True)
        assert len(set(shared(lambda _: (time.sleep(0.05), os.getpid())[1], range(4)))) == 2
        work.close()
    assert nice() == usual
    os.close(end)
    os.close(begin)


@TWO
def test_what_fails_in_a_copy_fails_here() -> None:
    def piece(k: int) -> int:
        time.sleep(0.02)
        if k == 3:
            raise ValueError(f"piece {k}")
        return k

    with on_cores(2):
        with pytest.raises(ValueError, match="piece 3"):
            shared(piece, range(6))
        with pytest.raises(ZeroDivisionError):
            Background(lambda: 1 // 0).result()


@TWO
def test_a_killed_copy_is_replaced() -> None:
    here = os.getpid()

    def piece(k: int) -> int:
        time.sleep(0.02)
        if os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)
        return k

    with on_cores(2):
        assert shared(piece, range(6)) == list(range(6))
        assert Background(lambda: piece(7)).result() == 7


@TWO
def test_no_process_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[int] = []
    fork = os.fork

    def counted() -> int:
        begun.append(fork())
        return begun[-1]

    monkeypatch.setattr(parallel.os, "fork", counted)
    with on_cores(2):
        shared(abs, range(4))
        Background(lambda: time.sleep(60)).close()
        with pytest.raises(KeyboardInterrupt):
            shared(lambda k: (_ for _ in ()).throw(KeyboardInterrupt), range(4))
    for number in begun:
        with pytest.raises(ProcessLookupError):
            os.kill(number, 0)


@TWO
def test_a_stop_ends_a_copy_that_is_waited_for() -> None:
    here, begin = os.getpid(), time.monotonic()

    def work(_: int = 0) -> str:
        if os.getpid() != here:
            time.sleep(60)
        time.sleep(0.05)
        return "not in the copy"

    with on_cores(2), stopped_by(lambda: time.monotonic() > begin + 0.2):
        assert Background(work).result() == "not in the copy"
    begin = time.monotonic()
    with on_cores(2), stopped_by(lambda: time.monotonic() > begin + 0.2):
        assert shared(work, range(3)) == 3 * ["not in the copy"]
    assert time.monotonic() < begin + 30


@TWO
@pytest.mark.parametrize("call", ["fork", "pipe"])
def test_without_more_processes_or_files_one_core_works(monkeypatch: pytest.MonkeyPatch, call: str) -> None:
    def refused(**_: object) -> None:
        raise BlockingIOError("Resource temporarily unavailable")

    if call == "fork":
        monkeypatch.setattr(parallel.os, "fork", refused)
    else:
        monkeypatch.setattr(parallel, "Pipe", refused)
    with on_cores(2):
        assert shared(lambda k: k**2, range(4)) == [0, 1, 4, 9]
        assert Background(lambda: 7).result() == 7
        Background(lambda: 7).close()


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
