"""Long work beside the screen: one worker, one job at a time, with progress, cancelling, reasons for failure.

A job is a module-level function `f(*args, progress, should_stop)` (see `flexviz.progress`). It runs either
in a child process, where it cannot hold the interpreter lock that playback needs, or in a thread of this
process, where its result need not be copied.

The child is a fresh interpreter connected by one pipe (it never imports the program's main script), runs with
a single BLAS thread and a lower priority, and ends by itself when the pipe closes. `in_children` says what it
has to do before its first job.
"""

from __future__ import annotations

import contextlib
import itertools
import multiprocessing.connection as mpc
import os
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from multiprocessing import Pipe
from typing import Any, Literal

from flexviz.errors import Cancelled, FlexvizError, one_line
from flexviz.progress import ProgressCallback, StopCallback

Kind = Literal["started", "progress", "done", "stopped", "failed"]
STOP_GRACE = 5.0  # [s] a stopped job may take to end by itself before its process is replaced
_CHILD = "import sys; from flexviz.jobs import child_main; child_main(int(sys.argv[1]))"
_PREPARE = 0  # number of a preparation among the jobs
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


_preparations: list[tuple[Callable[..., Any], tuple[Any, ...]]] = []


def in_children(function: Callable[..., Any], *args: Any) -> None:
    """Have every child process, also those that run already, call `function(*args)` before its next job.

    Where it fails there, the next job fails with its reason.
    """
    _preparations.append((function, args))


def forget_in_children(function: Callable[..., Any], *args: Any) -> None:
    """Do not call it in children that are started from now on."""
    _preparations[:] = [entry for entry in _preparations if entry != (function, args)]


@dataclass(frozen=True)
class JobEvent:
    """What a job has to say: `value` is the progress, the result, or (failed) the one-line reason."""

    job: Job
    kind: Kind
    value: Any = None


@dataclass(eq=False)
class Job:
    """One piece of work. `key` says what it is for: a newer job with the same key replaces a waiting one."""

    number: int
    key: str
    function: Callable[..., Any]
    args: tuple[Any, ...]
    listener: Callable[[JobEvent], None]
    in_process: bool = True
    state: Literal["waiting", "running", "done", "stopped", "failed"] = "waiting"
    stop: threading.Event = field(default_factory=threading.Event)
    finished: threading.Event = field(default_factory=threading.Event)


class Worker:
    """Runs jobs one after the other. All methods may be called from any thread and return at once."""

    def __init__(self) -> None:
        self._numbers = itertools.count(1)
        self._waiting: list[Job] = []
        self._current: Job | None = None
        self._change = threading.Condition()
        self._closed = False
        self._child: _Child | None = None
        self._thread = threading.Thread(target=self._run, name="flexviz-jobs", daemon=True)
        self._thread.start()

    @property
    def current(self) -> Job | None:
        """The running job, if any."""
        return self._current

    @property
    def busy(self) -> bool:
        """True while a job runs or waits."""
        with self._change:
            return self._current is not None or bool(self._waiting)

    def submit(
        self,
        key: str,
        function: Callable[..., Any],
        *args: Any,
        listener: Callable[[JobEvent], None],
        in_process: bool = True,
    ) -> Job:
        """Queue `function(*args, progress=…, should_stop=…)`; `listener` is called in the worker's thread."""
        job = Job(next(self._numbers), key, function, args, listener, in_process)
        with self._change:
            if self._closed:
                raise FlexvizError("the worker is closed")
            stale = [waiting for waiting in self._waiting if waiting.key == key]
            self._waiting = [waiting for waiting in self._waiting if waiting.key != key] + [job]
            self._change.notify_all()
        for old in stale:
            self._end(old, "stopped", None)
        return job

    def stop(self, key: str | None = None) -> None:
        """Ask the running job (of this key) to stop and drop the waiting ones (of this key)."""
        with self._change:
            stale = [job for job in self._waiting if key in (None, job.key)]
            self._waiting = [job for job in self._waiting if job not in stale]
            if self._current is not None and key in (None, self._current.key):
                self._current.stop.set()
        for job in stale:
            self._end(job, "stopped", None)

    def close(self) -> None:
        """Stop everything and end the child process."""
        with self._change:
            self._closed = True
            self._change.notify_all()
        self.stop()
        self._thread.join(timeout=STOP_GRACE + 1.0)
        if self._child is not None:
            self._child.kill()
            self._child = None

    # -- the worker's thread -------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            with self._change:
                while not self._waiting and not self._closed:
                    self._change.wait()
                if not self._waiting:
                    return
                job = self._current = self._waiting.pop(0)
            job.state = "running"
            self._tell(job, "started", None)
            try:
                result = self._in_child(job) if job.in_process else self._in_thread(job)
                kind: Kind = "done"
            except Cancelled:
                kind, result = "stopped", None
            except FlexvizError as error:
                kind, result = "failed", str(error)
            except Exception as error:
                traceback.print_exc()
                kind, result = "failed", one_line(f"{type(error).__name__}: {error}")
            with self._change:
                self._current = None
            self._end(job, kind, result)

    def _in_thread(self, job: Job) -> Any:
        return job.function(
            *job.args, progress=lambda value: self._tell(job, "progress", value), should_stop=job.stop.is_set
        )

    def _in_child(self, job: Job) -> Any:
        if self._child is None or not self._child.alive:
            self._child = _Child()
        child = self._child
        for preparation in _preparations:
            if preparation not in child.prepared:
                child.send(("run", _PREPARE, *preparation))
                child.prepared.append(preparation)
        child.send(("run", job.number, job.function, job.args))
        asked: float | None = None
        while True:
            if job.stop.is_set() and asked is None:
                asked = time.monotonic()
                child.send(("stop", job.number))
            if self._closed or (asked is not None and time.monotonic() - asked > STOP_GRACE):
                child.kill()
                raise Cancelled
            message = child.receive(0.02)
            if message is None:
                continue
            kind, number, value = message
            if number not in (job.number, 0):
                continue
            if kind == "progress":
                self._tell(job, "progress", value)
            elif kind == "done":
                return value
            elif kind == "stopped":
                raise Cancelled
            else:
                raise FlexvizError(value)

    def _end(self, job: Job, kind: Kind, value: Any) -> None:
        job.state = "failed" if kind == "failed" else "stopped" if kind == "stopped" else "done"
        self._tell(job, kind, value)
        job.finished.set()

    def _tell(self, job: Job, kind: Kind, value: Any) -> None:
        try:
            job.listener(JobEvent(job, kind, value))
        except Exception:  # a listener's mistake must not end the worker
            traceback.print_exc()


