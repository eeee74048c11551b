"""Start values as in the paper: rigid least squares, with inertia and friction split in half."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from flexviz.analysis.estimation.holds import HoldsTerm
from flexviz.analysis.estimation.linear_algebra import Bounds, scaled_solve
from flexviz.analysis.estimation.prior import BASIS, Prior, physically_consistent, pseudo_inertia
from flexviz.analysis.estimation.thresholds import ESTIMATION
from flexviz.base.arrays import Array
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS
from flexviz.model.equation import RIGID, Equation, Layout, LinkDynamics, OperatingPoint, Signals

GIVEN_SPREAD = 1e-9  # prior standard deviation of a constant that is not estimated


@dataclass(frozen=True)
class Start:
    """Start values, prior and bounds of a fit.

    Attributes:
        x: shape (P,).
        prior: prior around x.
        bounds: bounds of the parameters.
        point: operating point of the effects on the rigid robot; None if not evaluated.
    """

    x: Array
    prior: Prior
    bounds: Bounds
    point: OperatingPoint | None = None


def start_values(measurements: MeasurementSet, equation: Equation) -> Start:
    """Rigid least squares on θ, θ̇, θ̈ and τ of the observer, split as in the paper.

    Motor inertia: the set's rough value, or else half of the mean inertia about the joint in the rigid fit.
    Stiffness: the set's rough value, or else a guess from the torque.
    """
    lay, sig, robot = equation.layout, equation.signals, measurements.robot
    n = lay.n
    cad = physically_consistent(robot.cad_parameters)
    rigid = np.zeros(lay.size)
    rigid[lay.compliance] = RIGID  # the link moves like the motor
    point = equation.at(rigid)
    regressor = LinkDynamics(robot).regressor(sig.theta[0], sig.theta[1], sig.theta[2])
    torque = sig.tau[0].copy()
    for block in sig.blocks:
        torque[block.rows] -= regressor[block.rows] @ sig.payload[block.group].ravel()

    columns = np.zeros((sig.count, n, 12 * n + lay.size - lay.effect_start))
    columns[:, :, : 10 * n] = regressor
    for j in range(n):
        columns[:, j, 10 * n + j] = sig.theta[2, :, j]
        columns[:, j, 11 * n + j] = sig.theta[1, :, j]
    for effect, where in lay.effect_slices():
        shifted = slice(where.start - 2 * n, where.stop - 2 * n)
        law = EFFECTS[effect.effect]
        if law.linear and law.entry != "deflection":
            unit = law.terms(point.context, effect.place, _constants(lay, sig)[where])
            for m, joint in enumerate(unit.joints):
                columns[:, joint, shifted] = unit.slopes[:, 0, :, m].T

    columns, torque = columns[:, lay.fitted], torque[:, lay.fitted]
    given = measurements.initial_motor_inertia
    if not lay.motors:
        motor_inertia = np.zeros(n)
    elif given is not None:
        motor_inertia = np.array(given, float)
    else:
        solution = _rigid_fit(columns, torque, cad, None)
        fitted = _joint_inertia(solution[: 10 * n].reshape(n, 10))
        motor_inertia = 0.5 * np.maximum(fitted + solution[10 * n : 11 * n], 0.1 * _joint_inertia(cad))
    solution = _rigid_fit(columns, torque, cad, motor_inertia)
    inertial = _feasible_between(cad, solution[: 10 * n].reshape(n, 10))
    viscous = solution[11 * n : 12 * n]

    holds = HoldsTerm(measurements) if measurements.holds else None
    x = np.zeros(lay.size)
    x[lay.inertial] = inertial.ravel()
    x[lay.compliance] = 1 / _stiffness(measurements, lay, sig, regressor @ inertial.ravel(), holds)
    x[lay.link_viscous] = np.maximum(viscous, 0.0)
    if lay.motors:
        x[lay.motor_inertia] = motor_inertia
        x[lay.link_viscous] = x[lay.motor_viscous] = x[lay.link_viscous] / 2
        for j in lay.rigid:
            x[lay.motor_viscous.start + j] += x[lay.link_viscous.start + j]
            x[lay.link_viscous.start + j] = 0.0
    x[lay.compliance][list(lay.rigid)] = RIGID
    x[lay.effect_start :] = solution[12 * n :]
    return replace(_assembled(lay, sig, x, cad, holds), point=point)


def _stiffness(
    measurements: MeasurementSet, lay: Layout, sig: Signals, predicted: Array, holds: HoldsTerm | None
) -> Array:
    """Stiffnesses to start from, (n,) [Nm/rad]: of static tests, of the set, or a guess from the torque.

    `predicted`: (N, n), torque of the rigid fit, where none is measured [Nm].
    """
    torque = np.where(lay.fitted, sig.tau[0], predicted)
    guess = np.maximum(np.sqrt(np.mean(torque**2, axis=0)), 1e-3) / ESTIMATION.deflection_guess
    rough = measurements.initial_stiffness
    stiffness = guess if rough is None else np.array(rough, float)
    if holds is None:
        return stiffness
    known = holds.clamped.value > 0
    return np.where(known, 1 / np.where(known, holds.clamped.value, 1.0), stiffness)


def other_effects(start: Start, layout: Layout, signals: Signals) -> Start:
    """The same start for a model with other effects, which start at zero."""
    old = start.prior.layout
    x = np.zeros(layout.size)
    x[: layout.effect_start] = start.x[: old.effect_start]
    return _assembled(layout, signals, x, start.prior.cad, start.prior.holds)


def _assembled(lay: Layout, sig: Signals, x: Array, cad: Array, holds: HoldsTerm | None) -> Start:
    """Prior and bounds around x."""
    largest = np.max(np.abs(sig.tau[0]), axis=0)
    largest[list(lay.no_torque)] = largest.max()
    bounds = _bounds(lay, 1 / x[lay.compliance], x[lay.motor_inertia], largest, _constants(lay, sig))
    x = bounds.clip(x)
    bounds = bounds.holding(x, lay.held)
    centre = x.copy()
    centre[lay.effect_start :] = np.where(bounds.lower == bounds.upper, x, 0.0)[lay.effect_start :]
    rms_torque = np.sqrt(np.mean(sig.tau[0] ** 2, axis=0))
    rms_torque[list(lay.no_torque)] = rms_torque.max()  # for priors that are wide
    spread = _spread(lay, x, rms_torque, sig.theta[1])
    scales = tuple(
        (where.start, float(sig.count)) for e, where in lay.effect_slices() if EFFECTS[e.effect].scales_torque
    )
    coupled = tuple(_coupled(lay, rms_torque))
    prior = Prior(lay, cad, centre, spread, coupled=coupled, scales=scales, holds=holds)
    return Start(x, prior, bounds)


def _rigid_fit(columns: Array, torque: Array, cad: Array, motor_inertia: Array | None) -> Array:
    """Weighted least squares of τ on all columns with a weak CAD prior; optionally with B fixed."""
    n, size = len(cad), columns.shape[2]
    centre, scale = np.zeros(size), np.full(size, np.inf)
    centre[: 10 * n] = cad.ravel()
    for body in range(n):
        moved = np.linalg.inv(pseudo_inertia(cad[body])) @ BASIS
        scale[10 * body : 10 * body + 10] = 1 / np.sqrt(np.einsum("kab,kba->k", moved, moved))
    free = np.ones(size, bool)
    x = centre.copy()
    if motor_inertia is not None:
        free[10 * n : 11 * n] = False
        x[10 * n : 11 * n] = motor_inertia
    sigma = np.sqrt(np.mean(torque**2, axis=0)) + 1e-9
    for _ in range(3):
        weighted = (columns / sigma[:, None]).reshape(-1, size)
        target = (torque / sigma).ravel() - weighted @ x
        precision = np.where(np.isfinite(scale), 1 / scale**2, 1e-12 * (weighted**2).sum(axis=0) + 1e-12)
        a = weighted[:, free]
        matrix = a.T @ a + np.diag(precision[free])
        right = a.T @ target + precision[free] * (centre - x)[free]
        x[free] += scaled_solve(matrix, right)
        residual = torque - columns @ x
        sigma = np.sqrt(np.mean(residual**2, axis=0)) + 1e-9 * (1 + sigma)
    return x


def _joint_inertia(inertial: Array) -> Array:
    """Largest inertia of each body about its joint frame, shape (n,) [kg m²], as a scale."""
    tensor = np.zeros((len(inertial), 3, 3))
    for k, (i, j) in enumerate(((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))):
        tensor[:, i, j] = tensor[:, j, i] = inertial[:, 4 + k]
    return np.max(np.linalg.eigvalsh(tensor), axis=1)


def _feasible_between(cad: Array, fitted: Array) -> Array:
    """The physically consistent point between CAD and fit that is closest to the fit."""
    out = cad.copy()
    for body in range(len(cad)):
        for share in (1.0, 0.9, 0.7, 0.5, 0.3, 0.1):
            trial = cad[body] + share * (fitted[body] - cad[body])
            p = pseudo_inertia(trial)
            if np.linalg.eigvalsh(p)[0] > 1e-6 * np.trace(p):
                out[body] = trial
                break
    return out


def _constants(lay: Layout, sig: Signals) -> Array:
    """Constants of the effects from the range of the data, zero elsewhere, shape (P,)."""
    out = np.zeros(lay.size)
    for effect, where in lay.effect_slices():
        j = effect.joint
        if j is None:
            continue
        values = {"position": sig.theta[0, :, j], "velocity": sig.theta[1, :, j], "load": sig.tau[0, :, j]}
        reach = {name: (float(v.min()), float(v.max())) for name, v in (values | {"time": sig.time}).items()}
        constants = EFFECTS[effect.effect].constants(reach)
        out[where.start : where.start + len(constants)] = constants
    return out


def _coupled(lay: Layout, rms_torque: Array) -> Iterator[tuple[slice, Array]]:
    """Parameters with a joint prior, and its inverse covariance."""
    for effect, where in lay.effect_slices():
        j = slice(None) if effect.joint is None else effect.joint
        precision = EFFECTS[effect.effect].precision(float(np.max(rms_torque[j])) + 1e-6)
        if precision is not None:
            yield where, precision


def _bounds(
    lay: Layout, stiffness: Array, motor_inertia: Array, largest_torque: Array, constants: Array
) -> Bounds:
    lower, upper = np.full(lay.size, -np.inf), np.full(lay.size, np.inf)
    lower[lay.compliance], upper[lay.compliance] = 1e-3 / stiffness, 1e3 / stiffness
    lower[lay.motor_inertia], upper[lay.motor_inertia] = 1e-3 * motor_inertia, 1e3 * motor_inertia
    lower[lay.link_viscous] = lower[lay.motor_viscous] = 0.0
    for effect, where in lay.effect_slices():
        specs = EFFECTS[effect.effect].parameters
        # the torque of an effect is limited to the largest measured torque
        most = largest_torque.max() if effect.joint is None else largest_torque[effect.joint]
        reach = [most if p.unit == "Nm" and not p.above_torque else np.inf for p in specs]
        lower[where] = [max(p.lower, -r) for p, r in zip(specs, reach, strict=True)]
        upper[where] = [min(p.upper, r) for p, r in zip(specs, reach, strict=True)]
        given = [at for at, p in zip(range(where.start, where.stop), specs, strict=True) if p.given]
        lower[given] = upper[given] = constants[given]
    return Bounds(lower, upper)


def _spread(lay: Layout, x: Array, rms_torque: Array, velocity: Array) -> Array:
    spread = np.full(lay.size, np.inf)
    wide = ESTIMATION
    factor = np.exp(wide.stiffness_spread)
    spread[lay.compliance] = factor * x[lay.compliance]
    spread[lay.motor_inertia] = factor * x[lay.motor_inertia]
    speed = np.sqrt(np.mean(velocity**2, axis=0)) + 1e-9
    least = wide.viscous_torque * rms_torque / speed
    for side in (lay.link_viscous, lay.motor_viscous):
        spread[side] = np.maximum(wide.viscous_spread * x[side], least[: x[side].size])
    for effect, where in lay.effect_slices():
        j = slice(None) if effect.joint is None else effect.joint
        torque = float(np.max(rms_torque[j])) + 1e-6
        stiffness = float(np.max(1 / x[lay.compliance][j]))
        motion = float(np.max(speed[j]))
        units = {
            "Nm": wide.torque_spread * torque,
            "Nm/rad": wide.coefficient_spread * stiffness,
            "Nm/rad³": wide.coefficient_spread * stiffness**3 / torque**2,
            "Nm s/rad": wide.coefficient_spread * torque / motion,
            "Nm s²/rad²": wide.coefficient_spread * torque / motion**2,
            "kg m²": wide.coefficient_spread * float(np.max(lay.motor_side(x)[0][j])),
        }
        law = EFFECTS[effect.effect]
        own = np.abs(law.example) if law.example else np.ones(len(law.parameters))  # of user-defined effects
        spread[where] = [
            GIVEN_SPREAD if p.given else units.get(p.unit, wide.other_spread * max(1.0, size))
            for p, size in zip(law.parameters, own, strict=True)
        ]
    return spread
