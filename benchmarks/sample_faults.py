"""Faults of samples that people's logs have, put into good recordings, and what looks like one and is none.

`python -m benchmarks.import_faults SET…` counts how they are named;
tests/data/test_import_samples.py asserts it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.base import toml
from flexviz.checks import Issue
from flexviz.data.importing import import_logs
from flexviz.data.measurements import Group, MeasurementSet

Array = NDArray[Any]


@dataclass
class Log:
    """A log to be written: `time` (N,) [s], `theta`, `tau` (N, n) in `units`; NaN where a row has none."""

    time: Array
    theta: Array
    tau: Array
    rng: np.random.Generator
    units: dict[str, object] = field(default_factory=dict)  # "theta", "tau" -> unit of the mapping
    joint: int = 0  # which one has the fault
    holding: Callable[[Array], Array] = np.zeros_like  # pose (n,) -> torque (n,) that holds the arm

    def rows(self, keep: Array) -> None:
        """Keep these rows only."""
        self.time, self.theta, self.tau = self.time[keep], self.theta[keep], self.tau[keep]


# -- faults: each returns what is expected of the issue's place: seconds, or None where it is everywhere -----

Place = tuple[float, float] | None


def wrapped_turn(log: Log) -> Place:
    j = log.joint
    log.theta[:, j] = (log.theta[:, j] - np.median(log.theta[:, j])) % (2 * np.pi)


def wrapped_degrees(log: Log) -> Place:
    log.theta = np.degrees(log.theta)
    log.units["theta"] = "deg"
    j = log.joint
    log.theta[:, j] = (log.theta[:, j] - np.median(log.theta[:, j])) % 360.0


def wrapped_counts(log: Log) -> Place:
    """Of an encoder with 2^16 counts on the motor's side of nothing."""
    log.units["theta"] = 2 * np.pi / 2**17
    counts = np.round(log.theta / (2 * np.pi / 2**17))
    j = log.joint
    counts[:, j] = (counts[:, j] - np.median(counts[:, j])) % 2**16
    log.theta = counts


def unsigned_torque(log: Log) -> Place:
    count = float(np.max(np.abs(log.tau))) / 1500
    log.units["tau"] = count
    log.tau = np.round((log.tau - np.median(log.tau, axis=0)) / count) % 2**16


def overflowing_torque(log: Log) -> Place:
    """Its peaks exceed 16 bits."""
    j, size = log.joint, float(np.max(np.abs(log.tau[:, log.joint]))) / 40000
    log.units["tau"] = size
    log.tau = np.round(log.tau / size)
    log.tau[:, j] = (log.tau[:, j] + 2**15) % 2**16 - 2**15


def zeros(log: Log) -> Place:
    lost = log.rng.random(len(log.time)) < 0.01
    log.theta[lost] = log.tau[lost] = 0.0


def marked_torque(log: Log) -> Place:
    log.tau[log.rng.random(len(log.time)) < 0.003, log.joint] = -999.0


def spikes(log: Log) -> Place:
    at = log.rng.choice(np.arange(100, len(log.time) - 100), 6, replace=False)
    log.theta[at, log.joint] += log.rng.uniform(0.2, 0.6, 6)


def publisher_without_effort(log: Log) -> Place:
    """A second publisher: every row in seven has another position and no torque."""
    other = np.arange(len(log.time)) % 7 == 3
    log.theta[other] = log.theta[other][:, ::-1] + 0.4
    log.tau[other] = np.nan


def publisher_with_effort(log: Log) -> Place:
    other = np.arange(len(log.time)) % 5 == 3
    log.theta[other] = log.theta[other] * 0.3 + 0.5
    log.tau[other] = 0.2 * log.tau[other]


def faster_log(log: Log) -> Place:
    last = np.arange(len(log.time)) // 4 * 4
    log.theta, log.tau = log.theta[last], log.tau[last]


def uneven_holds(log: Log) -> Place:
    last = np.floor(np.floor(np.arange(len(log.time)) / 3.3) * 3.3 + 0.999).astype(int)
    log.tau = log.tau[last]


def turns_of_a_bus(log: Log) -> Place:
    """Joints are asked one after the other: the torque of each is new in every sixth row."""
    for j in range(log.tau.shape[1]):
        last = np.maximum(np.arange(len(log.time)) - (np.arange(len(log.time)) + j) % 6, 0)
        log.tau[:, j] = log.tau[last, j]


def stale_torque(log: Log) -> Place:
    first = len(log.time) // 2
    last = first + round(0.4 / np.median(np.diff(log.time)))
    log.tau[first:last] = log.tau[first]
    return float(log.time[first]), float(log.time[last - 1])


