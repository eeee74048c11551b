"""How an import names what is wrong with a log: `python -m benchmarks.import_faults SET…`.

Takes each set as it is, which must raise no issue, then puts one fault at a time into a copy of its data
(on a joint drawn at random where it concerns one) and looks at what is named. Link positions are left out:
they would make it easier. An answer is "right" (its cause, and nothing else is called wrong), "doubt" (the
cause among others that these data do not tell apart, or only that something is odd), "silent", "wrong cause".
Prints a line per answer that is not right, and a table of all kinds.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np

from benchmarks.command import command
from benchmarks.sample_faults import HARMLESS, KINDS, issues_of, log_of, named
from benchmarks.tables import markdown
from flexviz.base.arrays import Array
from flexviz.checks import Issue, issues_of_set
from flexviz.content.wording import issue_message, issue_text
from flexviz.data.measurements import Group, MeasurementSet, read_set

SAMPLE_KINDS = {kind for one in KINDS.values() for kind in one.names} | {"jumps"}
ANSWERS = "right", "doubt", "silent", "wrong cause"
POSES = 1500  # of a group, at which gravity is computed


@dataclass(frozen=True)
class ColumnFault:
    """Data with a fault, what the mapping says, and the issues that name it.

    `wanted`: kind of issue, joints, signal ("": any); `hint`: what an honest doubt has to mention.
    """

    name: str
    data: MeasurementSet
    keys: dict[str, float]
    wanted: tuple[tuple[str, tuple[str, ...], str], ...]
    hint: str = ""


def faults(measurements: MeasurementSet, rng: np.random.Generator) -> Iterator[ColumnFault]:
    """Every fault of columns and robot that the set allows."""
    joints, n = measurements.joints, measurements.n
    j = int(rng.integers(n))
    one, here = (joints[j],), np.arange(n) == j
    minus = np.where(here, -1.0, 1.0)

    def fault(
        name: str, kind: str, whose: Sequence[str], signal: str, *, hint: str = "",
        keys: dict[str, float] | None = None, **change: Any,
    ) -> ColumnFault:  # fmt: skip
        wanted = ((kind, tuple(whose), signal),)
        return ColumnFault(name, changed(measurements, **change), keys or {}, wanted, hint)

    yield fault("sign of tau, one joint", "sign", one, "tau", tau=minus)
    yield fault("sign of tau, all joints", "sign", joints, "tau", tau=-1.0)
    yield fault("sign of theta", "sign", one, "theta", theta=minus)
    yield fault("joint turned round", "sign", one, "theta and tau", theta=minus, tau=minus)
    degrees = 180 / np.pi
    yield fault("theta in degrees", "unit", joints, "theta", theta=degrees)
    yield fault("theta in degrees, one joint", "unit", one, "theta", theta=np.where(here, degrees, 1.0))
    yield fault("tau in mNm", "unit", joints, "tau", tau=1e3)
    yield fault("tau in Ncm, one joint", "unit", one, "tau", tau=np.where(here, 100.0, 1.0))
    yield fault("tau three times too large", "unit", joints, "tau", tau=3.0)
    yield fault("half of tau", "unit", joints, "tau", tau=0.5)
    constant = {"torque_constant": 8.0}
    yield fault("a current taken for Nm", "unit", joints, "tau", tau=1 / 8.0, keys=constant)
    yield fault(
        "before a known gear", "unit", joints, "theta and tau", theta=100.0, tau=0.01, keys={"gear": 100.0}
    )
    yield fault("zero off by a quarter turn", "zero", one, "theta", hint="offset", zero=here * np.pi / 2)
    pairs = list(combinations(range(n), 2))
    a, b = pairs[int(rng.integers(len(pairs)))]
    order = list(range(n))
    order[a], order[b] = b, a
    two = joints[a], joints[b]
    yield fault("two joints exchanged", "order", two, "theta and tau", theta_order=order, tau_order=order)
    yield fault("tau of two joints exchanged", "order", two, "tau", tau_order=order)
    if n > 2:
        first, second, third = sorted(map(int, rng.choice(n, 3, replace=False)))
        order = list(range(n))
        order[first], order[second], order[third] = second, third, first
        three = joints[first], joints[second], joints[third]
        yield fault(
            "three joints permuted", "order", three, "theta and tau", theta_order=order, tau_order=order
        )
        order = [joints.index(joint) for joint in sorted(joints)]
        moved = tuple(joint for joint, k in zip(joints, order, strict=True) if joints[k] != joint)
        if moved:
            name = "joints in alphabetical order"
            yield fault(name, "order", moved, "theta and tau", theta_order=order, tau_order=order)
    for name, down in {"wall": (9.81, 0, 0), "side": (0, -9.81, 0), "ceiling": (0, 0, 9.81)}.items():
        data = with_gravity(measurements, down)
        yield ColumnFault(f"mounted: {name}", data, {}, (("mounting", joints, ""),), "gravity = [")
    none = with_gravity(measurements, (0, 0, 0))
    yield ColumnFault("tau without gravity", none, {}, (("gravity", joints, "tau"),))
    only = with_gravity(measurements, None)
    yield ColumnFault("tau of gravity alone", only, {}, (("gravity", joints, "tau"),))
    groups = measurements.groups
    other = next(
        ((x, y) for x, y in combinations(range(len(groups)), 2) if groups[x].bodies != groups[y].bodies), None
    )
    if other is not None:
        x, y = other
        mixed = list(groups)
        mixed[x], mixed[y] = (
            replace(groups[x], bodies=groups[y].bodies),
            replace(groups[y], bodies=groups[x].bodies),
        )
        data = replace(measurements, groups=tuple(mixed))
        yield ColumnFault("payloads of two groups exchanged", data, {}, (("payload", joints, ""),), "payload")


PAIRS = (
    ("mounted: wall", "theta in degrees"),
    ("mounted: ceiling", "tau in mNm"),
    ("mounted: wall", "sign of tau, one joint"),
    ("tau without gravity", "tau in mNm"),
    ("sign of tau, one joint", "two joints exchanged"),
    ("sign of tau, one joint", "theta in degrees, one joint"),
    ("theta in degrees", "tau in mNm"),
    ("joint turned round", "tau of two joints exchanged"),
    ("zero off by a quarter turn", "tau in mNm"),
    ("payloads of two groups exchanged", "sign of tau, all joints"),
)


def pairs(measurements: MeasurementSet, rng: np.random.Generator) -> Iterator[ColumnFault]:
    """Two faults at once. Where columns are exchanged, the other fault may be named at either joint."""
    for first, second in PAIRS:
        one = next((f for f in faults(measurements, rng) if f.name == first), None)
        two = one and next((f for f in faults(one.data, rng) if f.name == second), None)
        if one and two:
            wanted = (*one.wanted, *two.wanted)
            if "exchanged" in second:
                wanted = tuple((kind, (), signal) for kind, _, signal in wanted)
            yield ColumnFault(f"{first} + {second}", two.data, one.keys | two.keys, wanted)


def changed(
    measurements: MeasurementSet, theta: Any = 1.0, tau: Any = 1.0, zero: Any = 0.0,
    theta_order: Sequence[int] | None = None, tau_order: Sequence[int] | None = None,
) -> MeasurementSet:  # fmt: skip
    """The set with θ and τ times these factors, one or (n,), θ moved by `zero` [rad], and columns moved."""
    of_theta, of_tau = (list(order or range(measurements.n)) for order in (theta_order, tau_order))

    def part(group: Group) -> Group:
        segments = [
            replace(s, theta=(s.theta * theta + zero)[:, of_theta], tau=(s.tau * tau)[:, of_tau])
            for s in group.segments
        ]
        return replace(group, segments=tuple(segments))

    return replace(measurements, groups=tuple(map(part, measurements.groups)))


def with_gravity(measurements: MeasurementSet, down: Sequence[float] | None) -> MeasurementSet:
    """The set with another gravity (3,) [m/s²] in τ; None: with nothing but the torque of gravity."""
    rng = np.random.default_rng(0)

    def part(group: Group) -> Group:
        segments = []
        for s in group.segments:
            own = gravity_torque(measurements, group, s.theta, measurements.robot.gravity)
            if down is None:
                tau = own + 0.01 * np.std(own, axis=0) * rng.standard_normal(own.shape)
            else:
                tau = s.tau - own + gravity_torque(measurements, group, s.theta, down)
            segments.append(replace(s, tau=tau))
        return replace(group, segments=tuple(segments))

    return replace(measurements, groups=tuple(map(part, measurements.groups)))


def gravity_torque(measurements: MeasurementSet, group: Group, theta: Array, down: Sequence[float]) -> Array:
    """(N, n) torque of gravity [Nm] of the CAD model with the group's payload."""
    robot = measurements.robot.mounted(down)
    rows = np.linspace(0, len(theta) - 1, min(len(theta), POSES)).astype(int)
    still = np.zeros_like(theta[rows])
    torque = robot.cad_torques(group.bodies, theta[rows], still, still)
    return np.column_stack([np.interp(np.arange(len(theta)), rows, torque[:, j]) for j in range(robot.n)])


