"""How friction that falls with temperature from run to run is diagnosed.

    python -m benchmarks.temperature_study FOLDER [CASE ...]

Each case is simulated in FOLDER with temperatures stated, diagnosed with `apply`, and printed as one line:
what was found, the largest error of the values, verdict and CPU seconds. A share is what is lost between 25
and 45 °C of the friction at 15 °C.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.command import command
from flexviz.analysis.diagnosis import Diagnosis, diagnose
from flexviz.data.measurements import read_set
from flexviz.model.simulation import Plan, Run, make_plan, move, record, write_plan
from flexviz.robot.model import EffectValue, FlexibleModel

EFFECT = "temperature_friction"
RANGE = 20.0  # [K] between the coldest and the warmest group
MIXED, BY_LOAD, COLDER = (25.0, 45.0, 35.0, 40.0), (25.0, 35.0, 45.0, 35.0), (45.0, 25.0, 35.0, 30.0)
MANY = (
    "coulomb_friction",
    "stribeck_friction:joint1",
    "load_dependent_friction:joint2",
    "torque_offset:joint1",
    "cable_spring:joint2",
)


@dataclass(frozen=True)
class Case:
    """A set with hidden effects.

    Attributes:
        preset: of the simulator.
        falls: joint → shares of viscous and Coulomb friction that are lost.
        coulomb: Coulomb friction of the joints that lose some [Nm].
        others: further hidden effects.
        degrees: of the groups [°C].
        known: the set's model has Coulomb friction.
        exponential: c of viscous friction of motor 2 that falls as exp(−c (T − 20 °C)) [1/K].
    """

    preset: str = "planar-2r"
    falls: tuple[tuple[str, float, float], ...] = ()
    coulomb: float = 3.0
    others: tuple[str, ...] = ()
    degrees: tuple[float, ...] = MIXED
    known: bool = False
    exponential: float = 0.0

    def hidden(self) -> list[str]:
        """The hidden effects, as the simulator's options."""
        model = make_plan(self.preset).model
        out = list(self.others)
        for joint, viscous, dry in self.falls:
            j = model.joints.index(joint)
            whole = float(model.link_viscous_friction[j] + model.motor_viscous_friction[j])
            # a fall f per K with RANGE · f = share · (whole + 5 f): of the friction at 15 °C
            fall = viscous * whole / (RANGE - 5.0 * viscous)
            dry_fall = dry * self.coulomb / (RANGE - 5.0 * dry)
            out.append(f"{EFFECT}:{joint}:viscous_fall={fall},coulomb_fall={dry_fall}")
            if dry and "coulomb_friction" not in self.others:
                out.append(f"coulomb_friction:{joint}:coulomb={self.coulomb}")
        return out


def motions(case: Case, plan: Plan) -> dict[str, Run]:
    """Group → its motion."""
    if not case.exponential:
        return move(plan)
    runs: dict[str, Run] = {}
    for group, degrees in zip(plan.groups, case.degrees, strict=True):
        viscous = plan.model.motor_viscous_friction.copy()
        viscous[1] *= np.exp(-case.exponential * (degrees - 20.0))
        model = replace(plan.model, motor_viscous_friction=viscous)
        runs |= move(replace(plan, groups=(group,), model=model))
    return runs


def on(joint: str, viscous: float, dry: float = 0.0) -> tuple[tuple[str, float, float], ...]:
    return ((joint, viscous, dry),)


