"""How a residual and the parameters depend on the observer's bandwidth."""

from __future__ import annotations

import numpy as np
from pydantic.dataclasses import dataclass

from flexviz.base.fields import RECORD, Column, Flags, Real, Rows


@dataclass(frozen=True, eq=False, config=RECORD)
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
    values: Column
    std: Column
    moved: Real
    trusted: bool


@dataclass(frozen=True, eq=False, config=RECORD)
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

    bandwidths: Column
    in_use: int
    joints: tuple[str, ...]
    rms: Rows
    noise_floor: Column
    change: Rows
    band: float
    observer_error: Flags
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


@dataclass(frozen=True, eq=False, config=RECORD)
class GuardJointEntry:
    """What moves with the bandwidth at one joint [Nm], one number per bandwidth."""

    joint: str
    rms: Column
    change: Column
    change_noise: Column
    observer_error: bool


@dataclass(frozen=True, eq=False, config=RECORD)
class GuardEntry:
    """What moves with the observer's bandwidth [rad/s], joint by joint."""

    observer: str
    bandwidths: Column
    in_use: int
    joints: tuple[GuardJointEntry, ...]
    parameters: tuple[ParameterCurve, ...]
    texts: tuple[str, ...]

    @staticmethod
    def of(check: BandwidthCheck) -> GuardEntry:
        """The entry of a bandwidth check."""
        noise = np.zeros(len(check.bandwidths))  # of `change`: below `band`, all bands are flat
        joints = tuple(
            GuardJointEntry(name, check.rms[:, j], check.change[:, j], noise, bool(check.observer_error[j]))
            for j, name in enumerate(check.joints)
        )
        return GuardEntry(
            check.observer, check.bandwidths, check.in_use, joints, check.parameters, check.texts()
        )