def drive_off(log: Log) -> Place:
    """The torque reads 0 for a while."""
    first = len(log.time) // 3
    last = first + round(0.5 / np.median(np.diff(log.time)))
    log.tau[first:last] = 0.0
    return float(log.time[first]), float(log.time[last - 1])


def held(log: Log, at: int, seconds: float, torque: Array | float = 0.0) -> Place:
    """Insert a standstill before row `at` with this torque."""
    step = float(np.median(np.diff(log.time)))
    count = round(seconds / step)
    row = min(at, len(log.time) - 1)

    def noisy(x: Array, of: Array) -> Array:
        noise = np.std(np.diff(of, 4, axis=0), axis=0) / np.sqrt(70)
        return x + noise * log.rng.standard_normal((count, x.shape[-1]))

    theta = noisy(log.theta[row], log.theta)
    tau = noisy(torque + 0.0 * log.tau[row], log.tau)
    log.theta = np.insert(log.theta, [at] * count, theta, axis=0)
    log.tau = np.insert(log.tau, [at] * count, tau, axis=0)
    log.time = log.time[0] + step * np.arange(len(log.theta))
    return float(log.time[at]), float(log.time[at + count - 1])


def brakes_at_start(log: Log) -> Place:
    return held(log, 0, 2.5)


def emergency_stop(log: Log) -> Place:
    return held(log, len(log.time), 2.0)


