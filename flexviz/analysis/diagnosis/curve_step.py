"""The free curve of a diagnosis that ended with "unknown", as a further step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from threadpoolctl import threadpool_limits

from flexviz.analysis.diagnosis.curves import fit_free_curve
from flexviz.analysis.diagnosis.findings import Stair, effect_values, finding, made_step
from flexviz.analysis.diagnosis.fit_context import FitContext
from flexviz.analysis.diagnosis.notes import notes
from flexviz.analysis.diagnosis.prediction_errors import PredictionErrorBand
from flexviz.analysis.diagnosis.residual_location import locate_residual
from flexviz.analysis.diagnosis.result import Diagnosis
from flexviz.analysis.diagnosis.stages import SearchStage
from flexviz.analysis.identification import parameter_estimates
from flexviz.analysis.motion import MotionContext
from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import ChosenEffect, free_curve
from flexviz.model.equation import layout_of

# kinds of notes that are renewed, or are of the model without the curve
OLD_NOTES = ("free-curve", "stopgap", "unexplained", "changing", "unbiased", "bandwidth", "model-error")


def why_no_curve(diagnosis: Diagnosis) -> Fact | None:
    """Why no free curve can be added after a diagnosis; None if one can."""
    last = diagnosis.steps[-1].verdict if diagnosis.steps else diagnosis.verdict
    curve, own = diagnosis.free_curve, diagnosis.model.effects if diagnosis.model else ()
    present = [(one, e.joint) for e in own if (one := free_curve(e.effect)) is not None]
    joints, values = (curve.joint,) if curve is not None else (), dict[str, Any]()
    if last != "unknown":
        why, values = "verdict", {"verdict": last}
    elif curve is None and present:
        why, joints = "has-one", (str(present[-1][1]),)
    elif curve is None:
        why = "stopped"
    elif not curve.effects:
        why, values = "no-such-curve", {"variable": curve.variable}
    elif not curve.certain:
        why, values = "uncertain", {"share": curve.explained, "error": curve.explained_std}
    elif any((one.variable, joint) == (curve.variable, curve.joint) for one, joint in present):
        why, values = "has-this-one", {"variable": curve.variable}
    else:
        return None
    return Fact("no-free-curve", joints=joints, values={"why": why} | values)


def with_free_curve(
    measurements: MeasurementSet, diagnosis: Diagnosis, tell: Callable[[Fact | str], None] = lambda what: None
) -> Diagnosis:
    """The diagnosis with its free curve as one more step, estimated together with everything else.

    The curve extends the last model, on the motor or on the link, whichever explains more. `tell` is called
    with progress messages, and may raise to stop.

    Raises:
        InputError: there is no curve to add (`why_no_curve`).
    """
    if why := why_no_curve(diagnosis):
        raise InputError(f"no free curve is added: {why}")
    curve, model = diagnosis.free_curve, diagnosis.model
    assert curve is not None and model is not None
    joints, tell_nothing = measurements.joints, partial(tell, "")
    with threadpool_limits(1, "blas"):
        chosen = (ChosenEffect.of(value, joints) for value in model.effects)
        own = layout_of(measurements).with_effects(chosen)
        context, band = MotionContext(measurements, joints), PredictionErrorBand(measurements)
        before = context.fit(own, own.vector(model), iterations=0)
        if any(note.kind == "standstill" for note in diagnosis.notes):
            context.set_standstill_apart(before)
        tell(SearchStage.FREE_CURVE.fact)
        larger = [ChosenEffect(name, joints.index(curve.joint)) for name in curve.effects]
        layouts = [own.with_effects((*own.effects, effect)) for effect in larger]
        fits = [context.fit(one, one.vector(model), check=tell_nothing) for one in layouts]
        after = min(fits, key=lambda fit: fit.objective)
        layout = after.layout
        first, last = (
            Stair(
                added,
                fit.layout,
                fit.x,
                fit.covariances(fit.at_bound)[0],
                band.errors(fit, context.first_phase),
            )
            for added, fit in ((None, before), (layout.effects[-1], after))
        )
        tell(SearchStage.LOCATION.fact)
        at_noise = FitContext(measurements, layout)
        fit = at_noise.fit(layout, after.x, iterations=0)
        places, maps, parts = locate_residual(at_noise, fit)
        left, prior = fit_free_curve(at_noise, fit, places[0], parts), context.start(layout).prior
        kept = (note for note in diagnosis.notes if note.kind not in OLD_NOTES)
        step = made_step(finding(layout.effects[-1], first, last, last, band), last, "unknown")
        return replace(
            diagnosis,
            where=places,
            steps=(*diagnosis.steps, step),
            effects=effect_values(last),
            parameters=parameter_estimates(
                layout, after.x, prior.centre, last.covariance, after.at_bound, prior
            ),
            notes=(*kept, *notes(fit, "unknown", last.errors, None, left, None)),
            model=layout.model(after.x),
            maps=maps,
            free_curve=left,
            guard=None,
        )
