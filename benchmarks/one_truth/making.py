"""A planned set becomes a measurement set; its truth lies elsewhere.

Two simulators that share no code make the motions: that of flexviz on the random robots of
`benchmarks.diagnosis_study`, and the one of the tests.
"""

from __future__ import annotations

import tempfile
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.changed_recordings import Recording, entry
from benchmarks.diagnosis_study.cases import generator
from benchmarks.diagnosis_study.making import base_truth, write_runs
from benchmarks.diagnosis_study.robots import random_plan
from benchmarks.diagnosis_study.sizes import SIZES
from benchmarks.running import Json, case_folder, truth_file, write
from flexviz.data.measurements import FILE_NAME, GroupTable, read_set, write_set
from flexviz.model import simulation
from flexviz.model.effects import EFFECTS
from flexviz.robot.model import EffectValue

DURATION = 8.0  # [s] of every group
SIZE = (0.7, 1.5)  # of an effect of `Planned.size` 1, in what is clearly visible on its joint
WORN = ("coulomb_friction:joint2:coulomb=1.0", "backlash:joint1")


@dataclass(frozen=True)
class Planned:
    """One set.

    Attributes:
        seed: everything random follows from it and the name; that of the noise of a `worn` planar arm.
        apart: by the tests' simulator instead of that of flexviz.
        joint, hidden: has these effects of the library.
        size, noise: of the effects and the sensors, in what is usual.
        changes: of the record before it is written.
        wanted: effects that the study asks for.
        initial, hold: whether the set states start values and for how long the controller holds a torque.
    """

    name: str
    seed: int
    robot: str
    apart: bool = False
    joint: int = 0
    hidden: tuple[str, ...] = ()
    size: float = 1.0
    noise: float = 1.0
    changes: tuple[Callable[[Recording], Recording], ...] = ()
    wanted: tuple[str, ...] = ()
    initial: bool = True
    hold: bool = True


def make(work: Path, planned: Planned) -> None:
    """Simulate a set, change its record and write it."""
    out = case_folder(work, planned.name)
    if planned.robot == "worn":
        plan = simulation.make_plan("planar-2r", WORN)
        simulation.write_plan(
            plan, simulation.simulate_plan(plan, planned.seed), out, planned.seed, overwrite=True
        )
        truth = _truth(planned, plan)
    else:
        with tempfile.TemporaryDirectory() as folder:
            made = Path(folder) / "set"
            truth = (_apart if planned.apart else _own)(planned, made)
            truth["effects"] = _rewritten(planned, made, truth["effects"], out)
    write(truth_file(work, planned.name), truth | {"case": planned.name, "wanted": list(planned.wanted)})


def _apart(planned: Planned, folder: Path) -> Json:
    from benchmarks.independent import make_case

    seed = int(generator(planned.seed, planned.name).integers(2**31))
    given = {"joint": planned.joint, "size": planned.size, "noise": planned.noise, "duration": DURATION}
    return make_case(seed, "+".join(planned.hidden) or "none", planned.robot, folder, **given)


def _own(planned: Planned, folder: Path) -> Json:
    rng = generator(planned.seed, planned.name)
    plan = random_plan(planned.robot, rng, (), planned.noise)
    plan = replace(plan, groups=tuple(replace(g, duration=DURATION) for g in plan.groups))
    hidden = tuple(_effect(name, planned, plan, rng) for name in planned.hidden)
    plan = replace(plan, model=replace(plan.model, effects=hidden))
    seed = int(rng.integers(2**31))
    write_runs(folder, plan, simulation.simulate_plan(plan, seed))
    return _truth(planned, plan)


def _truth(planned: Planned, plan: simulation.Plan) -> Json:
    hidden = [entry(e.effect, e.joint, **e.parameters) for e in plan.model.effects]
    return base_truth(planned, plan, hidden) | {"base": []}


def _effect(name: str, planned: Planned, plan: simulation.Plan, rng: np.random.Generator) -> EffectValue:
    """An effect of about the size that is clearly visible."""
    joint = plan.robot.joints[planned.joint] if EFFECTS[name].scope == "joint" else None
    values, size = (
        simulation.default_parameters(name, joint, plan, simulation.motion_scale(plan)),
        SIZES[name],
    )
    sign = float(rng.choice([-1.0, 1.0])) if size.signed else 1.0
    values[size.parameter] *= planned.size * sign * float(rng.uniform(*SIZE))
    return EffectValue(name, joint, values)


def _rewritten(planned: Planned, made: Path, hidden: list[Json], out: Path) -> list[Json]:
    """Write the changed record of a set that was made; what is hidden in it."""
    given = read_set(made)
    groups = tuple(replace(GroupTable.of(g), file=None) for g in given.groups)
    one = Recording(given.joints, groups, tuple(hidden))
    for change in planned.changes:
        one = change(one)
    source = tomllib.loads((made / FILE_NAME).read_text(encoding="utf-8"))["robot"]
    write_set(
        out,
        robot=source,
        joints=given.joints,
        groups=one.groups,
        payloads=given.payloads,
        files={source: made / source} if (made / source).is_file() else {},
        effects=given.effects,
        initial_stiffness=given.initial_stiffness if planned.initial else None,
        initial_motor_inertia=given.initial_motor_inertia if planned.initial else None,
        torque_hold=given.torque_hold if planned.hold else 0.0,
        overwrite=True,
    )
    unstated = 0.0 if planned.hold else given.torque_hold / 2  # [s] it acts later than it is stamped
    return [*one.hidden, *([entry("torque_delay", None, delay=unstated)] if unstated else [])]
