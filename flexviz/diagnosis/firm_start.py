"""Start values in the band of the motion, with priors as firm as they deserve."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS, free_curve
from flexviz.equation import Layout, Signals
from flexviz.estimation import Bounds, Start, other_effects
from flexviz.measurements import MeasurementSet

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.prior


def firm_start(
    given: MeasurementSet, signals: Signals, base: Start, layout: Layout, stand_ins: bool = False
) -> Start:
    """Start values with firm priors: CAD inertias, rough stiffness and motor inertia, drive gains.

    Args:
        given: the set.
        signals: of its fit groups.
        base: start values of the model without effects.
        layout: the model.
        stand_ins: free curves only stand for what has no law.
    """
    start = other_effects(base, layout, signals)
    prior, logs = start.prior, np.full(layout.size, np.inf)
    known = given.initial_stiffness is not None
    logs[layout.compliance] = LIMITS.stiffness_spread if known else LIMITS.guessed_spread
    softest = np.inf if known else LIMITS.largest_deflection
    known = given.initial_motor_inertia is not None
    logs[layout.motor_inertia] = LIMITS.motor_inertia_spread if known else LIMITS.guessed_spread
    masses = given.robot.cad_parameters[:, 0]
    real = masses > LIMITS.massless * masses.max()  # the others are dummies
    weight = np.where(real, LIMITS.inertial_spread**-2, prior.weight)
    spread, lower, upper = prior.spread.copy(), start.bounds.lower.copy(), start.bounds.upper.copy()
    # stiff joints do not show how viscous friction is split between motor and link
    speed = np.sqrt(np.mean(signals.theta[1] ** 2, axis=0)) + 1e-9
    rms_torque = np.sqrt(np.mean(signals.tau[0] ** 2, axis=0)) + 1e-9
    upper[layout.compliance] = np.minimum(upper[layout.compliance], softest / rms_torque)
    half = start.x[layout.link_viscous]
    spread[layout.link_viscous] = LIMITS.split_spread * half + LIMITS.split_torque * rms_torque / speed
    offsets = {e.joint for e in layout.effects if EFFECTS[e.effect].constant}
    for effect, where in layout.effect_slices():
        law = EFFECTS[effect.effect]
        for k, spec in zip(range(where.start, where.stop), law.parameters, strict=True):
            spread[k] = law.expected.get(spec.name, spread[k])
            if spec.name == law.offset_parameter and effect.joint in offsets:
                lower[k] = upper[k] = float(np.mean(signals.theta[0, :, effect.joint]))
    coupled = tuple(_stand_ins(layout, np.std(signals.tau[0], axis=0))) if stand_ins else prior.coupled
    firm = replace(prior, weight=weight, log_spread=logs, spread=spread, coupled=coupled)
    return replace(start, prior=firm, bounds=Bounds(lower, upper))


def _stand_ins(layout: Layout, torque: Array) -> Iterator[tuple[slice, Array]]:
    """Parameters of free curves and their inverse covariance; `torque` is the spread of each joint's, (n,).

    Their mean and slope are left to the effects that a constant torque, a spring or friction is.
    """
    for effect, where in layout.effect_slices():
        curve = free_curve(effect.effect)
        if curve is None:
            continue
        size = float(torque[effect.place.own_joint])
        precision = curve.precision(size)
        for branch in curve.branches:
            nodes = np.arange(len(branch)) - 0.5 * (len(branch) - 1)
            for form in (np.ones(len(branch)), nodes / np.abs(nodes).max()):
                along = form / (form @ form)
                precision[np.ix_(branch, branch)] += np.outer(along, along) / (LIMITS.curve_trend * size) ** 2
        yield where, precision
