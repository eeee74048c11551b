"""Records of a diagnosis for plots and reports."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import CURVES, CurveForm, curve_points, simple_form
from flexviz.statistics import NORMAL_95

Array = NDArray[np.float64]

DIRECTED = "position × direction"
UNITS = {
    "position": "rad", "velocity": "rad/s", "acceleration": "rad/s²", "load": "Nm", DIRECTED: "rad",
    "time": "s", "group": "-", "frequency": "Hz",
}  # fmt: skip
DIRECTIONS = ("forward", "backward")
DIRECTION_GAIN = THRESHOLDS.evidence.share  # that position and direction together have to explain more
FREE_CURVE_NOTE = "a stopgap fitted to the residual, not a model: it shows where, not why"


@dataclass(frozen=True, eq=False)
class ResidualMap:
    """Residual of one joint against one variable.

    Attributes:
        joint, variable: of the residual; "position × direction" has one curve per direction.
        curves: names of the S curves: directions, groups (against time), or "" for a single one; for
            "frequency" the residual and its noise floor.
        centres: shape (S, B), mean of the variable in each bin, in its `unit`; NaN in empty bins.
        mean: shape (S, B), mean residual [Nm]; for "frequency" the square root of its density [Nm/√Hz].
        std: shape (S, B), standard error of the mean, including autocorrelation [Nm].
        count: shape (S, B), samples; for "frequency" spectral lines.
        explained, explained_std: out-of-sample share of the residual's mean square, and its standard error;
            zero on average for noise. For "frequency" that of the strongest band of one hertz above the noise
            floor, excluding the frequencies of the motion and their harmonics.
        explained_by_group: group → share within its samples.
        range: shortest range of the variable that contains half of the explained share.
    """

    joint: str
    variable: str
    unit: str
    curves: tuple[str, ...]
    centres: Array
    mean: Array
    std: Array
    count: NDArray[np.int64]
    explained: float
    explained_std: float
    explained_by_group: dict[str, float]
    range: tuple[float, float]


@dataclass(frozen=True, eq=False)
class FreeCurve:
    """Residual torque of one joint as a smooth curve of one variable.

    Attributes:
        joint, variable, unit: what it is of; position and velocity may have one curve per direction.
        directions: names of the S curves: forward and backward, or "" for a single one.
        centres: shape (M,), values of the variable.
        value: shape (S, M), torque missing in the model [Nm]; positive like friction at positive velocity;
            NaN outside the range of the motion. The part that the model's parameters can absorb is excluded,
            so that, e.g., extra friction beside Coulomb friction is known up to a constant.
        std: shape (S, M), its standard error [Nm].
        explained, explained_std: share of the joint's residual predicted out of sample; its standard error.
        smoothing: variance of an independent sample, relative to which the curve's prior counts [Nm²].
        form: the simple law that the curve resembles, in words; empty if there is none.
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
    note: str = FREE_CURVE_NOTE
    form: str = ""

    @property
    def certain(self) -> bool:
        """Whether it explains anything beyond doubt."""
        return self.explained >= NORMAL_95 * self.explained_std

    def simple_form(self) -> CurveForm | None:
        """The simple law that the curve resembles."""
        points = curve_points(self.variable, self.centres.tolist(), self.value.tolist(), self.std.tolist())
        return simple_form(points, self.variable, self.unit)

    @property
    def effects(self) -> tuple[str, ...]:
        """The free curves of a model that are of its kind, on motor and link; none against acceleration."""
        kind = self.variable, len(self.directions) > 1
        return tuple(curve.name for curve in CURVES if (curve.variable, curve.each_way) == kind)


@dataclass(frozen=True, eq=False)
class ParameterCurve:
    """One parameter over the bandwidth.

    Attributes:
        name, joint, unit: as in the JSON contract; inertias as identifiable combinations, without a joint.
        place: payload or group of the effect, if any.
        values, std: shape (M,); NaN at a bound.
        moved: largest distance of a narrower band's value from that in use, in standard errors of the latter.
        trusted: it stays within its 95 % interval, or noise explains the difference of the two fits.
    """

    name: str
    joint: str | None
    unit: str
    place: str | None
    values: Array
    std: Array
    moved: float
    trusted: bool


@dataclass(frozen=True, eq=False)
class BandwidthCheck:
    """Dependence of residual and parameters on the observer's bandwidth.

    Attributes:
        bandwidths: shape (M,), ascending [rad/s].
        in_use: index of the bandwidth in use.
        rms: shape (M, n), residual below `band` after fitting at each bandwidth [Nm].
        noise_floor: shape (n,), its part due to measurement noise [Nm].
        change: shape (M, n), rms change of the residual relative to the bandwidth in use, at the parameters
            found there [Nm]; noise changes nothing: below `band` [rad/s], all bands are flat.
        observer_error: shape (n,), a wider band changes the residual by more than noise and by a share of it
            that counts.
        parameters: identifiable parameters.
        seconds: wall time.
    """

    bandwidths: Array
    in_use: int
    joints: tuple[str, ...]
    rms: Array
    noise_floor: Array
    change: Array
    band: float
    observer_error: NDArray[np.bool_]
    parameters: tuple[ParameterCurve, ...]
    seconds: float
    observer: str = "two bands"

    @property
    def untrusted(self) -> tuple[ParameterCurve, ...]:
        """Parameters that leave their interval, the largest change first."""
        return tuple(sorted((p for p in self.parameters if not p.trusted), key=lambda p: -p.moved))

    def texts(self) -> tuple[str, ...]:
        """One sentence per joint with observer error and per untrusted parameter."""
        low, high = self.bandwidths[0], self.bandwidths[-1]
        joints = (
            f"{self.joints[j]}: the residual changes by up to {self.change[:, j].max():.3g} Nm between "
            f"bandwidths of {low:.3g} and {high:.3g} rad/s: part of it is observer error, not physics"
            for j in np.flatnonzero(self.observer_error)
        )
        places = (", ".join(filter(None, (p.joint, p.place))) for p in self.untrusted)
        parameters = (
            f"{p.name}{place and f' ({place})'} changes with the bandwidth between "
            f"{np.nanmin(p.values):.4g} and {np.nanmax(p.values):.4g} {p.unit}, {p.moved:.1f} standard "
            "errors: not to be trusted"
            for p, place in zip(self.untrusted, places, strict=True)
        )
        return (*joints, *parameters)
