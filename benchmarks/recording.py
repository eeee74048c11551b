"""Recordings, measured: `python -m benchmarks.recording [SET] [--rounds N] [--kills N]`.

1. What live recording adds to a solve: the same identification with its iterations recorded and without, by
   turns; then what recording its result adds (residuals, parameters, texts, layout, all in the file).
2. `flexviz record` killed with -9 at random moments: how many files open or are repaired; none may be lost.
"""

from __future__ import annotations

import argparse
import random
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from flexviz.errors import InputError
from flexviz.identification import identify
from flexviz.measurements import MeasurementSet, read_set
from flexviz.recording import LiveRecording, TruncatedRecording, check_recording, repair_recording
from flexviz.resources import sessions_dir


@dataclass(frozen=True)
class Times:
    """Processor time of all threads and wall time of one part of the work [s]."""

    cpu: float
    wall: float


@contextmanager
def timed(into: list[Times]) -> Iterator[None]:
    """Add the time that the block takes."""
    begun = time.process_time(), time.perf_counter()
    yield
    into.append(Times(time.process_time() - begun[0], time.perf_counter() - begun[1]))


def overhead(measurements: MeasurementSet, rounds: int) -> float:
    """Processor time of a solve with its iterations recorded live / without, the ratio of the medians."""
    bare: list[Times] = []
    live: list[Times] = []
    after: list[Times] = []
    with tempfile.TemporaryDirectory() as folder:
        recording = LiveRecording(measurements, Path(folder) / "x.rrd")
        recording.flush()
        identify(measurements)  # what is loaded and cached is not measured
        for _ in range(rounds):
            with timed(bare):
                identify(measurements)
            recording.started()
            recording.flush()
            with timed(live):
                result = identify(measurements, progress=recording.progress)
            with timed(after):
                recording.identified(result)
                recording.flush()
        recording.close()
    cpu, wall = (
        statistics.median(getattr(t, kind) for t in live) / statistics.median(getattr(t, kind) for t in bare)
        for kind in ("cpu", "wall")
    )
    solve, result_time = (1000 * statistics.median(t.cpu for t in times) for times in (bare, after))
    print(
        f"{measurements.name}: a solve takes {solve:.0f} ms of processor time, recorded live ratio {cpu:.3f} "
        f"(wall time {wall:.3f}); its result takes {result_time:.0f} ms more; "
        f"medians of {rounds} rounds by turns"
    )
    return cpu


def kills(source: Path, count: int, seed: int = 1) -> tuple[int, int, int]:
    """Kill `flexviz record` `count` times; numbers of files that are whole, repaired, not begun yet."""
    chance = random.Random(seed)
    whole = repaired = absent = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        command = [sys.executable, "-m", "flexviz", "record", str(source), "--out"]
        begun = time.perf_counter()
        subprocess.run([*command, str(folder / "first.rrd")], check=True, capture_output=True)
        length = time.perf_counter() - begun
        for number in range(count):
            file = folder / f"{number}.rrd"
            process = subprocess.Popen(
                [*command, str(file)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            try:
                process.wait(chance.uniform(0.1, 1.05) * length)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            if not file.exists():
                absent += 1
                continue
            try:
                check_recording(file)
                whole += 1
            except TruncatedRecording:
                check_recording(repair_recording(file).file)
                repaired += 1
            except InputError as error:
                raise SystemExit(f"lost: {error}") from None
    print(
        f"{source.name}: of {count} killed recordings {whole} whole, {repaired} repaired, "
        f"{absent} killed before anything was recorded, 0 lost"
    )
    return whole, repaired, absent


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("set", nargs="?", type=Path, default=sessions_dir() / "planar-2r-demo")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--kills", type=int, default=20)
    arguments = parser.parse_args()
    overhead(read_set(arguments.set), arguments.rounds)
    if arguments.kills:
        kills(arguments.set, arguments.kills)


if __name__ == "__main__":
    main()
