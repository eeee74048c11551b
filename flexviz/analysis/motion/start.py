"""Start values in the band of the motion, with priors as firm as they deserve."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.estimation import Bounds, Start, other_effects
from flexviz.analysis.motion.thresholds import MOTION
from flexviz.base.statistics import NORMAL_95
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS, free_curve
from flexviz.model.equation import Layout, Signals

Array = NDArray[np.float64]


def firm_start(
    given: MeasurementSet, signals: Signals, base: Start, layout: Layout, stand_ins: bool
) -> Start:
    """Start values with firm priors: CAD inertias, rough stiffness and motor inertia, drive gains.

    `base` is the start of the model without effects, in `signals` of the fit groups; with `stand_ins` free
    curves only stand for what has no law.
    """
    start = other_effects(base, layout, signals)
    prior, logs = start.prior, np.full(layout.size, np.inf)
    guessed = given.initial_stiffness is None
    logs[layout.compliance] = MOTION.guessed_spread if guessed else MOTION.rough_spread
    spread, lower, upper = prior.spread.copy(), start.bounds.lower.copy(), start.bounds.upper.copy()
    if guessed:
        softest = start.x[layout.compliance] * np.exp(NORMAL_95 * MOTION.guessed_spread)
        upper[layout.compliance] = np.minimum(upper[layout.compliance], softest)
    guessed = given.initial_motor_inertia is None
    logs[layout.motor_inertia] = MOTION.guessed_spread if guessed else MOTION.rough_spread
    dummy = given.robot.cad_parameters[:, 0] < prior.cad[:, 0]  # which was given a mass
    weight = np.where(dummy, prior.weight, MOTION.computed_spread**-2)
    # stiff joints do not show how viscous friction is split between motor and link
    torque, speed = (np.sqrt(np.mean(v**2, axis=0)) + 1e-9 for v in (signals.tau[0], signals.theta[1]))
    least = MOTION.hidden_torque * torque / speed
    spread[layout.link_viscous] = MOTION.computed_spread * start.x[layout.link_viscous] + least
    offsets = {e.joint for e in layout.effects if EFFECTS[e.effect].constant}
    for effect, where in layout.effect_slices():
        law = EFFECTS[effect.effect]
        for k, spec in zip(range(where.start, where.stop), law.parameters, strict=True):
            spread[k] = law.expected.get(spec.name, spread[k])
            if spec.name == law.offset_parameter and effect.joint in offsets:
                lower[k] = upper[k] = float(np.mean(signals.theta[0, :, effect.joint]))
    coupled = tuple(_stand_ins(layout, np.std(signals.tau[0], axis=0))) if stand_ins else prior.coupled
    firm = replace(prior, weight=weight, log_spread=logs, spread=spread, coupled=coupled)
    return replace(start, prior=firm, bounds=Bounds(lower, upper).holding(start.x, layout.held))


def _stand_ins(layout: Layout, torque: Array) -> Iterator[tuple[slice, Array]]:
    """Parameters of free curves and their inverse covariance; `torque` is the spread of each joint's, (n,).

    Their mean and slope are left to the effects that a constant torque, a spring or friction is.
    """
    for effect, where in layout.effect_slices():
        curve = free_curve(effect.effect)
        if curve is None:
            continue
        size = float(torque[effect.place.own_joint])
        precision, least = curve.precision(size), MOTION.hidden_torque * size
        for branch in curve.branches:
            nodes = np.arange(len(branch)) - 0.5 * (len(branch) - 1)
            for form in (np.ones(len(branch)), nodes / np.abs(nodes).max()):
                along = form / (form @ form)
                precision[np.ix_(branch, branch)] += np.outer(along, along) / least**2
        yield where, precision