def brakes_between(log: Log) -> Place:
    return held(log, len(log.time) // 2, 2.0)


def push(log: Log) -> Place:
    """A hand: over 1.5 s up to twice the spread of a torque, which the drive holds against."""
    j, first = log.joint, len(log.time) // 2
    count = round(1.5 / np.median(np.diff(log.time)))
    shape = np.sin(np.pi * np.arange(count) / count) ** 2
    log.tau[first : first + count, j] += 2.0 * np.std(log.tau[:, j]) * shape
    return float(log.time[first]), float(log.time[first + count - 1])


def constant_torque(log: Log) -> Place:
    log.tau[:, log.joint] = 1.25


def constant_position(log: Log) -> Place:
    log.theta[:, log.joint] = log.theta[0, log.joint]


def filtered(log: Log) -> Place:
    from scipy.signal import butter, sosfiltfilt

    rate = 1 / float(np.median(np.diff(log.time)))
    sos = butter(4, 10.0, fs=rate, output="sos")
    log.theta, log.tau = sosfiltfilt(sos, log.theta, axis=0), sosfiltfilt(sos, log.tau, axis=0)


@dataclass(frozen=True)
class Kind:
    """A fault, the kinds of issue that name it, its signal, and the key that mends it ("" for none)."""

    spoil: Callable[[Log], Place]
    names: tuple[str, ...]
    signal: str
    key: str


KINDS = {
    "angle wraps at 2π": Kind(wrapped_turn, ("wrapped",), "theta", "wrap"),
    "angle wraps at 360°": Kind(wrapped_degrees, ("wrapped",), "theta", "wrap"),
    "counts of 16 bits wrap": Kind(wrapped_counts, ("wrapped",), "theta", "wrap"),
    "signed torque read as unsigned": Kind(unsigned_torque, ("wrapped",), "tau", "wrap"),
    "torque overflows 16 bits": Kind(overflowing_torque, ("wrapped",), "tau", "wrap"),
    "zeros for lost values": Kind(zeros, ("dropped",), "theta", "missing"),
    "−999 for lost torques": Kind(marked_torque, ("dropped",), "tau", "missing"),
    "spikes of a position": Kind(spikes, ("outliers",), "theta", "drop_jumps"),
    "second publisher without effort": Kind(
        publisher_without_effort, ("messages",), "theta", "complete_rows"
    ),
    "second publisher with effort": Kind(publisher_with_effort, ("outliers",), "theta", "drop_jumps"),
    "log faster than its drive": Kind(faster_log, ("repeated",), "tau", "fresh"),
    "torque repeated unevenly": Kind(uneven_holds, ("repeated",), "tau", "fresh"),
    "joints updated in turn": Kind(turns_of_a_bus, ("repeated",), "tau", "fresh"),
    "stale torque": Kind(stale_torque, ("stale",), "tau", "fresh"),
    "drive off in motion": Kind(drive_off, ("stale",), "tau", "fresh"),
    "brakes closed at the start": Kind(brakes_at_start, ("held",), "tau", "from"),
    "emergency stop at the end": Kind(emergency_stop, ("held",), "tau", "to"),
    "brakes closed in between": Kind(brakes_between, ("held",), "tau", "leave_out"),
    "a hand pushes": Kind(push, ("contact",), "tau", "leave_out"),
    "torque that never changes": Kind(constant_torque, ("constant",), "tau", ""),
    "position that never changes": Kind(constant_position, ("constant",), "theta", ""),
    "filtered before it was written": Kind(filtered, ("filtered",), "tau", ""),
}


# -- what is no fault ----------------------------------------------------------------------------------------


def coarse(log: Log) -> None:
    log.theta = np.round(log.theta / 2e-3) * 2e-3
    log.tau = np.round(log.tau / 0.2) * 0.2


def saturated(log: Log) -> None:
    most = 0.6 * np.max(np.abs(log.tau), axis=0)
    log.tau = np.clip(log.tau, -most, most)


def dwell(log: Log) -> None:
    """A rest with the torque that holds the arm, as before it."""
    row = len(log.time) // 2
    held(log, row, 1.5, torque=log.holding(log.theta[row]))


def noisy(log: Log) -> None:
    log.theta += 2e-4 * log.rng.standard_normal(log.theta.shape)
    log.tau += 0.02 * np.std(log.tau, axis=0) * log.rng.standard_normal(log.tau.shape)


def lost_rows(log: Log) -> None:
    log.rows(log.rng.random(len(log.time)) > 0.02)


def slower(log: Log) -> None:
    log.rows(np.arange(len(log.time)) % 5 == 0)


HARMLESS: dict[str, Callable[[Log], None]] = {
    "as it is": lambda log: None,
    "coarse counts": coarse,
    "saturated torque": saturated,
    "rest under the drives": dwell,
    "more noise": noisy,
    "lost rows": lost_rows,
    "slower log": slower,
}


# -- as an import sees them ----------------------------------------------------------------------------------


def log_of(measurements: MeasurementSet, group: Group, seed: int, joint: int | None = None) -> Log:
    """A group as a log; the fault is on a random joint unless one is given."""
    rng = np.random.default_rng(seed)
    theta = group.joined("theta").copy()
    j = int(rng.integers(theta.shape[1])) if joint is None else joint

    def holding(pose: Array) -> Array:
        none = np.zeros((1, len(pose)))
        return measurements.robot.cad_torques(group.bodies, pose[None], none, none)[0]

    return Log(group.joined("time").copy(), theta, group.joined("tau").copy(), rng, joint=j, holding=holding)


def write_log(folder: Path, measurements: MeasurementSet, group: Group, log: Log) -> Path:
    """The log as CSV and its mapping; the path of the latter."""
    columns = {"time": log.time}
    joints: dict[str, Any] = {}
    for j, joint in enumerate(measurements.joints):
        columns |= {f"p{j + 1}": log.theta[:, j], f"t{j + 1}": log.tau[:, j]}
        joints[joint] = {"theta": {"from": f"p{j + 1}"}, "tau": {"from": f"t{j + 1}"}}
        for signal, unit in log.units.items():
            joints[joint][signal]["unit"] = unit
    lines = [",".join(columns)]
    lines += [
        ",".join("" if np.isnan(x) else f"{x:.9g}" for x in row)
        for row in zip(*columns.values(), strict=True)
    ]
    (folder / "log.csv").write_text("\n".join(lines) + "\n")
    source = measurements.robot.source
    own = measurements.path / source
    bodies = [
        {"link": b.link, "mass": b.mass, "com": list(b.com), "inertia": list(b.inertia)} for b in group.bodies
    ]
    document = {
        "format": 1,
        "robot": str(own) if own.is_file() else source,
        "time": {"column": "time"},
        "payloads": {"load": {"bodies": bodies}},
        "logs": [{"file": "log.csv", "group": "g", "payload": "load"}],
        "joints": joints,
    }
    mapping = folder / "mapping.toml"
    mapping.write_text(toml.dumps(document))
    return mapping


def named(kind: Kind, issues: Sequence[Issue]) -> str:
    """ "right", "silent", or the issue that names another cause."""
    right = [i for i in issues if i.kind in kind.names and kind.signal in i.signal]
    keys = {proposal.key for issue in right for proposal in issue.proposals}
    others = [i for i in issues if i.severity == "wrong" and i.kind not in kind.names]
    if others:
        return f"wrong cause: {others[0]}"
    return "right" if right and (not kind.key or kind.key in keys) else "silent"


def issues_of(folder: Path, measurements: MeasurementSet, group: Group, log: Log) -> tuple[Issue, ...]:
    """What an import finds in a log."""
    return import_logs(write_log(folder, measurements, group, log), None).issues
