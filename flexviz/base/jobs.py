"""Background jobs: one worker, one task at a time, with progress, stopping and error messages.

A `Task` runs either in a child process, which does not block playback by the interpreter lock, or in a
thread, which avoids copying the result. Where the system hands no pipe to a child, all run in a thread.

The child is a fresh interpreter connected by one pipe (it never imports the program's main script), runs with
a single BLAS thread and a lower priority, and exits when the pipe closes. A task may share its work with
forked processes of the child (`flexviz.base.parallel`), which end with it. `in_children` registers
preparations for it. A `ProcessPoolExecutor` cannot end a task that does not stop, and gives no exit code.
"""

from __future__ import annotations

import contextlib
import importlib
import itertools
import math
import multiprocessing.connection as mpc
import os
import queue
import subprocess
import sys
import threading
import time
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import Pipe
from typing import Any, ClassVar, Generic, Literal, TypeVar

from flexviz.base.errors import Cancelled, FlexvizError, one_line
from flexviz.base.parallel import on_cores, usable_cores
from flexviz.base.progress import ProgressCallback, StopCallback

Result = TypeVar("Result")
Kind = Literal["progress", "done", "stopped", "failed"]
HANDS_PIPES = hasattr(os, "fork")  # to a child process
STOP_GRACE = 5.0  # [s] that a stopped task whose result nobody wants may take before its process is replaced
_CHILD = "; ".join(("import sys", f"from {__name__} import child_main", "child_main(int(sys.argv[1]))"))
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

Preparation = tuple[Callable[..., Any], tuple[Any, ...]]
_preparations: list[Preparation] = []


def in_children(function: Callable[..., Any], *args: Any) -> None:
    """Have every child process, also a running one, call `function(*args)` before its next task.

    If the call fails there, the next task fails with its reason.
    """
    _preparations.append((function, args))


def forget_in_children(function: Callable[..., Any], *args: Any) -> None:
    """Do not call it in children that start from now on."""
    _preparations[:] = [entry for entry in _preparations if entry != (function, args)]


class Task(ABC, Generic[Result]):
    """A kind of work: a frozen dataclass whose fields are its arguments. It is pickled to reach the child."""

    in_process: ClassVar[bool] = True  # whether it runs in the child process, else in a thread of this one

    @abstractmethod
    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> Result:
        """Do the work. Return a partial result, or raise `Cancelled`, soon after `should_stop()` is true."""

    @property
    def kind(self) -> Hashable:
        """Of waiting tasks of the same kind only the last one is run."""
        return type(self)


class InThread(Task[Result]):
    """The call of a function in a thread of this process."""

    in_process = False

    def __init__(self, function: Callable[..., Result], *arguments: Any) -> None:
        self._function, self._arguments = function, arguments

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> Result:
        return self._function(*self._arguments)

    @property
    def kind(self) -> Hashable:
        return self._function


class InChild(InThread[Result]):
    """The call of a function of a module in the child process, which may fail or crash there."""

    in_process = True


@dataclass(frozen=True)
class LoadModules(Task[None]):
    """Import modules, so that the first real task starts at once."""

    names: tuple[str, ...]

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> None:
        for name in self.names:
            if should_stop():
                return
            importlib.import_module(name)


@dataclass(frozen=True)
class JobEvent:
    """News of a job: `value` is the progress, the result, or the one-line reason of a failure."""

    kind: Kind
    value: Any = None


@dataclass(eq=False)
class Job:
    """A task that was submitted."""

    number: int
    task: Task[Any]
    listener: Callable[[JobEvent], None]
    stop: threading.Event = field(default_factory=threading.Event)
    deadline: float = math.inf  # of a stopped one [s, monotonic]

    def end(self, grace: float) -> None:
        """Ask the task to stop within `grace` [s]."""
        self.deadline = min(self.deadline, time.monotonic() + grace)
        self.stop.set()

    def tell(self, kind: Kind, value: Any = None) -> None:
        """Tell the listener."""
        try:
            self.listener(JobEvent(kind, value))
        except Exception:  # a listener's mistake must not end the worker
            traceback.print_exc()


