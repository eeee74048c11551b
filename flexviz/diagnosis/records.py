"""Records of a diagnosis that plots and reports read; no computation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

DIRECTED = "position × direction"
UNITS = {
    "position": "rad",
    "velocity": "rad/s",
    "acceleration": "rad/s²",
    "load": "Nm",
    DIRECTED: "rad",
    "time": "s",
    "group": "-",
    "frequency": "Hz",
}
DIRECTIONS = ("forward", "backward")
DIRECTION_GAIN = 0.05  # share more that position and direction together have to explain
NOTE = "a stopgap drawn through the residual, not a model: it says where, not why"


@dataclass(frozen=True, eq=False)
class ResidualMap:
    """One joint's residual against one variable: what a plot shows, and what it explains.

    Attributes:
        joint, variable: whose, against what; "position × direction" has one curve a direction.
        unit: of the variable.
        curves: names of the S curves: directions, groups (against time), "" where there is one. For
            "frequency" they are the residual and its noise floor.
        centres: shape (S, B), mean of the variable in each bin; NaN in empty ones.
        mean: shape (S, B), mean residual there [Nm]; for "frequency" the root of its density [Nm/√Hz].
        std: shape (S, B), standard error of the mean, autocorrelation included [Nm].
        count: shape (S, B), samples; for "frequency" lines of the spectra.
        explained: share of the residual's mean square that its mean against the variable predicts out of
            sample: zero on average for noise, so that it may also be a little below zero. For "frequency"
            the share that the strongest band of one hertz has above the noise floor, beyond the motion's own
            frequencies and their harmonics: what is slower is a matter of the other variables.
        explained_std: its standard error.
        explained_by_group: group → the same among its samples.
        range: what carries most of it: the shortest range with half of what is explained.
    """

    joint: str
    variable: str
    unit: str
    curves: tuple[str, ...]
    centres: Array
    mean: Array
    std: Array
    count: Ints
    explained: float
    explained_std: float
    explained_by_group: dict[str, float]
    range: tuple[float, float]


@dataclass(frozen=True, eq=False)
class FreeCurve:
    """A curve of residual torque against one variable of one joint.

    Attributes:
        joint, variable: where; "position" and "velocity" may have one curve a direction of motion.
        unit: of the variable.
        directions: names of the S curves: forward and backward, or "" where there is one.
        centres: shape (M,), of the variable.
        value: shape (S, M), the torque that the model lacks [Nm]; positive like friction at positive speed.
            NaN where the joint never was. What the model's own parameters can take is not in it: a patch of
            friction beside Coulomb friction is known up to a constant.
        std: shape (S, M), its standard error [Nm].
        explained: share of the joint's residual that the curve predicts out of sample.
        explained_std: its standard error.
        smoothing: weight of the penalty that cross-validation chose.
        note: what it is.
    """

    joint: str
    variable: str
    unit: str
    directions: tuple[str, ...]
    centres: Array
    value: Array
    std: Array
    explained: float
    explained_std: float
    smoothing: float
    note: str = NOTE


@dataclass(frozen=True, eq=False)
class ParameterCurve:
    """One parameter over the bandwidth.

    Attributes:
        name, joint, unit: as in the JSON contract; inertias as identifiable combinations, without a joint.
        place: payload or group of an effect that concerns one.
        values, std: shape (M,); NaN where the fit put it onto a bound.
        moved: largest distance from its value at the bandwidth in use, in standard errors there.
        excuse: the same in standard errors of the difference, from what every second of the data contributes
            to both; noise and even a model error would keep it small.
        trusted: it stays within its 95 % interval, or noise is an excuse.
    """

    name: str
    joint: str | None
    unit: str
    place: str | None
    values: Array
    std: Array
    moved: float
    excuse: float
    trusted: bool


@dataclass(frozen=True, eq=False)
class BandwidthCheck:
    """What moves with the bandwidth.

    Attributes:
        observer: its name; "two bands" for the diagnosis' own.
        bandwidths: shape (M,), rising [rad/s].
        in_use: index of the one that is in use.
        joints: names.
        rms: shape (M, n), residual after fitting at that bandwidth, compared below `band` [Nm].
        noise_floor: shape (n,), what the measurement noise leaves of it [Nm].
        change: shape (M, n), rms of the residual's change against the bandwidth in use, at the parameters
            found there [Nm].
        change_noise: shape (M, n), what the noise explains of that [Nm].
        band: the residuals are compared up to here [rad/s].
        observer_error: shape (n,), at a wider band the residual differs by more than noise and by a fair
            share of itself.
        parameters: those that the data determine.
        seconds: it took.
    """

    observer: str
    bandwidths: Array
    in_use: int
    joints: tuple[str, ...]
    rms: Array
    noise_floor: Array
    change: Array
    change_noise: Array
    band: float
    observer_error: Bools
    parameters: tuple[ParameterCurve, ...]
    seconds: float

    @property
    def untrusted(self) -> tuple[ParameterCurve, ...]:
        """Parameters that move by more than their interval, the one that moves most first."""
        return tuple(sorted((p for p in self.parameters if not p.trusted), key=lambda p: -p.moved))

    def texts(self) -> tuple[str, ...]:
        """One sentence for each thing that moves; empty where nothing does."""
        low, high = self.bandwidths[0], self.bandwidths[-1]
        out = [
            f"{joint}: the residual changes by up to {self.change[:, j].max():.3g} Nm when the bandwidth "
            f"goes from {low:.3g} to {high:.3g} rad/s: part of it is observer error, not physics"
            for j, joint in enumerate(self.joints)
            if self.observer_error[j]
        ]
        for p in self.untrusted:
            place = ", ".join(part for part in (p.joint, p.place) if part)
            out.append(
                f"{p.name}{f' ({place})' if place else ''} moves with the bandwidth from "
                f"{np.nanmin(p.values):.4g} to {np.nanmax(p.values):.4g} {p.unit}, {p.moved:.1f} standard "
                "errors: not to be trusted"
            )
        return tuple(out)
