"""The fit that is given the hidden effects, and what it gains: with the workbench of the diagnosis itself.

The only file of the study that reaches inside the diagnosis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from benchmarks.running import Json
from flexviz.analysis.diagnosis import Fit, FitContext
from flexviz.analysis.identification import identify
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS, ChosenEffect, choose_effects
from flexviz.model.equation import INERTIAL_NAMES, Equation, Layout, build_signals
from flexviz.model.observers import FlatZeroPhase
from flexviz.robot.model import EffectValue, FlexibleModel

QUICK, LONG = 12, 30  # iterations of a fit: at first, and where the gain may be about the limit
CLEAR = 3000.0  # a gain beyond which nobody asks for the last bit
ERROR_HERTZ = 5.0  # band of the errors that are compared


def final_model(document: Json, joints: Sequence[str]) -> FlexibleModel:
    """The final model of a diagnosis, or that of an identification, from its JSON."""
    parameters = document.get("model", document)["parameters"]
    values = {(p["name"], p["joint"]): p["value"] for p in parameters}
    names = ("stiffness", "motor_inertia", "link_viscous_friction", "motor_viscous_friction", *INERTIAL_NAMES)
    k, b, link, motor, *inertial = (np.array([values[name, joint] for joint in joints]) for name in names)
    entries = document["model"]["effects"] if "model" in document else _effects(parameters)
    effects = [
        EffectValue(
            e["effect"], e["joint"], {k: v["value"] for k, v in e["parameters"].items()},
            e.get("group"), e.get("payload"),
        )
        for e in entries
    ]  # fmt: skip
    return FlexibleModel(tuple(joints), k, b, link, motor, np.array(inertial).T, tuple(effects))


def _effects(parameters: Sequence[Json]) -> list[Json]:
    """The effects of a model from its parameters, EFFECT.PARAMETER each."""
    found: dict[tuple[str | None, ...], Json] = {}
    for p in parameters:
        effect, dot, name = p["name"].partition(".")
        if dot:
            place = {"effect": effect} | {key: p.get(key) for key in ("joint", "group", "payload")}
            entry = found.setdefault(tuple(place.values()), place | {"parameters": {}})
            entry["parameters"][name] = p
    return list(found.values())


def true_model(truth: Json) -> FlexibleModel:
    """The truth of a case as a model, without what the library does not have."""
    named = [e for e in truth["effects"] if e["effect"] != "unknown"]
    values = [
        EffectValue(
            e["effect"], e["joint"], e.get("all_parameters") or e["parameters"], e["group"], e["payload"]
        )
        for e in (*truth["base_effects"], *named)
    ]
    return FlexibleModel(
        tuple(truth["joints"]),
        np.array(truth["stiffness"]),
        np.array(truth["motor_inertia"]),
        np.array(truth["viscous_link"]),
        np.array(truth["viscous_motor"]),
        np.array(truth["inertial"]),
        tuple(values),
    )


def know(measurements: MeasurementSet, truth: Json, twin: MeasurementSet | None = None) -> Json:
    """Fit the base model, and the one with the true effects, started from the truth.

    Args:
        measurements: what the diagnosis sees.
        truth: what is hidden in it.
        twin: the same without the law that the library does not have, where there is one.

    Returns:
        gain: fall of χ² (and the weighting's determinant) from the best base model to the fit that is given
            the effects; of a law that the library does not have, to the base model's fit of the twin; of a
            clean set, to the noise floor itself.
        gains: the same for each hidden effect when the fit has all others.
        objective_gain: the same fall in the diagnosis' own objective.
        chi, chi_base: (n,) mean square of the whitened residual, fit groups, with and without what is hidden.
        chi_held_out: (n,) of the validation group, with what is hidden.
        converged: both fits; stiffness, motor_inertia, effects, errors: of the one that is given the effects.
    """
    joints, true = measurements.joints, true_model(truth)
    base = Layout(joints, choose_effects(measurements.effects, joints))
    context = FitContext(measurements, base)
    hidden = [chosen(e, joints) for e in true.effects[len(truth["base_effects"]) :]]
    plain = identify(measurements, refine=False)
    without = context.fit(base, base.vector(plain.model), iterations=QUICK)
    gains: list[float] = []
    if not hidden:
        model, best = base.model(without.x), _fitted_to(twin, base) if twin is not None else without
        floor = _samples(without) * base.n
        gain = _misfit(without) - floor if twin is None else _chi_square(without) - _chi_square(best)
        objective_gain = gain
    else:
        layout = with_hidden(base, hidden)
        best = context.fit(layout, layout.vector(true), iterations=QUICK)
        if not best.converged:
            best = _better(best, context.fit(layout, best.x, iterations=LONG))
        model = layout.model(best.x)
        without = _careful(context, base, true, without, best)
        for k in range(len(hidden)):
            part = without
            if len(hidden) > 1:
                less = with_hidden(base, hidden[:k] + hidden[k + 1 :])
                part = context.fit(less, less.vector(model), iterations=QUICK)
                part = _careful(context, less, true, part, best)
            gains.append(_chi_square(part) - _chi_square(best))
        gain, objective_gain = _chi_square(without) - _chi_square(best), without.objective - best.objective
    return {
        "gain": gain,
        "gains": gains,
        "objective_gain": objective_gain,
        "chi": best.chi.tolist(),
        "chi_base": without.chi.tolist(),
        "chi_held_out": best.chi_held_out.tolist(),
        "converged": without.converged and best.converged,
        "errors": errors(measurements, model) if gains or not truth["effects"] else None,
        "stiffness": model.stiffness.tolist(),
        "motor_inertia": model.motor_inertia.tolist(),
        "effects": [asdict(e) for e in model.effects],
    }


def _fitted_to(measurements: MeasurementSet, layout: Layout) -> Fit:
    """The base model fitted to a set that lacks nothing."""
    start = layout.vector(identify(measurements, refine=False).model)
    return FitContext(measurements, layout).fit(layout, start, iterations=LONG)


def chosen(effect: EffectValue, joints: Sequence[str]) -> ChosenEffect:
    """An effect's place in a layout."""
    joint = None if effect.joint is None else list(joints).index(effect.joint)
    return ChosenEffect(effect.effect, joint, effect.group, effect.payload)


def with_hidden(base: Layout, hidden: Sequence[ChosenEffect]) -> Layout:
    """The base model's effects and the hidden ones, without those that a hidden one replaces."""
    replaced = {(EFFECTS[h.effect].replaces, h.joint) for h in hidden}
    kept = tuple(e for e in base.effects if (e.effect, e.joint) not in replaced)
    return Layout(base.joints, (*kept, *hidden))


def errors(measurements: MeasurementSet, model: FlexibleModel) -> list[float]:
    """Residual rms of a model per joint over the held-out groups [Nm], in a band that is flat."""
    groups = [g for g in measurements.groups if g.validation]
    layout = Layout(measurements.joints, tuple(chosen(e, measurements.joints) for e in model.effects))
    x = layout.vector(model)
    signals = build_signals(measurements, groups, FlatZeroPhase(2 * np.pi * ERROR_HERTZ))
    equation = Equation(measurements.robot, signals, layout)
    residual = equation.evaluate(x).residual
    return np.sqrt(np.mean(residual**2, axis=0)).tolist()


def _careful(context: FitContext, layout: Layout, true: FlexibleModel, fit: Fit, full: Fit) -> Fit:
    """A fit without something, followed to its end and begun from the truth, too, where that may matter."""
    if _chi_square(fit) - _chi_square(full) > CLEAR:
        return fit
    for start in (fit.x, layout.vector(true)):
        fit = _better(fit, context.fit(layout, start, iterations=LONG))
    return fit


def _better(one: Fit, other: Fit) -> Fit:
    return one if one.objective <= other.objective else other


def _chi_square(fit: Fit) -> float:
    """χ² over fit and validation groups, with the determinant of the weightings."""
    points = [p for p in (fit.point, fit.held_out) if p is not None]
    return _misfit(fit) + sum(m.log_determinant for p in points for m in p.weightings)


def _misfit(fit: Fit) -> float:
    """χ² over fit and validation groups.

    A joint below its noise counts as at its noise: a model must not win by taking the noise for larger.
    """
    total = 0.0
    for point in (p for p in (fit.point, fit.held_out) if p is not None):
        samples = np.count_nonzero(point.used)
        total += float(np.maximum(np.sum(point.r**2, axis=0), samples).sum())
    return total


def _samples(fit: Fit) -> int:
    return sum(int(np.count_nonzero(p.used)) for p in (fit.point, fit.held_out) if p is not None)
