"""Which joints of a robot description move: mimic joints, free bases and joints without a load."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from flexviz.base.facts import Fact
from flexviz.robot._pinocchio import pin

NO_LOAD = 1e-12  # of the largest diagonal entry of the mass matrix: rounding


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: position = multiplier · leader + offset."""

    leader: str  # a joint that follows none
    multiplier: float  # [rad/rad], [m/rad] …
    offset: float  # [rad] or [m]

    def __str__(self) -> str:
        return f"{self.multiplier:g} × {self.leader}" + (f" + {self.offset:g}" if self.offset else "")


def mimics_of(root: Element) -> dict[str, Mimic]:
    """Joint -> what it follows, through chains of followers.

    A leader that does not exist, or a circle of followers, cannot move: what follows it stays at its offset.
    """
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    stated = {name: tag for name, joint in joints.items() if (tag := joint.find("mimic")) is not None}

    def followed(name: str, way: tuple[str, ...]) -> Mimic:
        tag = stated[name]
        leader = tag.get("joint", "")
        multiplier, offset = float(tag.get("multiplier", "1")), float(tag.get("offset", "0"))
        if leader not in stated or leader in (name, *way):
            return Mimic(leader, multiplier, offset)
        above = followed(leader, (name, *way))
        return Mimic(above.leader, multiplier * above.multiplier, multiplier * above.offset + offset)

    return {name: followed(name, ()) for name in stated}


def unloaded(model: Any, joints: Sequence[str]) -> list[str]:
    """The joints that move no inertia about their axis; [] where none moves any (a URDF without masses)."""
    q = pin.neutral(model)
    places = {name: model.joints[model.getJointId(name)] for name in joints}
    pose = np.random.default_rng(0).uniform(-1.0, 1.0, len(places))  # none in which axes coincide
    for joint, value in zip(places.values(), pose, strict=True):
        q[joint.idx_q] = value
    mass = np.diag(pin.crba(model, model.createData(), q))
    empty = [name for name, joint in places.items() if mass[joint.idx_v] <= NO_LOAD * mass.max()]
    return empty if len(empty) < len(places) else []


def locking_facts(
    root: Element, joints: Sequence[str], mimics: Mapping[str, Mimic], empty: Sequence[str], chosen: bool
) -> Iterator[Fact]:
    """What is held fixed without having been asked for.

    `joints` move, `empty` are those without a load; `chosen`: the user named the joints.
    """
    names = {joint.get("name", "") for joint in root.findall("joint")} - {*mimics}
    locked_mimics = {name: mimic for name, mimic in mimics.items() if name not in joints}
    groups = {
        "locked": [j for j, m in locked_mimics.items() if m.leader in (joints if chosen else names)],
        "lost": [j for j, m in locked_mimics.items() if m.leader not in names],
        "own": [j for j in joints if j in mimics],
    }
    for how, some in groups.items():
        if some:
            follows = tuple(str(mimics[j]) for j in some)
            yield Fact("mimic-joints", joints=tuple(some), values={"how": how, "follows": follows})
    if empty:
        yield Fact("joints-without-load", "odd", tuple(empty))
    for joint in root.findall("joint"):
        if (kind := joint.get("type", "")) in ("floating", "planar"):
            yield Fact("joint-held", joints=(joint.get("name", ""),), values={"type": kind})
    locked = [j for j in root.findall("joint") if j.get("name") not in joints and j.get("type") != "fixed"]
    unused = [j.get("name", "") for j in locked if _has_friction(j)]
    if unused and not chosen:
        yield Fact("dynamics-unused", joints=tuple(unused))


def _has_friction(joint: Element) -> bool:
    dynamics = joint.find("dynamics")
    return dynamics is not None and any(float(dynamics.get(x, "0")) for x in ("damping", "friction"))
