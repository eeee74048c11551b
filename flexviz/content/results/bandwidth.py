"""How a residual and the parameters depend on the observer's bandwidth."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pydantic.dataclasses import dataclass

from flexviz.base.facts import Fact
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
        units: of each joint's torque, "N" where it slides; empty if all are in Nm.
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
    units: tuple[str, ...] = ()

    @property
    def untrusted(self) -> tuple[ParameterCurve, ...]:
        """Parameters that leave their interval, the largest change first."""
        return tuple(sorted((p for p in self.parameters if not p.trusted), key=lambda p: -p.moved))

    def facts(self) -> Iterator[Fact]:
        """One per joint with observer error, and one per untrusted parameter."""
        between = {"bandwidths": (float(self.bandwidths[0]), float(self.bandwidths[-1]))}
        for j in np.flatnonzero(self.observer_error):
            changes = between | {"change": float(self.change[:, j].max())}
            changes |= {"unit": self.units[j]} if self.units else {}
            yield Fact("bandwidth", "odd", (self.joints[j],), values=changes)
        for p in self.untrusted:
            values = {
                "parameter": p.name,
                "places": tuple(filter(None, (p.joint, p.place))),
                "least": float(np.nanmin(p.values)),
                "most": float(np.nanmax(p.values)),
                "unit": p.unit,
                "moved": float(p.moved),
            }
            yield Fact("bandwidth", "odd", (p.joint,) if p.joint else (), values=values)


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
        texts = tuple(fact.text for fact in check.facts())
        return GuardEntry(check.observer, check.bandwidths, check.in_use, joints, check.parameters, texts)
