"""The single runs of a study, as tasks."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from flexviz.analysis.diagnosis import diagnose
from flexviz.analysis.identification import FitSettings, identify
from flexviz.base.files import temporary_folder
from flexviz.base.limits import read_json
from flexviz.content.records import mean_nrms
from flexviz.content.view import truth_values
from flexviz.data.measurements import Group, MeasurementSet, Segment, read_set
from flexviz.model.simulation import Plan, Run, make_plan, move, record, simulate_plan, write_plan
from flexviz.outlets.batch.analysis import known_set
from flexviz.outlets.batch.tasks import Json
from flexviz.robot.model import INERTIAL_NAMES

MARGIN = 1.0  # [s] beside a block of a bootstrap, for the ends that an observer needs
NOTHING = "none"


def simulated_run(what: Json, where: Json) -> Json:
    """Simulate with one seed, identify (and diagnose): values and truth."""
    with temporary_folder("study") as folder:
        measurements, truth = _simulated(what, where, folder / "set")
        return {**_outcome(measurements, what), "truth": truth}


def resampled_run(what: Json, where: Json) -> Json:
    """Identify from blocks of the set's groups, drawn with replacement."""
    rng = np.random.default_rng(what["seed"])
    measurements = known_set(what, where)
    drawn = (g if g.validation else _resampled(g, what["block"], rng) for g in measurements.groups)
    return _outcome(replace(measurements, groups=tuple(drawn)), what)


def sweep_run(what: Json, where: Json) -> Json:
    """Identify at one bandwidth."""
    return _outcome(known_set(what, where), what)


def _outcome(measurements: MeasurementSet, what: Json) -> Json:
    """Values with standard errors, error relative to the torque, verdict and effects found."""
    settings = FitSettings(**what["fit"])
    result = identify(measurements, settings)
    rms, parameters = result.residual.rms_validation or result.residual.rms, result.parameters
    out: Json = {"converged": bool(result.converged), "residual": mean_nrms(rms, measurements.torque_spread)}
    if what.get("diagnosed"):
        extended = replace(measurements, effects=(*measurements.effects, *settings.effects))
        document = diagnose(extended, apply=True).document()
        parameters = document.all_parameters
        out |= {"verdict": document.verdict, "final_verdict": document.final_verdict}
        out["found"] = [step.added.text for step in document.steps if step.added is not None]
    known = (p for p in parameters if p.name not in INERTIAL_NAMES)
    out["parameters"] = {
        p.label: [p.value, p.std if math.isfinite(p.std) else None, p.unit, p.identifiable] for p in known
    }
    return out


def _simulated(what: Json, where: Json, folder: Path) -> tuple[MeasurementSet, dict[str, float]]:
    plan, runs = _motion(where.get("path") or what["preset"], tuple(what["hidden"]), what["start"])
    seed = what["seed"]
    noisy = simulate_plan(plan, seed) if plan.sensors.feedback else record(plan, runs, seed)
    write_plan(plan, noisy, folder, seed)
    truth = truth_values(read_json(folder / "truth.json"))
    joined = {key: ":".join(filter(None, key)) for key in truth if key[0] not in INERTIAL_NAMES}
    known = {name: truth[key] for key, name in joined.items()}
    return read_set(folder, logged=False), known


@lru_cache(maxsize=2)
def _motion(source: str, hidden: tuple[str, ...], start: str) -> tuple[Plan, dict[str, Run]]:
    """A simulated motion without measurement noise, the same for all seeds."""
    plan = make_plan(source, [one for one in hidden if one != NOTHING], start)
    return plan, {} if plan.sensors.feedback else move(plan)


def _resampled(group: Group, block: float, rng: np.random.Generator) -> Group:
    """The group with as many blocks [s] as fit into it, drawn with replacement, each with its margins."""
    found: list[Segment] = []
    for segment in group.segments:
        length = max(round(block / segment.step), 1)
        count = max(len(segment) // length, 1)
        margin = round(MARGIN / segment.step)
        for number in sorted(rng.integers(0, count, size=count)):
            first, last = max(number * length - margin, 0), min((number + 1) * length + margin, len(segment))
            part = slice(int(first), int(last))
            found.append(Segment(segment.time[part], segment.theta[part], segment.tau[part], segment.step))
    return replace(group, segments=tuple(found))
