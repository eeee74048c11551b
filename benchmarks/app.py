"""How quick and how steady the app is: first page, bandwidth slider, playback beside the solver, memory.

    python benchmarks/app.py [--minutes 5] [--only page,bandwidth,playback,memory]

Prints, beside each figure, what it is to be, their ratio, and the machine's load while it was taken: on a
busy machine the wall time is that of a queue, so the CPU time of the same work stands beside it.

- page: from starting the command to the first complete page.
- bandwidth: from a bandwidth event to the new data being queued for the browsers, 20 s × 1 kHz × 7 joints.
- tuning: the same with the residual of the identified model on all joints, and frames a second meanwhile.
- playback: frames a second alone, while an identification with refinement runs, and while a diagnosis does,
  which shares the cores.
- memory: resident memory of the server while it plays to a connected page, and a straight line through it
  after the first fifth, continued to an hour with its own standard error.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from flexviz.analysis.identification import identify
from flexviz.base.jobs import Task
from flexviz.base.resources import sessions_dir
from flexviz.data.measurements import GroupTable, write_set
from flexviz.outlets.app import DEMO
from flexviz.outlets.app.application import Application
from flexviz.outlets.app.server import start_server
from flexviz.outlets.app.sets import open_set
from flexviz.outlets.app.tasks import Diagnose, Identify
from flexviz.robot.robot import Robot

SAMPLES, RATE, JOINTS = 20_000, 1000.0, 7
PAGE, SLIDER, GROWTH = 3.0, 0.05, 50.0  # [s], [s], [MB an hour]: what they are to stay below
FRAMES = 30.0  # a second, at least
PARTS = ("page", "bandwidth", "tuning", "playback", "memory")
TUNED = ("butterworth-zero-phase", "eso")


def line(name: str, figure: str, target: str, ratio: float) -> None:
    """One figure."""
    print(
        f"{name:27s} {figure:46s} {target:>12s}  ratio {ratio:5.2f}  load {os.getloadavg()[0]:.1f}",
        flush=True,
    )


@contextmanager
def served(*arguments: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """`flexviz serve` in a folder of its own, and its address."""
    command = [sys.executable, "-m", "flexviz", "serve", *arguments, "--no-browser", "--port", "0"]
    with tempfile.TemporaryDirectory() as folder:
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=folder
        )
        try:
            assert process.stdout is not None
            yield process, next(w for w in process.stdout.readline().split() if w.startswith("http"))
        finally:
            process.terminate()
            process.wait()


def first_page() -> None:
    """From starting `flexviz serve` to the page being there."""
    begin = time.monotonic()
    with served() as (process, address):
        with urllib.request.urlopen(address, timeout=60) as answer:
            assert len(answer.read()) > 100_000
        seconds, cpu = time.monotonic() - begin, sum(psutil.Process(process.pid).cpu_times()[:2])
    line("first page", f"{seconds:.2f} s, {cpu:.2f} s of CPU", f"< {PAGE:g} s", seconds / PAGE)


def panda_set(folder: Path) -> Path:
    """20 s × 1 kHz × 7 joints of smooth motion in two groups."""
    names = [f"panda_joint{i}" for i in range(1, JOINTS + 1)]
    robot = Robot.load("example-robot-data:panda", names)
    time_ = np.arange(SAMPLES) / RATE
    middle = (robot.lower_limit + robot.upper_limit) / 2
    tables = []
    for group, offset in (("g1", 0.0), ("g2", 0.7)):
        theta = middle + 0.4 * np.sin(np.outer(time_, 1.0 + 0.3 * np.arange(JOINTS)) + offset)
        tau = 10.0 * np.cos(np.outer(time_, 1.0 + 0.3 * np.arange(JOINTS)) + offset)
        tables.append(GroupTable(group, group, "none", time_, theta, tau, validation=group == "g2"))
    return write_set(
        folder, robot="example-robot-data:panda", joints=names, groups=tables, payloads={"none": ()}
    )


@contextmanager
def application(measurement_set: Path) -> Iterator[Application]:
    """The application in this process, in a folder of its own."""
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        server: Any = start_server("127.0.0.1", 0)
        app = Application(server, open_set(measurement_set))
        app.display.watched = lambda: True  # as if a page were shown
        try:
            yield app
        finally:
            app.close()
            server.stop()
            os.chdir(here)


def wait(app: Application, condition: Callable[[], bool], timeout: float = 600.0) -> None:
    """Let the application's loop run until the condition holds."""
    deadline = time.monotonic() + timeout
    while not condition() and time.monotonic() < deadline:
        app.once(0.01)


def bandwidth(count: int = 60) -> None:
    """From a bandwidth event to the new data being queued for the browsers."""
    with tempfile.TemporaryDirectory() as folder, application(panda_set(Path(folder) / "panda")) as app:
        wait(app, lambda: not app.tasks.busy)

        drag(app, "bandwidth → plot data", count)


