"""Cases with one hidden effect: everything about them follows from a seed, a kind and a robot's name."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from independent import files
from independent.arms import Arm, Array, Body, planar_arm, urdf_arm, varied
from independent.hiding import effect_of
from independent.laws import STRANGE, Effect
from independent.robots import FRAMES, gains_of, motion_of, payloads_of, work_of
from independent.simulator import Record, Setup, simulate

ROBOTS = ("2r", "panda", "ur5")
NONE = "none"
ON_COULOMB = {  # beside known Coulomb
    "stribeck_friction", "load_dependent_friction", "driving_friction", "presliding_hysteresis",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Case:
    """A case before it is written.

    Attributes:
        setup: what is true.
        record: with noise.
        drawn: the arm as its URDF has it.
        rough: stiffness and motor inertia to begin with, each (n,).
        own: effects the set's model starts with.
        truth: as a dictionary of JSON values.
    """

    setup: Setup
    record: Record
    drawn: Arm
    rough: tuple[Array, Array]
    own: tuple[str, ...]
    truth: dict[str, Any]


def make_case(seed: int, kind: str, robot: str, folder: str | Path | None, **options: Any) -> dict[str, Any]:
    """Simulate a case, write its set into a folder (None writes nothing), give back what is true.

    The other arguments are those of `draw`.
    """
    case = draw(seed, kind, robot, **options)
    if folder is not None:
        files.write(Path(folder), case.setup, case.record, case.drawn, case.rough, case.own)
    return case.truth


def write_cases(folder: Path, wanted: Sequence[tuple[int, str, str]]) -> None:
    """Folder/cases/NAME and folder/truth/NAME.json for every (seed, kind, robot)."""
    (folder / "truth").mkdir(parents=True, exist_ok=True)
    for seed, kind, robot in wanted:
        name = case_name(seed, kind, robot)
        truth = make_case(seed, kind, robot, folder / "cases" / name)
        (folder / "truth" / f"{name}.json").write_text(json.dumps(truth, indent=1))


def case_name(seed: int, kind: str, robot: str) -> str:
    return f"{robot}-{kind}-{seed}"


def _about(values: Array, rng: np.random.Generator) -> Array:
    return values * np.exp(0.12 * rng.standard_normal(len(values)))


def draw(
    seed: int,
    kind: str,
    robot: str,
    *,
    joint: int | None = None,
    hold: float | None = None,
    size: float = 1.0,
    noise: float | None = None,
    duration: float | None = None,
    mounted: tuple[float, float] = (0.0, 0.0),
    rigid: tuple[int, ...] = (),
) -> Case:
    """A case and everything that happened in it.

    Args:
        seed: everything random follows from it.
        kind: an effect's name, one of `STRANGE`, "none", or several joined by "+".
        robot: "2r", "panda" or "ur5".
        joint: number of the joint that has the effect; random by default.
        hold: of the torque [s]; random by default.
        size: multiplies the effect's size.
        noise: times the robot's usual noise; 1 or 3 by default.
        duration: of each run [s].
        mounted, rigid: as in `Setup`.
    """
    rng = np.random.default_rng((seed, ROBOTS.index(robot), crc32(kind.encode())))
    frame = FRAMES[robot]
    arm = planar_arm(rng) if robot == "2r" else varied(urdf_arm(robot), rng, 0.12)
    n = len(arm.joints)
    kinds = [k for k in kind.split("+") if k != NONE]
    spread = 0.55 if robot == "2r" else 0.25
    stiffness = np.array(frame.stiffness) * rng.uniform(1 - spread, 1 + spread, n)
    motor_inertia = np.array(frame.motor_inertia) * rng.uniform(1 - spread, 1 + spread, n)
    scale = noise or float(rng.choice([1.0, 3.0]))
    holds = [h for h in frame.holds if h > 0 or "torque_delay" not in kinds]
    held = float(rng.choice(holds)) if hold is None else hold
    payloads = payloads_of(frame, rng)
    setup = Setup(
        arm,
        stiffness,
        motor_inertia,
        rng.uniform(*frame.link_viscous, n),
        rng.uniform(*frame.motor_viscous, n),
        (),
        ("p1", "p2", "p3", "p3"),
        (payloads[0], payloads[1], payloads[2], payloads[2]),
        motion_of(frame, rng),
        np.zeros(n),
        np.zeros(n),
        held,
        duration or frame.duration,
        (scale * frame.noise[0], scale * frame.noise[1]),
        mounted,
        rigid,
    )
    setup = replace(setup, **gains_of(setup))
    work = work_of(setup)
    own = ("coulomb_friction",) if ON_COULOMB & set(kinds) else ()
    known = [Effect("coulomb_friction", j, {"coulomb": float(rng.uniform(0.02, 0.06) * work.torque[j])})
             for j in range(n if own else 0)]  # fmt: skip
    hidden = []
    for k in kinds:
        at = int(rng.integers(n)) if joint is None else joint
        hidden.append(effect_of(k, at, setup, work, known, rng, size))
    replaced = {e.joint for e in hidden if e.name == "presliding_hysteresis"}
    known = [e for e in known if e.joint not in replaced]
    setup = replace(setup, effects=(*known, *hidden))
    record = simulate(setup).noisy(setup.noise, rng)
    rough = (_about(stiffness, rng), _about(motor_inertia, rng))
    truth = _truth(seed, kind, robot, setup, known, hidden, own, scale)
    return Case(setup, record, varied(arm, rng, 0.18), rough, own, truth)


def _truth(
    seed: int,
    kind: str,
    robot: str,
    setup: Setup,
    known: Sequence[Effect],
    hidden: Sequence[Effect],
    own: Sequence[str],
    scale: float,
) -> dict[str, Any]:
    def entry(e: Effect) -> dict[str, Any]:
        values = dict(e.values)
        if e.name == "base_tilt" and setup.n == 2:
            del values["tilt_x"]  # a planar arm does not feel it
        return {
            "effect": "unknown" if e.name in STRANGE else e.name,
            "joint": None if e.joint is None else setup.arm.joints[e.joint],
            "parameters": values,
            "kind": e.name,
            "payload": e.payload,
            "group": None if e.run is None else files.GROUPS[e.run],
        }

    return {
        "case": case_name(seed, kind, robot),
        "robot": robot,
        "effects": [entry(e) for e in hidden],
        "seed": seed,
        "noise_scale": scale,
        "stiffness": setup.stiffness.tolist(),
        "motor_inertia": setup.motor_inertia.tolist(),
        "viscous_link": setup.link_viscous.tolist(),
        "viscous_motor": setup.motor_viscous.tolist(),
        "base": list(own),
        "base_effects": [entry(e) for e in known],
        "noise": {"theta": setup.noise[0], "tau": setup.noise[1]},
        "joints": list(setup.arm.joints),
        "torque_hold": setup.hold,
        "inertial": {link.joint: _about_the_joint(link.body) for link in setup.arm.links},
        "weak": False,
    }


def _about_the_joint(body: Body) -> dict[str, float]:
    """Inertial parameters about the joint's frame [kg, kg m, kg m²]."""
    m, c = body.mass, np.array(body.com)
    xx, yy, zz, xy, xz, yz = body.inertia
    about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) + m * (c @ c * np.eye(3) - np.outer(c, c))
    first = dict(zip(("mass", "mx", "my", "mz"), (m, *(m * c)), strict=True))
    second = {k: about[i] for k, i in (("ixx", (0, 0)), ("iyy", (1, 1)), ("izz", (2, 2)),
                                       ("ixy", (0, 1)), ("ixz", (0, 2)), ("iyz", (1, 2)))}  # fmt: skip
    return {k: float(v) for k, v in (first | second).items()}
