"""The sets of the comparison, their truth, and what every method but `flexviz diagnose` is told of them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.peers.problem import COULOMB, OFFSET
from flexviz.model.simulation import make_plan, simulate_preset
from flexviz.robot.model import FlexibleModel


@dataclass(frozen=True)
class Case:
    """One set.

    Attributes:
        name: in tables.
        text: what it is.
        place: below the folder of sets; None: simulated here.
        told: friction that the peers know of, beside viscous.
        hidden: whether flexviz has to find it: `diagnose` in place of `identify --refine`.
    """

    name: str
    text: str
    place: str | None
    told: tuple[str, ...] = ()
    hidden: bool = False


CASES = (
    Case("paper-b", "the paper's group B from rest: planar arm, sines, 3 + 1 runs of 10 s", None),
    Case("2r-none-19", "planar arm, nothing hidden, three-fold noise, 3 + 1 runs of 12 s", "practice"),
    Case(
        "2r-coulomb_friction",
        "planar arm, Coulomb friction of 7 Nm hidden in joint 1",
        "practice",
        (COULOMB,),
        True,
    ),
    Case("panda-none-3", "Franka Panda, nothing hidden, 3 + 1 runs of 12 s", "practice"),
    Case("kuka_kr300", "KUKA KR300, recorded; no truth, one run each", "real", (COULOMB, OFFSET), True),
)


def folder_of(case: Case, data: Path | None, work: Path) -> Path | None:
    """Its measurement set, simulated if it is one of ours; None if it is absent."""
    if case.place is None:
        folder = work / case.name
        if not (folder / "measurements.toml").is_file():
            simulate_preset(case.name, folder)
        return folder
    if data is None:
        return None
    below = data / case.place / "cases" if case.place == "practice" else data / case.place
    folder = below / case.name
    return folder if (folder / "measurements.toml").is_file() else None


def truth_of(case: Case, data: Path | None) -> dict[str, Any] | None:
    """The true values in the form of an answer; None for a recording."""
    if case.place is None:
        return _from_model(make_plan(case.name).model)
    if case.place != "practice" or data is None:
        return None
    given = json.loads((data / "practice" / "truth" / f"{case.name}.json").read_text(encoding="utf-8"))
    inertial = planar_inertial(given["inertial_2r"]).tolist() if "inertial_2r" in given else None
    return {
        "joints": given["joints"],
        "stiffness": given["stiffness"],
        "motor_inertia": given["motor_inertia"],
        "link_viscous_friction": given["viscous_link"],
        "motor_viscous_friction": given["viscous_motor"],
        "inertial": inertial,
        "effects": given["effects"],
    }


def planar_inertial(arm: dict[str, float]) -> np.ndarray:
    """(2, 10) of a planar arm about joint axes along −y; what the plane does not show is zero."""
    links = np.zeros((2, 10))  # mass, mx, my, mz, ixx, ixy, iyy, ixz, iyz, izz
    links[1, 0] = arm["m2"]
    for k in (1, 2):
        links[k - 1, [1, 3, 6]] = arm[f"mx{k}"], arm[f"my{k}"], arm[f"Izz{k}"]
    return links


def _from_model(model: FlexibleModel) -> dict[str, Any]:
    return {
        "joints": model.joints,
        "stiffness": model.stiffness,
        "motor_inertia": model.motor_inertia,
        "link_viscous_friction": model.link_viscous_friction,
        "motor_viscous_friction": model.motor_viscous_friction,
        "inertial": model.inertial,
        "effects": [],
    }