def tuning(count: int = 60) -> None:
    """From a bandwidth event to the residual of all joints, and playback meanwhile."""
    with tempfile.TemporaryDirectory() as folder, application(panda_set(Path(folder) / "panda")) as app:
        wait(app, lambda: not app.tasks.busy)
        store = app.store
        for effects in ((), ("coulomb_friction",)):
            result = identify(
                store.measurements, effects=effects, observer="eso", max_iterations=1, refine=False
            )
            for observer in TUNED:
                analysis = store.analysis.with_fit(observer=observer, bandwidth=20.0, effects=effects)
                store.change("observer", analysis.with_identification(result, analysis.settings))
                store.tasks.stop()
                store.go("Observer")
                wait(app, lambda: not app.tasks.busy)
                drag(app, f"{observer[:4]}{' + friction' * bool(effects)} → residual", count, pause=0.05)


def drag(app: Application, name: str, count: int, pause: float = 0.0) -> None:
    """Send bandwidths as a slider does; with a pause [s] between them the playback's rate, too."""

    def set_bandwidth(width: float) -> None:
        app.store.change("bandwidth", app.store.analysis.with_fit(bandwidth=width))

    wall, cpu = [], []
    frames, started = app.display.playback.frames, time.monotonic()
    for width in np.linspace(20.0, 200.0, count):
        app.queue.call(set_bandwidth, float(width))
        begin, worked = time.perf_counter(), time.thread_time()
        while len(app.queue):
            app.once(0.0)
        wall.append(time.perf_counter() - begin)
        cpu.append(time.thread_time() - worked)
        time.sleep(pause)
    if pause:
        rate = (app.display.playback.frames - frames) / (time.monotonic() - started)
        line("playback meanwhile", f"{rate:.1f} frames/s", f">= {FRAMES:g} /s", rate / FRAMES)
    late, worked = float(np.quantile(wall, 0.95)), float(np.quantile(cpu, 0.95))
    figure = (
        f"{1e3 * late:.1f} ms p95, {1e3 * np.median(wall):.1f} ms median, {1e3 * worked:.1f} ms p95 of CPU"
    )
    line(name, figure, f"< {1e3 * SLIDER:g} ms", late / SLIDER)


def frame_rate(app: Application, condition: Callable[[], bool]) -> tuple[float, float]:
    """Frames a second until the condition holds, and how long that took [s]."""
    frames, begin = app.display.playback.frames, time.monotonic()
    wait(app, condition)
    seconds = time.monotonic() - begin
    return (app.display.playback.frames - frames) / seconds, seconds


def playback() -> None:
    """Frames a second alone, and while an identification runs."""
    with application(sessions_dir() / DEMO) as app:
        wait(app, lambda: not app.tasks.busy)
        begin = time.monotonic()
        rate, seconds = frame_rate(app, lambda: time.monotonic() - begin > 5.0)
        line(
            "playback alone", f"{rate:.1f} frames/s over {seconds:.1f} s", f">= {FRAMES:g} /s", rate / FRAMES
        )
        store = app.store
        store.change("refine", store.analysis.with_fit(refine=True))
        analysis = store.analysis.without_result()
        tasks: dict[str, Task[Any]] = {
            "a fit": Identify(analysis), "a diagnosis": Diagnose(analysis, None, apply=True),
        }  # fmt: skip
        for name, task in tasks.items():
            store.await_task(task, lambda result: None, begin="running", stopped="stopped")
            rate, seconds = frame_rate(app, lambda: not store.running)
            figure = f"{rate:.1f} frames/s over {seconds:.1f} s"
            line(f"playback beside {name}", figure, f">= {FRAMES:g} /s", rate / FRAMES)


def listen(address: str, stop: threading.Event) -> int:
    """A page that takes everything it is sent; returns how many bytes that was."""
    import viser
    from websockets.sync.client import connect

    taken = 0
    url = address.replace("http", "ws", 1)
    protocol: Any = f"viser-v{viser.__version__}"
    with connect(url, subprotocols=[protocol], max_size=None) as socket:
        while not stop.is_set():
            try:
                taken += len(socket.recv(timeout=0.5))
            except TimeoutError:
                continue
    return taken


def memory(minutes: float) -> None:
    """Resident memory of a server that plays to a connected page."""
    with served() as (process, address):
        stop = threading.Event()
        taken: list[int] = []
        page = threading.Thread(target=lambda: taken.append(listen(address, stop)), daemon=True)
        page.start()
        begin = time.monotonic()
        at, held = [], []
        while time.monotonic() - begin < 60.0 * minutes:
            time.sleep(1.0)
            at.append((time.monotonic() - begin) / 3600.0)
            held.append(psutil.Process(process.pid).memory_info().rss / 1e6)
        stop.set()
        page.join()
    settled = slice(len(at) // 5, None)
    (slope, _), covariance = np.polyfit(at[settled], held[settled], 1, cov=True)
    error = float(np.sqrt(covariance[0, 0]))
    figure = (
        f"{held[len(at) // 5]:.1f} → {held[-1]:.1f} MB in {minutes:g} min ({taken[0] / 1e6:.0f} MB sent): "
        f"{slope:+.1f} ± {1.96 * error:.1f} MB/h"
    )
    line("memory", figure, f"< {GROWTH:g} MB/h", slope / GROWTH)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=5.0, help="how long memory is watched")
    parser.add_argument("--only", default=",".join(PARTS), help="which figures, with commas")
    chosen = parser.parse_args()
    for part in chosen.only.split(","):
        {
            "page": first_page,
            "bandwidth": bandwidth,
            "tuning": tuning,
            "playback": playback,
            "memory": lambda: memory(chosen.minutes),
        }[part]()


if __name__ == "__main__":
    main()