class _Child:
    """The parent's end of the child process."""

    def __init__(self) -> None:
        self.prepared: list[tuple[Callable[..., Any], tuple[Any, ...]]] = []
        self._pipe, theirs = Pipe()
        environment = os.environ | dict.fromkeys(_THREADS, "1")
        self._process = subprocess.Popen(
            [sys.executable, "-c", _CHILD, str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=sys.stderr.fileno() if _has_fileno(sys.stderr) else None,
            env=environment | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
            start_new_session=True,  # Ctrl+C is the parent's to handle
        )
        theirs.close()

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    def send(self, message: Sequence[Any]) -> None:
        try:
            self._pipe.send(tuple(message))
        except (BrokenPipeError, ConnectionError):
            raise FlexvizError(self._reason()) from None

    def receive(self, timeout: float) -> tuple[str, int, Any] | None:
        try:
            return self._pipe.recv() if self._pipe.poll(timeout) else None
        except (EOFError, ConnectionError):
            raise FlexvizError(self._reason()) from None

    def kill(self) -> None:
        self._pipe.close()
        self._process.kill()
        self._process.wait()

    def _reason(self) -> str:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=1.0)
        return f"the worker process ended unexpectedly (exit code {self._process.poll()})"


def child_main(descriptor: int) -> None:
    """The child process: run the jobs that come through the pipe until it closes."""
    with contextlib.suppress(OSError):
        os.nice(5)  # playback and the page go first
    pipe = mpc.Connection(descriptor)
    lock = threading.Lock()
    stops: dict[int, threading.Event] = {}
    jobs: list[tuple[int, Callable[..., Any], tuple[Any, ...]]] = []
    change = threading.Condition()

    def send(kind: str, number: int, value: Any) -> None:
        with lock:
            pipe.send((kind, number, value))

    def read() -> None:
        while True:
            try:
                message = pipe.recv()
            except (EOFError, OSError):
                os._exit(0)
            except Exception as error:  # a job that cannot be unpickled here
                send("failed", 0, one_line(f"{type(error).__name__}: {error}"))
                continue
            if message[0] == "stop":
                stops.setdefault(message[1], threading.Event()).set()
            else:
                with change:
                    jobs.append(message[1:])
                    change.notify()

    threading.Thread(target=read, daemon=True).start()
    while True:
        with change:
            while not jobs:
                change.wait()
            number, function, args = jobs.pop(0)
        stop = stops.setdefault(number, threading.Event())
        try:
            if number == _PREPARE:
                function(*args)
                continue
            result = function(
                *args,
                progress=lambda value, number=number: send("progress", number, value),
                should_stop=stop.is_set,
            )
            send("done", number, result)
        except Cancelled:
            send("stopped", number, None)
        except FlexvizError as error:
            send("failed", number, str(error))
        except Exception as error:
            traceback.print_exc()
            send("failed", number, one_line(f"{type(error).__name__}: {error}"))
        stops.pop(number, None)


def load_modules(names: Sequence[str], *, progress: ProgressCallback, should_stop: StopCallback) -> None:
    """A job that imports modules, so that the first real one starts at once."""
    import importlib

    for name in names:
        if should_stop():
            return
        importlib.import_module(name)


def _has_fileno(stream: Any) -> bool:
    try:
        stream.fileno()
    except (AttributeError, OSError, ValueError):
        return False
    return True
