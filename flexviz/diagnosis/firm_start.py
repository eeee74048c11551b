"""Start values in the band of the motion, with priors as firm as they deserve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS
from flexviz.equation import Layout, Signals
from flexviz.estimation import Bounds, Start, other_effects
from flexviz.measurements import MeasurementSet

LIMITS = THRESHOLDS.motion


def firm_start(given: MeasurementSet, signals: Signals, base: Start, layout: Layout) -> Start:
    """Start values with firm priors: CAD inertias, rough stiffness and motor inertia, drive gains.

    Args:
        given: the set.
        signals: of its fit groups.
        base: start values of the model without effects.
        layout: the model.
    """
    start = other_effects(base, layout, signals)
    prior, logs = start.prior, np.full(layout.size, np.inf)
    known = given.initial_stiffness is not None
    logs[layout.compliance] = LIMITS.stiffness_spread if known else LIMITS.guessed_spread
    softest = np.inf if known else LIMITS.largest_deflection
    known = given.initial_motor_inertia is not None
    logs[layout.motor_inertia] = LIMITS.motor_inertia_spread if known else LIMITS.guessed_spread
    masses = given.robot.cad_parameters[:, 0]
    real = masses > LIMITS.massless * masses.max()
    weight = np.where(real, LIMITS.inertial_spread**-2, LIMITS.massless_weight)
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
    firm = replace(prior, weight=weight, log_spread=logs, spread=spread)
    return replace(start, prior=firm, bounds=Bounds(lower, upper))
