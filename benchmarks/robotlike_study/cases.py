"""The cases of a study: which robots, in which order, with which random numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.diagnosis_study.cases import generator

SHARES: dict[str, float] = {"2r": 2.0, "ur5": 1.0, "panda": 1.0}
"""Robot → its part of the cases; the arms cost several times as much as the planar arm."""
DURATION = 15.0  # [s] of every group


@dataclass(frozen=True)
class RobotCase:
    """One simulated measurement set.

    Attributes:
        robot: "2r", "ur5" or "panda".
        seed: of the study.
        duration: of each group [s].
        also: effects that it hides beside those drawn, each on one joint.
    """

    name: str
    robot: str
    seed: int
    duration: float = DURATION
    also: tuple[str, ...] = ()

    def rng(self, purpose: str) -> np.random.Generator:
        """Random numbers of this case alone: other cases may come and go."""
        return generator(self.seed, f"{self.name} {purpose}")


def cases(
    seed: int,
    count: int,
    shares: Mapping[str, float] = SHARES,
    duration: float = DURATION,
    also: tuple[str, ...] = (),
) -> list[RobotCase]:
    """`count` cases with the robots mixed in proportion to `shares`.

    The first cases are the same whatever the count, and what they hide beside `also`, too.
    """
    out: list[RobotCase] = []
    made = dict.fromkeys((robot for robot, part in shares.items() if part > 0), 0)
    while made and len(out) < count:
        robot = min(made, key=lambda name: (made[name] + 0.5) / shares[name])
        name = f"rl{seed}-{robot}-{made[robot]:03d}"
        out.append(RobotCase(name, robot, seed, duration, also))
        made[robot] += 1
    return out


def parse_shares(text: str) -> dict[str, float]:
    """The parts of the robots in the order of `SHARES`, as in "2:1:1"."""
    parts = [float(part) for part in text.split(":")]
    if len(parts) != len(SHARES) or min(parts) < 0 or not sum(parts):
        raise ValueError(f'"{text}": expected a part for each of {", ".join(SHARES)}, as in 2:1:1')
    return dict(zip(SHARES, parts, strict=True))