def answer(fault: ColumnFault, issues: Sequence[Issue]) -> str:
    """One of ANSWERS, and what was said unless it is the first."""
    if not issues:
        return "silent"
    said = "; ".join(map(issue_text, issues))

    def names(issue: Issue, kind: str, joints: tuple[str, ...], signal: str) -> bool:
        return (
            issue.kind == kind
            and (not joints or set(issue.joints) == set(joints))
            and (not signal or issue.signal == signal)
        )

    right = [any(names(issue, *one) for issue in issues) for one in fault.wanted]
    others = [
        i for i in issues if i.kind != "unexplained" and not any(names(i, *one) for one in fault.wanted)
    ]
    if all(right) and not any(issue.severity == "wrong" for issue in others):
        return "right"
    told = [i for i in others if not (i.alike and fault.hint and fault.hint in issue_message(i))]
    return f"wrong cause: {said}" if told else f"doubt: {said}"


def tried(
    paths: Sequence[str], seed: int, samples: bool, both: bool
) -> tuple[dict[str, Counter[str]], Counter[str]]:
    """Answers to every kind of fault, and how often something was said of good data."""
    counts: dict[str, Counter[str]] = {}
    alarms: Counter[str] = Counter()

    def note(path: str, name: str, found: str) -> None:
        counts.setdefault(name, Counter())[found.partition(":")[0]] += 1
        if found != "right":
            print(f"{path}: {name}: {found}", flush=True)

    for number, path in enumerate(paths):
        measurements = read_set(path, logged=False)
        rng = np.random.default_rng([seed, number])
        alarms["columns"] += bool(issues_of_set(measurements))
        alarms["columns tried"] += 1
        for fault in (pairs if both else faults)(measurements, rng):
            note(path, fault.name, answer(fault, issues_of_set(fault.data, fault.keys)))
        if not samples:
            continue
        group = measurements.fit_groups[0]
        for name, kind in KINDS.items():
            log = log_of(measurements, group, seed + number)
            kind.spoil(log)
            with TemporaryDirectory() as folder:
                note(path, name, named(kind, issues_of(Path(folder), measurements, group, log)))
        for name, change in HARMLESS.items():
            log = log_of(measurements, group, seed + number)
            change(log)
            with TemporaryDirectory() as folder:
                found = issues_of(Path(folder), measurements, group, log)
            said = [issue_text(issue) for issue in found if issue.kind in SAMPLE_KINDS]
            alarms["samples"] += bool(said)
            alarms["samples tried"] += 1
            for text in said:
                print(f"{path}: {name}: {text}", flush=True)
    return counts, alarms


@command
def main(
    sets: list[str],
    *,
    seed: Annotated[int, "of the joints that are drawn"] = 0,
    columns: Annotated[bool, "no faults of samples"] = False,
    two: Annotated[bool, "two faults of columns at once, none of samples"] = False,
) -> int:
    counts, alarms = tried(sets, seed, not (columns or two), two)
    for what in ("columns", "samples"):
        print(f"good {what}: {alarms[what]} of {alarms[f'{what} tried']} raised an issue")
    total = sum(counts.values(), Counter())
    rows = [["kind", *ANSWERS]]
    for name, count in {**counts, f"{len(counts)} kinds": total}.items():
        rows.append([name, *(str(count[one]) for one in ANSWERS)])
    print(f"\n{markdown(rows, numbers=False)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
