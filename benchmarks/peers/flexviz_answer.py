"""flexviz's results in the form in which all methods answer, and its evaluations counted from outside."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

from benchmarks.peers.problem import Problem
from flexviz import diagnose, identify, read_set
from flexviz.analysis.diagnosis import Diagnosis
from flexviz.analysis.identification import Identification
from flexviz.model.equation import OperatingPoint


class Count:
    """How often the equation was evaluated."""

    value = 0


@contextmanager
def counted() -> Iterator[Count]:
    """Count evaluations of the equation meanwhile, with or without its Jacobian."""
    count = Count()
    originals = {name: getattr(OperatingPoint, name) for name in ("residual", "evaluate")}

    def counting(original: Any) -> Any:
        def call(*arguments: Any, **options: Any) -> Any:
            count.value += 1
            return original(*arguments, **options)

        return call

    for name, original in originals.items():
        setattr(OperatingPoint, name, counting(original))
    try:
        yield count
    finally:
        for name, original in originals.items():
            setattr(OperatingPoint, name, original)


def answered(result: Identification | Diagnosis, count: Count) -> dict[str, Any]:
    """The final model, and the standard errors that the program states."""
    model = result.model
    assert model is not None
    return {
        "stiffness": model.stiffness.tolist(),
        "motor_inertia": model.motor_inertia.tolist(),
        "link_viscous_friction": model.link_viscous_friction.tolist(),
        "motor_viscous_friction": model.motor_viscous_friction.tolist(),
        "inertial": model.inertial.tolist(),
        "effects": [asdict(effect) for effect in model.effects],
        "std": {f"{p.name}:{p.joint}": p.std for p in result.parameters}
        | {c.name: c.std for c in getattr(result, "combinations", ())},
        "undetermined": [f"{p.name}:{p.joint}" for p in result.parameters if p.identifiable == "no"],
        "evaluations": count.value,
        "converged": result.converged if isinstance(result, Identification) else not result.stopped,
    }


def flexviz_identify(problem: Problem, refine: bool = False) -> dict[str, Any]:
    """The user's part is one line, or `flexviz identify SET --effect NAME`."""
    with counted() as count:
        result = identify(read_set(problem.folder), effects=problem.effects, refine=refine)
    return answered(result, count)


def flexviz_refine(problem: Problem) -> dict[str, Any]:
    """The same with `--refine`."""
    return flexviz_identify(problem, refine=True)


def flexviz_diagnose(problem: Problem) -> dict[str, Any]:
    """`flexviz diagnose SET --apply`, which is told of no friction but viscous."""
    with counted() as count:
        result = diagnose(read_set(problem.folder), apply=True)
    return answered(result, count)