PANDA = [f"panda_joint{k}" for k in range(1, 8)]
CASES = {
    "viscous 10 %, joint 1": Case(falls=on("joint1", 0.1)),
    "viscous 10 %, joint 2": Case(falls=on("joint2", 0.1)),
    "viscous 20 %, joint 1": Case(falls=on("joint1", 0.2)),
    "viscous 40 %, joint 2": Case(falls=on("joint2", 0.4)),
    "viscous 20 %, joint 2, cold with payload": Case(falls=on("joint2", 0.2), degrees=COLDER),
    "viscous 20 %, joint 2, warmer with the payload": Case(falls=on("joint2", 0.2), degrees=BY_LOAD),
    "viscous 20 %, both joints": Case(falls=(*on("joint1", 0.2), *on("joint2", 0.2))),
    "Coulomb in the model, 10 % of both": Case(falls=on("joint2", 0.1, 0.1), known=True),
    "Coulomb in the model, 20 % of Coulomb": Case(falls=on("joint1", 0.0, 0.2), known=True),
    "Coulomb in the model, 40 % of both": Case(falls=on("joint1", 0.4, 0.4), known=True),
    "Coulomb hidden, 20 % of both": Case(falls=on("joint2", 0.2, 0.2)),
    "Coulomb hidden, 40 % of both": Case(falls=on("joint1", 0.4, 0.4)),
    "with five other effects, 30 % of both": Case(
        falls=(*on("joint1", 0.3, 0.3), *on("joint2", 0.3, 0.3)), others=MANY
    ),
    "Panda, viscous 20 %, joint 2": Case("panda", on(PANDA[1], 0.2)),
    "Panda, viscous 40 %, joint 4": Case("panda", on(PANDA[3], 0.4)),
    "Panda, viscous 30 %, all joints": Case("panda", tuple((j, 0.3, 0.0) for j in PANDA)),
    "motor viscous 18 %, joint 2, exponential": Case(exponential=0.01),
    "motor viscous 39 %, joint 2, exponential": Case(exponential=0.025),
    "no effect": Case(),
    "no effect, warmer with the payload": Case(degrees=BY_LOAD),
    "Coulomb only, same at all temperatures": Case(others=("coulomb_friction:joint2",)),
    "load-dependent, warmer with the payload": Case(
        others=("load_dependent_friction:joint2",), degrees=BY_LOAD
    ),
    "friction drift": Case(others=("friction_drift:joint1",)),
    "Panda, no effect": Case("panda"),
}


def error_of(found: FlexibleModel, hidden: EffectValue) -> float:
    """Error of an effect's values, relative to its largest torque at 1 rad/s."""
    (same,) = (e for e in found.effects if (e.effect, e.joint) == (hidden.effect, hidden.joint))
    truth = hidden.parameters
    size = max(abs(v) for v in truth.values())
    return max(abs(same.parameters[name] - truth[name]) for name in truth) / size


def line(
    name: str, hidden: tuple[EffectValue, ...], like: list[str], found: Diagnosis, seconds: float
) -> str:
    """One row of the table; `like` are effects that come near a law of no library."""
    model = found.model
    assert model is not None
    added = [s.added.text for s in found.steps if s.added is not None]
    wanted = {e.text for e in hidden} or set(like)
    errors = [
        error_of(model, e) for e in hidden if e.effect == EFFECT and e.text in {x.text for x in model.effects}
    ]
    first = found.findings[0] if found.findings else None
    ranked = "–" if first is None else f"{first.text} {first.confidence:.2f}"
    ties = ", ".join(tie.effect for tie in first.inseparable_from) if first is not None else ""
    missed, false = sorted(wanted - {e.text for e in model.effects}), [a for a in added if a not in wanted]
    worst = f"{100 * max(errors):.2g} %" if errors else "–"
    return " | ".join(
        (name, found.verdict, ranked, ties or "–", ", ".join(missed) or "–", ", ".join(false) or "–", worst,
         found.steps[-1].verdict, f"{seconds:.0f}")
    )  # fmt: skip


@command
def main(folder: Path, names: list[str] = []) -> None:  # noqa: B006
    print("case | verdict | first named | tied with | missed | false | error | last verdict | CPU s")
    for k, name in enumerate(CASES):
        if names and name not in names:
            continue
        case = CASES[name]
        plan = make_plan(case.preset, case.hidden(), temperatures=case.degrees)
        if case.known:
            plan = replace(plan, effects=("coulomb_friction",))
        path = folder / f"case{k}"
        write_plan(plan, record(plan, motions(case, plan), k), path, k, overwrite=True)
        began = time.process_time()
        found = diagnose(read_set(path), apply=True)
        print(
            line(
                name,
                plan.model.effects,
                [f"{EFFECT}:joint2"] * bool(case.exponential),
                found,
                time.process_time() - began,
            ),
            flush=True,
        )


if __name__ == "__main__":
    sys.exit(main())
