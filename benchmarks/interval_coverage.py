"""Stated 95 % intervals against the truth: `python -m benchmarks.interval_coverage --seed S [--quick]`.

Sets of the independent simulator: planar arms as they are, planar arms with an effect that the model has, and
UR5. Each is identified as by `flexviz identify`; `--quick` takes the plain fit. Printed: how often the
intervals hold the truth, by kind of set and of parameter, and which of the marked ones are far off.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np

from benchmarks.command import command
from benchmarks.independent import make_case
from benchmarks.tables import plain
from flexviz import identify, read_set
from flexviz.analysis.identification import Identification
from flexviz.base.statistics import NORMAL_95

EFFECTS = (
    "coulomb_friction", "quadratic_friction", "torque_offset", "cable_spring", "stiffness_hardening",
    "load_dependent_friction", "torque_ripple", "stribeck_friction", "torque_gain",
    "payload_error",
)  # fmt: skip
SETS = ("planar", "planar with an effect", "ur5")
FAR = 3.0  # standard errors beyond which a value is printed


@dataclass(frozen=True)
class Stated:
    """One value: how many standard errors it is off, and how it is marked."""

    sort: str  # of the set
    kind: str  # of the parameter
    name: str
    score: float
    grade: str


def truths(case: Mapping[str, Any]) -> dict[str, float]:
    """True values by "name:joint"."""
    out: dict[str, float] = {}
    for j, joint in enumerate(case["joints"]):
        link, motor = case["viscous_link"][j], case["viscous_motor"][j]
        out |= {
            f"stiffness:{joint}": case["stiffness"][j],
            f"motor_inertia:{joint}": case["motor_inertia"][j],
            f"link_viscous_friction:{joint}": link,
            f"motor_viscous_friction:{joint}": motor,
            f"viscous_friction_sum:{joint}": link + motor,
        }
        out |= {f"{name}:{joint}": value for name, value in case["inertial"][joint].items()}
    for effect in (*case["base_effects"], *case["effects"]):
        place = effect["joint"] if effect["joint"] is not None else effect["payload"]
        out |= {f"{effect['effect']}.{k}:{place}": v for k, v in effect["parameters"].items()}
    return out


def stated(result: Identification, true: Mapping[str, float], sort: str) -> Iterator[Stated]:
    """Every interval whose truth is known; what is graded "no" has none."""
    for p in result.parameters:
        name = f"{p.name}:{p.joint if p.joint is not None else p.payload}"
        if p.identifiable == "no":
            continue
        if name in true and p.name not in ("mass", "mx", "my", "mz") and not p.name.startswith("i"):
            kind = "effect" if "." in p.name else p.name
            yield Stated(sort, kind, name, _score(p.value, p.std, true[name]), p.identifiable)
    for c in (c for c in result.combinations if c.identifiable != "no"):
        value = sum(weight * true[name] for name, weight in c.weights.items())
        yield Stated(sort, "inertial combination", c.name, _score(c.value, c.std, value), c.identifiable)


def _score(value: float, std: float, true: float) -> float:
    return (value - true) / std if std > 0 else (0.0 if value == true else np.inf)


def outcome(seed: int, number: int, quick: bool) -> list[Stated]:
    """One set of the study."""
    sort = SETS[number % len(SETS)]
    robot = "ur5" if sort == "ur5" else "2r"
    kind = EFFECTS[number // len(SETS) % len(EFFECTS)] if "effect" in sort else "none"
    with TemporaryDirectory() as folder:
        case = make_case(1000 * seed + number, kind, robot, folder)
        measurements = read_set(folder, logged=False)
    effects = [
        f"{e['effect']}:{e['joint'] or e['payload']}" if e["joint"] or e["payload"] else e["effect"]
        for e in case["effects"]
    ]
    result = identify(measurements, effects=effects, refine=not quick)
    found = list(stated(result, truths(case), sort))
    far = [s for s in found if abs(s.score) > FAR]
    texts = ", ".join(f"{s.name} {s.score:+.1f} ({s.grade})" for s in far)
    print(f"{number:3d} {case['case']:40s} {len(found):3d} intervals; far off: {texts or 'none'}", flush=True)
    return found


def table(found: Sequence[Stated]) -> str:
    """Coverage by kind of set and of parameter."""
    rows = [(f"of {name}", [s for s in found if s.sort == name]) for name in SETS]
    kinds = list(dict.fromkeys(s.kind for s in found))
    rows += [(kind, [s for s in found if s.kind == kind]) for kind in kinds]
    lines = [["", "yes or weak"]]
    for name, some in (*rows, ("all", list(found))):
        inside = np.mean([abs(s.score) <= NORMAL_95 for s in some]) if some else np.nan
        lines.append([name, f"{inside:.1%} of {len(some):4d}" if some else "–"])
    return plain(lines)


@command
def main(
    *, seed: int = 1, sets: int = 60, first: int = 0, quick: Annotated[bool, "the plain fit"] = False
) -> int:
    """Print a line per set and the table; 1 where the coverage is not 92 to 97 %."""
    found = [s for number in range(first, first + sets) for s in outcome(seed, number, quick)]
    print(table(found))
    return int(not 0.92 <= np.mean([abs(s.score) <= NORMAL_95 for s in found]) <= 0.97)


if __name__ == "__main__":
    sys.exit(main())