class Worker:
    """Runs tasks one after the other. All methods may be called from any thread and return at once."""

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
    def busy(self) -> bool:
        """True while a job runs or waits."""
        with self._change:
            return self._current is not None or bool(self._waiting)

    def submit(self, task: Task[Any], listener: Callable[[JobEvent], None]) -> Job:
        """Queue a task, in place of a waiting one of its kind; `listener` runs in the worker's thread."""
        job = Job(next(self._numbers), task, listener)
        with self._change:
            if self._closed:
                raise FlexvizError("the worker is closed")
            stale = self._drop(lambda waiting: waiting.kind == task.kind)
            self._waiting.append(job)
            self._change.notify_all()
        for old in stale:
            old.tell("stopped")
        return job

    def stop(self, kind: type[Task[Any]] = Task, grace: float | None = None) -> None:
        """Ask the running task to stop and drop the waiting ones, where they are of this class.

        A task in the child process that has not ended after `grace` [s] (None: `STOP_GRACE`) is ended with
        its process; infinite: it may take its time to conclude what it has found.
        """
        with self._change:
            stale = self._drop(lambda waiting: isinstance(waiting, kind))
            if self._current is not None and isinstance(self._current.task, kind):
                self._current.end(STOP_GRACE if grace is None else grace)
        for job in stale:
            job.tell("stopped")

    def _drop(self, which: Callable[[Task[Any]], bool]) -> list[Job]:
        """Take these tasks from the waiting ones."""
        stale = [job for job in self._waiting if which(job.task)]
        self._waiting = [job for job in self._waiting if job not in stale]
        return stale

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
            apart = job.task.in_process and HANDS_PIPES
            kind, value = _outcome(partial(self._in_child if apart else self._in_thread, job))
            with self._change:
                self._current = None
            job.tell(kind, value)

    def _in_thread(self, job: Job) -> Any:
        return job.task.run(partial(job.tell, "progress"), job.stop.is_set)

    def _in_child(self, job: Job) -> Any:
        if self._child is None or not self._child.alive:
            self._child = _Child()
        child = self._child
        new = [preparation for preparation in _preparations if preparation not in child.prepared]
        child.send("run", job.number, (new, job.task))
        child.prepared += new
        asked = False
        while True:
            if job.stop.is_set() and not asked:
                asked = True
                child.send("stop", job.number)
            if self._closed or time.monotonic() > job.deadline:
                child.kill()
                raise Cancelled
            for kind, value in child.receive(0.02):
                if kind == "done":
                    return value
                if kind == "stopped":
                    raise Cancelled
                if kind == "failed":
                    raise FlexvizError(value)
                job.tell(kind, value)


class _Child:
    """The parent's end of the child process."""

    def __init__(self) -> None:
        self.prepared: list[Preparation] = []
        self._pipe, theirs = Pipe()
        environment = os.environ | dict.fromkeys(_THREADS, "1")
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", _CHILD, str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=2,  # the program's own output is left to it
            env=environment | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
            start_new_session=True,  # only the parent handles Ctrl+C
        )
        theirs.close()

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    def send(self, kind: Literal["run", "stop"], number: int, content: Any = None) -> None:
        try:
            self._pipe.send((kind, number, content))
        except (BrokenPipeError, ConnectionError):
            raise FlexvizError(
                f"the worker process ended unexpectedly (exit code {self._exit_code()})"
            ) from None

    def receive(self, timeout: float) -> list[tuple[Kind, Any]]:
        """The next message, if one comes in time."""
        try:
            return [self._pipe.recv()] if self._pipe.poll(timeout) else []
        except (EOFError, ConnectionError):
            raise FlexvizError(
                f"the worker process ended unexpectedly (exit code {self._exit_code()})"
            ) from None

    def kill(self) -> None:
        self._pipe.close()
        self._process.kill()
        self._process.wait()

    def _exit_code(self) -> int | None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=1.0)
        return self._process.poll()


def child_main(descriptor: int) -> None:
    """The child process: run the tasks that come through the pipe until it closes."""
    with contextlib.suppress(OSError, AttributeError):  # not everywhere
        os.nice(5)  # playback and the page have priority
    pipe, here = mpc.Connection(descriptor), os.getpid()
    lock = threading.Lock()
    stopped: set[int] = set()  # numbers of tasks
    waiting: queue.SimpleQueue[tuple[int, list[Preparation], Task[Any]]] = queue.SimpleQueue()

    def send(kind: Kind, value: Any) -> None:
        if os.getpid() == here:  # a copy is silent: its messages would mix with those of this process
            with lock:
                pipe.send((kind, value))

    def read() -> None:
        while True:
            try:
                kind, number, content = pipe.recv()
            except (EOFError, OSError):
                os._exit(0)
            except Exception as error:  # a task that cannot be unpickled here
                send("failed", one_line(f"{type(error).__name__}: {error}"))
                continue
            if kind == "stop":
                stopped.add(number)
            else:
                waiting.put((number, *content))

    def work(number: int, preparations: list[Preparation], task: Task[Any]) -> None:
        for function, args in preparations:
            function(*args)
        with on_cores(usable_cores()):
            result = task.run(partial(send, "progress"), lambda: number in stopped)
        send("done", result)

    threading.Thread(target=read, daemon=True).start()
    while True:
        number, preparations, task = waiting.get()
        ended, value = _outcome(partial(work, number, preparations, task))
        if ended != "done":
            send(ended, value)


def _outcome(work: Callable[[], Any]) -> tuple[Kind, Any]:
    """How a piece of work ended, with its result or the reason of its failure."""
    try:
        return "done", work()
    except Cancelled:
        return "stopped", None
    except FlexvizError as error:
        return "failed", str(error)
    except Exception as error:
        traceback.print_exc()
        return "failed", one_line(f"{type(error).__name__}: {error}")
