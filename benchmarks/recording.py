"""Recordings, measured: `python -m benchmarks.recording [SET] [--rounds N] [--kills N]`.

1. What live recording adds to a solve: the same identification with its iterations recorded and without, by
   turns; then what recording its result adds (residuals, parameters, texts, layout, all in the file).
2. `flexviz record` killed with -9, as by `benchmarks.killed_commands`: what was flushed must be readable.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

from benchmarks.command import command
from benchmarks.killed_commands import RECORD, kill_all
from flexviz.analysis.identification import identify
from flexviz.base.resources import sessions_dir
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.outlets.recording import LiveRecording

DEMO = sessions_dir() / "planar-2r-demo"


Times = tuple[float, float]  # processor time of all threads and wall time of one part of the work [s]


@contextmanager
def timed(into: list[Times]) -> Iterator[None]:
    """Add the time that the block takes."""
    begun = time.process_time(), time.perf_counter()
    yield
    into.append((time.process_time() - begun[0], time.perf_counter() - begun[1]))


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
        statistics.median(t[k] for t in live) / statistics.median(t[k] for t in bare) for k in (0, 1)
    )
    solve, result_time = (1000 * statistics.median(t[0] for t in times) for times in (bare, after))
    print(
        f"{measurements.name}: a solve takes {solve:.0f} ms of processor time, recorded live ratio {cpu:.3f} "
        f"(wall time {wall:.3f}); its result takes {result_time:.0f} ms more; "
        f"medians of {rounds} rounds by turns"
    )
    return cpu


@command
def main(
    set: Annotated[Path, "a measurement set"] = DEMO,
    *,
    rounds: int = 7,
    kills: int = 20,
) -> int:
    overhead(read_set(set), rounds)
    if kills:
        return kill_all({RECORD: kills})
    return 0


if __name__ == "__main__":
    sys.exit(main())
