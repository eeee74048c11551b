"""How quick the app is: first page, bandwidth slider, playback beside the solver.

    python benchmarks/app.py

Prints the time from starting the command to the first complete page, the time from a bandwidth change to
new plot data for 20 s × 1 kHz × 7 joints (median and 95th percentile), and the frames a second that playback
reaches alone and while an identification runs.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from flexviz.app import DEMO
from flexviz.app.application import Application
from flexviz.app.server import start_server
from flexviz.app.work import open_set
from flexviz.measurements import GroupTable, write_set
from flexviz.resources import sessions_dir
from flexviz.robot import Robot

SAMPLES, RATE, JOINTS = 20_000, 1000.0, 7


def first_page() -> float:
    """Seconds from starting `flexviz serve` to the page being there."""
    begin = time.monotonic()
    command = [sys.executable, "-m", "flexviz", "serve", "--no-browser", "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert process.stdout is not None
    address = next(word for word in process.stdout.readline().split() if word.startswith("http"))
    with urllib.request.urlopen(address, timeout=30) as answer:
        assert len(answer.read()) > 100_000
    seconds = time.monotonic() - begin
    process.terminate()
    process.wait()
    return seconds


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


def wait(application: Application, condition: Callable[[], bool], timeout: float = 120.0) -> None:
    """Let the application's loop run until the condition holds."""
    deadline = time.monotonic() + timeout
    while not condition() and time.monotonic() < deadline:
        application.once(0.01)


def frame_rate(application: Application, condition: Callable[[], bool]) -> tuple[float, float]:
    """Frames a second until the condition holds, and how long that took [s]."""
    frames, begin = application.show.playback.frames, time.monotonic()
    wait(application, condition)
    seconds = time.monotonic() - begin
    return (application.show.playback.frames - frames) / seconds, seconds


def bandwidth_times(application: Application, count: int = 40) -> np.ndarray:
    """Seconds from a bandwidth event to the new data being queued for the browsers, (count,)."""
    taken = []
    for bandwidth in np.linspace(20.0, 200.0, count):
        application.queue.put("bandwidth", float(bandwidth))
        begin = time.perf_counter()
        while len(application.queue):
            application.once(0.0)
        taken.append(time.perf_counter() - begin)
    return np.array(taken)


def main() -> None:
    print(f"first page           {first_page():8.2f} s")
    server: Any = start_server("127.0.0.1", 0)
    with tempfile.TemporaryDirectory() as folder:
        application = Application(server, open_set(panda_set(Path(folder) / "panda")))
        wait(application, lambda: not application.worker.busy)
        taken = 1000.0 * bandwidth_times(application)
        print(
            f"bandwidth → plot data {np.median(taken):7.1f} ms median, {np.quantile(taken, 0.95):.1f} ms p95"
        )
        application.open(open_set(sessions_dir() / DEMO))
        begin = time.monotonic()
        rate, _ = frame_rate(application, lambda: time.monotonic() - begin > 3.0)
        print(f"playback alone       {rate:8.1f} frames/s")
        application.queue.put("refine", True)
        application.queue.put("run")
        application.once(0.0)
        application.once(0.0)
        rate, seconds = frame_rate(application, lambda: not application.identify.running)
        print(f"playback beside a fit {rate:7.1f} frames/s over {seconds:.1f} s")
        application.close()
    server.stop()


if __name__ == "__main__":
    main()
