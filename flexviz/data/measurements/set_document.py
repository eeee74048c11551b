"""The content of a `measurements.toml`, from its parts."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from typing import Any, TypedDict

from flexviz.base.names import names_of
from flexviz.data.measurements.data import Array
from flexviz.data.measurements.schema import FORMAT, TorqueSide
from flexviz.robot.mounting import GRAVITY
from flexviz.robot.robot import PayloadBody


class SetProperties(TypedDict, total=False):
    """What a measurement set says about its robot and recording, n joints; everything can be left out."""

    gravity: Sequence[float]  # (3,) [m/s²] in the base's frame
    torque_hold: float  # [s]
    initial_stiffness: Sequence[float] | Array | None  # (n,) [Nm/rad]
    initial_motor_inertia: Sequence[float] | Array | None  # (n,) [kg m²] at the joint side
    kp: Sequence[float] | Array | None  # (n,) [Nm/rad]
    kd: Sequence[float] | Array | None  # (n,) [Nm s/rad]
    effects: str | Sequence[str]  # the model starts with, on every joint
    date: dt.datetime | dt.date | None  # of the recording
    torque: TorqueSide | None  # what τ is; None: the data decide
    rigid: str | Sequence[str]  # joints without elasticity
    no_torque: str | Sequence[str]  # joints whose τ is no signal
    drive: Mapping[str, Any] | None  # "from", "kp", "same": joints that follow goals


def set_document(
    robot: str,
    joints: Sequence[str],
    payloads: Mapping[str, Sequence[PayloadBody]],
    groups: Sequence[dict[str, Any]],
    *,
    gravity: Sequence[float] = GRAVITY,
    torque_hold: float = 0.0,
    initial_stiffness: Sequence[float] | Array | None = None,
    initial_motor_inertia: Sequence[float] | Array | None = None,
    kp: Sequence[float] | Array | None = None,
    kd: Sequence[float] | Array | None = None,
    effects: str | Sequence[str] = (),
    date: dt.datetime | dt.date | None = None,
    torque: TorqueSide | None = None,
    rigid: str | Sequence[str] = (),
    no_torque: str | Sequence[str] = (),
    drive: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """The document; `groups` are its entries, everything else is as in `SetProperties`."""
    optional = {
        "initial": numbers(stiffness=initial_stiffness, motor_inertia=initial_motor_inertia),
        "controller": numbers(kp=kp, kd=kd),
    }
    some = {key: [*names_of(names)] for key, names in (("rigid", rigid), ("no_torque", no_torque)) if names}
    return {
        "format": FORMAT,
        "robot": robot,
        **({} if tuple(gravity) == GRAVITY else numbers(gravity=gravity)),
        "joints": list(joints),
        "torque_hold": float(torque_hold),
        **({} if torque is None else {"torque": torque}),
        **({} if date is None else {"date": date}),
        **{name: lists for name, lists in optional.items() if lists},
        **({} if drive is None else {"drive": dict(drive)}),
        "model": {"effects": [*names_of(effects)], **some},
        "payloads": {name: {"bodies": [body_entry(b) for b in bodies]} for name, bodies in payloads.items()},
        "groups": list(groups),
    }


def numbers(**lists: Sequence[float] | Array | None) -> dict[str, list[float]]:
    """The lists that are given, as plain numbers."""
    return {key: [float(x) for x in value] for key, value in lists.items() if value is not None}


def body_entry(body: PayloadBody) -> dict[str, Any]:
    """A payload's body, as in the format."""
    return {"link": body.link, "mass": float(body.mass), **numbers(com=body.com, inertia=body.inertia)}
