"""Batches on a real scheduler and separate workers of this machine: `python -m benchmarks.batch COMMAND`.

    faults    a worker is killed, then the scheduler; both are started again: nothing is lost or counted twice
    speed     the same sets on one worker and on two
    schedule  cost of a task for scheduler and client, and what 10,000 small sets take by that

The exit code is 1 if a claim does not hold.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Literal

import psutil

from benchmarks.command import command
from flexviz.base.resources import sessions_dir
from flexviz.data.measurements import overview
from flexviz.outlets.batch import ClusterChoice, read_batch, spread

DEMO = sessions_dir() / "planar-2r-demo"
SETS = 24
KILL_WORKER_AT, KILL_SCHEDULER_AT = 6, 12  # finished sets
TASKS = 10_000
LEAST_BUSY = 0.8  # share of the time; on idle cores two workers are then 1.6 times as fast as one or faster
ENVIRONMENT = os.environ | {"OPENBLAS_NUM_THREADS": "1"}


def make_sets(folder: Path, count: int) -> Path:
    """Copies of the example that differ in their rough start values, so that each is work of its own."""
    for number in range(count):
        copied = folder / f"robot-{number % 4}" / f"run{number // 4 + 1}"
        shutil.copytree(DEMO, copied)
        file = copied / "measurements.toml"
        text = file.read_text(encoding="utf-8")
        first = re.search(r"stiffness = \[([\d.]+)", text)
        assert first is not None
        new = f"{text[: first.start(1)]}{float(first[1]) + number}{text[first.end(1) :]}"
        file.write_text(new, encoding="utf-8")
    return folder


@contextmanager
def running(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """A process of dask; its messages are dropped."""
    program = [sys.executable, "-c", "from distributed.cli.dask_" + arguments[0] + " import main; main()"]
    process = subprocess.Popen(
        [*program, *arguments[1:]], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=ENVIRONMENT
    )
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def scheduler(port: int) -> tuple[str, ...]:
    return ("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard")


def worker(port: int) -> tuple[str, ...]:
    address = f"tcp://127.0.0.1:{port}"
    return ("worker", address, "--host", "127.0.0.1", "--nthreads", "1", "--no-dashboard", "--no-nanny")


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def finished(out: Path) -> int:
    return len(list(out.glob("done/*/*.json")))


def batch(source: Path, out: Path, port: int) -> subprocess.Popen[str]:
    """`flexviz batch` in a process of its own."""
    words = ["batch", str(source), "--out", str(out), "--no-diagnose"]
    address = f"tcp://127.0.0.1:{port}"
    return subprocess.Popen(
        [sys.executable, "-m", "flexviz", *words, "--scheduler", address],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=ENVIRONMENT,
    )  # fmt: skip


def wait_for(out: Path, count: int, process: subprocess.Popen[str]) -> None:
    while finished(out) < count:
        if process.poll() is not None:
            raise SystemExit(f"the batch ended early: {process.stdout.read() if process.stdout else ''}")
        time.sleep(0.05)


def faults(folder: Path) -> bool:
    """Kill a worker and the scheduler; compare with a run without faults."""
    source, out, port = make_sets(folder / "sets", SETS), folder / "out", free_port()
    with ExitStack() as stack:
        first = stack.enter_context(running(*scheduler(port)))
        workers = [stack.enter_context(running(*worker(port))) for _ in range(2)]
        process = batch(source, out, port)
        wait_for(out, KILL_WORKER_AT, process)
        workers[0].send_signal(signal.SIGKILL)
        print(f"{finished(out)} of {SETS} sets done: one of two workers killed")
        wait_for(out, KILL_SCHEDULER_AT, process)
        first.send_signal(signal.SIGKILL)
        print(f"{finished(out)} of {SETS} sets done: scheduler killed")
        time.sleep(3)
        at_restart = finished(out)
        stack.enter_context(running(*scheduler(port)))
        for _ in range(2):
            stack.enter_context(running(*worker(port)))
        print(f"{at_restart} of {SETS} sets done: scheduler and two workers started")
        said, _ = process.communicate(timeout=300)
        again = batch(source, out, port)
        said_again, _ = again.communicate(timeout=120)
        calm = batch(source, folder / "calm", port)
        calm.communicate(timeout=300)
    print(
        *[f"    {line}" for line in said.splitlines() if "scheduler" in line or "computed" in line], sep="\n"
    )
    rows, undisturbed = read_batch(out), read_batch(folder / "calm")
    keys = {row.key for row in rows}
    same = [a.parameters == b.parameters and a.key == b.key for a, b in zip(rows, undisturbed, strict=True)]
    claims = {
        f"exit code {process.returncode}": process.returncode == 0,
        f"{len(rows)} rows of {len(keys)} different sets, all done": len(rows) == len(keys) == SETS
        and all(row.state == "done" for row in rows),
        f"{finished(out)} results kept": finished(out) == SETS,
        f"{sum(same)} rows with exactly the values of a run without faults": all(same),
        "the same command again computes nothing": f"computed now: 0; kept from before: {SETS}" in said_again,
    }
    return report(claims)


def speed(folder: Path) -> bool:
    """The same work with one and with two workers, and how busy these are, whatever else runs."""
    source, busy = make_sets(folder / "sets", SETS), {}
    for count in (1, 2):
        port = free_port()
        with ExitStack() as stack:
            stack.enter_context(running(*scheduler(port)))
            for _ in range(count):
                stack.enter_context(running(*worker(port)))
            warm = batch(make_sets(folder / f"warm{count}", 2), folder / f"warm-out{count}", port)
            warm.communicate(timeout=120)
            out = folder / f"out{count}"
            process = batch(source, out, port)
            wait_for(out, 1, process)
            began = time.perf_counter()
            wait_for(out, SETS, process)
            taken = time.perf_counter() - began
            process.communicate(timeout=60)
        work = sum(row.seconds or 0.0 for row in read_batch(out)) * (SETS - 1) / SETS
        busy[count] = work / (count * taken)
        print(f"{count} worker(s): {SETS - 1} sets, {work:.1f} s of work, in {taken:.1f} s")
    said = {count: f"{count} worker(s) busy {100 * share:.0f} % of the time" for count, share in busy.items()}
    return report({said[count]: share > LEAST_BUSY for count, share in busy.items()})


def nothing(text: str) -> str:
    """A task that costs nothing."""
    return text


def schedule(folder: Path) -> bool:
    """Measured cost of 10,000 tasks that do nothing, and what the same number of sets takes by that."""
    port = free_port()
    text = json.dumps(
        {"kind": "set", "key": 64 * "0", "what": {"sha256": 64 * "0"}, "where": {"path": "/x" * 30}}
    )
    with ExitStack() as stack:
        central = psutil.Process(stack.enter_context(running(*scheduler(port))).pid)
        for _ in range(2):
            stack.enter_context(running(*worker(port)))
        where = ClusterChoice(scheduler=f"tcp://127.0.0.1:{port}")
        began = time.process_time()
        answers = {a.name for a in spread(nothing, ((str(i), text) for i in range(TASKS)), where) if a.text}
        client = (time.process_time() - began) / TASKS
        per_task = max(client, central.cpu_times().user / TASKS)  # the slower of the two sets the pace
    (one,) = make_sets(folder / "one", 1).glob("*/*")
    began = time.process_time()
    overview(one)
    per_hash = time.process_time() - began
    print(f"{len(answers)} tasks: client {1000 * client:.2f} ms, pace {1000 * per_task:.2f} ms of CPU each")
    print(f"hashing a set of 1.8 MB: {1000 * per_hash:.1f} ms")
    for work in (0.5, 5.0):
        for workers in (2, 8, 32, 128):
            bound = max(TASKS * work / workers, TASKS * per_task) + TASKS * per_hash + work
            used = TASKS * work / workers / bound
            taken = f"{bound / 60:6.1f} min, workers {100 * used:.0f} % busy"
            print(f"{TASKS} sets of {work} s on {workers:3d} workers: {taken}")
    return report({f"all {TASKS} tasks came back once": len(answers) == TASKS})


def report(claims: dict[str, bool]) -> bool:
    for claim, holds in claims.items():
        print(f"{'holds' if holds else 'FAILS'}: {claim}")
    return all(claims.values())


@command
def main(what: Literal["faults", "speed", "schedule"]) -> int:
    with tempfile.TemporaryDirectory() as folder:
        return 0 if {"faults": faults, "speed": speed, "schedule": schedule}[what](Path(folder)) else 1


if __name__ == "__main__":
    sys.exit(main())
