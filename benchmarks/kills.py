"""Is a session ever lost? A process saves it over and over and is killed (−9) at a random moment, many times.

    python -m benchmarks.kills [KILLS]

After each kill the session must open, and must hold what was saved last: the last save that had returned, or
the one under way. Every save has results of its own, so that files are added and removed all the time.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.command import command
from flexviz.analysis.identification import identify
from flexviz.base.resources import sessions_dir
from flexviz.content.session import Session, open_session, save_session
from flexviz.data.measurements import MeasurementSet, read_set

SEED = 5


def numbered(session: Session, number: int) -> Session:
    """The session with results that no other save has; its last note is the number."""
    result = session.analysis.identification
    assert result is not None
    result = replace(result, covariance=result.covariance + number)
    analysis = session.analysis.with_identification(result, session.analysis.settings)
    return replace(session, present=replace(session.present, analysis=analysis)).with_note(str(number))


def save_on(session: Session, measurements: MeasurementSet, folder: Path, number: int, done: int) -> None:
    """Save number, number + 1, …; after each, its number goes to the descriptor `done`."""
    while True:
        save_session(numbered(session, number), measurements, folder)
        os.write(done, number.to_bytes(8, "big"))
        number += 1


def timed(session: Session, measurements: MeasurementSet, folder: Path) -> float:
    """How long a save takes [s]."""
    begin = time.perf_counter()
    save_session(session, measurements, folder)
    return time.perf_counter() - begin


def killed(session: Session, measurements: MeasurementSet, folder: Path, number: int, wait: float) -> int:
    """Start saving at `number`, kill after `wait` [s] of it; returns the last number whose save returned."""
    receiver, sender = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.close(receiver)
            save_on(session, measurements, folder, number, sender)
        finally:
            os._exit(1)
    os.close(sender)
    with os.fdopen(receiver, "rb") as source:
        saved = source.read(8)  # the first one has been saved
        time.sleep(wait)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        saved += source.read()
    assert saved, "the process ended by itself"
    return int.from_bytes(saved[-8:], "big")


def check(folder: Path, last: int) -> str:
    """What is wrong with the session in a folder; "" where nothing is."""
    try:
        opened = open_session(folder)
    except Exception as error:
        return f"does not open: {error}"
    found = int(opened.session.notes[-1].text)
    result = opened.session.analysis.identification
    if found not in (last, last + 1):
        return f"holds save {found}, {last} had returned"
    if result is None or not np.isfinite(result.covariance).all():
        return "has no result"
    return ""


@command
def main(kills: int = 20) -> int:
    """Kill, open, count."""
    choose = random.Random(SEED)
    measurements = read_set(sessions_dir() / "planar-2r-demo")
    session = Session.of(measurements)
    analysis = session.analysis
    result = identify(measurements, max_iterations=1, refine=False)
    session = session.then("identified", analysis.with_identification(result, analysis.settings))
    wrong: list[str] = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "session"
        seconds = min(timed(numbered(session, number), measurements, folder) for number in range(3))
        number = 2
        for _ in range(kills):
            number = killed(session, measurements, folder, number + 1, choose.uniform(0.0, 2.0) * seconds)
            problem = check(folder, number)
            if problem:
                wrong.append(problem)
        left = sum(1 for _ in folder.rglob("*") if _.is_file())
    print(f"{kills} kills during {number} saves of about {1e3 * seconds:.0f} ms each")
    print(f"{kills - len(wrong)} sessions open and hold what was saved last; {left} files at the end")
    for problem in wrong:
        print(problem)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
