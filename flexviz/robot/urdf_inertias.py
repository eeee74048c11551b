"""Whether the inertia of each moving link can be that of a body: triangle inequality and radius of gyration.

The principal moments of a body satisfy I₃ ≤ I₁ + I₂, and √(I₃/m) is at most its extent. CAD exports break the
first by rounding; a lost decimal point, another unit or a wrong sign break them by far more.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.robot.urdf_checks import MOMENTS, SLACK

TOLERATED = 0.05  # excess of the largest principal moment over the other two that is reported, not refused
NEGLIGIBLE = 1e-6  # of the inertia about the joint's origin that a link is part of


WIDE = 2.0  # times the longest link, whose extent beyond the joints is not known: a wide radius of gyration


@dataclass(frozen=True)
class Extents:
    """Lengths from the joints' places, centres of mass and simple shapes; meshes are not read."""

    longest: float  # [m] of one link
    whole: float  # [m] of all of them in line; 0 where all joints are in one place


def inertia_facts(root: Element, carried: Mapping[str, Any], file: Path) -> list[Fact]:
    """Implausible inertias of links; InputError for the first impossible one.

    `carried`: moving link -> `pin.Inertia` of all that moves with its joint, about the joint's origin.
    What is negligible in that is not looked at.
    """
    extents, found, wide = extents_of(root), list[Fact](), list[dict[str, Any]]()
    for link in root.findall("link"):
        name, inertial = link.get("name", ""), link.find("inertial")
        if inertial is None or name not in carried:
            continue
        mass = float(attribute(inertial, "mass", "value", "0"))
        stated = {key: float(attribute(inertial, "inertia", key, "0")) for key in MOMENTS}
        first, second, third = moments_of(inertial)
        body = carried[name]
        about_joint = np.linalg.eigvalsh(body.inertia)[-1] + body.mass * float(body.lever @ body.lever)
        least = max(SLACK * np.linalg.eigvalsh(body.inertia)[-1], NEGLIGIBLE * about_joint)
        place = f'link "{name}"'
        if third - first - second > least:
            excess = third / max(first + second, 1e-300) - 1.0
            if excess > TOLERATED:
                by = f"exceeds the sum of the others by {100 * excess:.2g} %"
                by = by if excess < 1.0 else f"is {min(excess + 1.0, 1e9):.3g} times the sum of the others"
                raise InputError(
                    f"the largest of the principal moments {first:.4g}, {second:.4g}, {third:.4g} kg m² "
                    f"{by}; look at {suspect(stated)}; no body has such an inertia, expected at most the sum",
                    file=file,
                    place=place,
                )
            if excess > SLACK:
                values = {
                    "link": name,
                    "moments": (float(first), float(second), float(third)),
                    "excess": float(excess),
                }
                found.append(Fact("inertia-excess", "odd", values=values | {"suspect": suspect(stated)}))
        radius = math.sqrt(max(third, 0.0) / mass) if mass > 0.0 else 0.0
        if third > least and extents.whole > 0.0 and radius > WIDE * extents.longest:
            if radius > extents.whole:
                raise InputError(
                    f"{third:.4g} kg m² and {mass:g} kg give a radius of gyration of {radius:.3g} m, more "
                    f"than the whole robot's {extents.whole:.3g} m; look at its unit and mass",
                    file=file,
                    place=place,
                )
            wide.append({"link": name, "moment": float(third), "mass": mass, "radius": float(radius)})
    if wide:
        values = wide[0] | {"longest": extents.longest, "more": len(wide) - 1}
        found.append(Fact("inertia-wide", "odd", values=values))
    return found


def suspect(stated: Mapping[str, float]) -> str:
    """The entry of an inertia to look at: a diagonal one above the sum of the others, else a product."""
    diagonal = {key: stated[key] for key in MOMENTS[:3]}
    largest = max(diagonal, key=lambda key: diagonal[key])
    if 2.0 * diagonal[largest] <= sum(diagonal.values()):
        largest = max(MOMENTS[3:], key=lambda key: abs(stated[key]))
    return f"{largest} = {stated[largest]:g}"


def extents_of(root: Element) -> Extents:
    """The lengths of a robot."""
    joints = [joint for joint in root.findall("joint") if joint.get("type") != "floating"]
    offsets = [norm(attribute(joint, "origin", "xyz", "0 0 0")) for joint in joints]
    ranges = [_travel(joint) for joint in joints if joint.get("type") == "prismatic"]
    sizes = []
    for link in root.findall("link"):
        inertial = link.find("inertial")
        sizes.append(0.0 if inertial is None else 2.0 * norm(attribute(inertial, "origin", "xyz", "0 0 0")))
        sizes += [norm(box.get("size", "0")) for box in link.iter("box")]
        sizes += [2.0 * float(ball.get("radius", "0")) for ball in link.iter("sphere")]
        sizes += [
            math.hypot(2.0 * float(rod.get("radius", "0")), float(rod.get("length", "0")))
            for rod in link.iter("cylinder")
        ]
    longest = max([*offsets, *sizes], default=0.0)
    whole = sum(offsets) + sum(ranges) + 2.0 * max(sizes, default=0.0)
    return Extents(longest, whole if any(offsets) else 0.0)


def _travel(joint: Element) -> float:
    low, high = (float(attribute(joint, "limit", key, "0")) for key in ("lower", "upper"))
    return high - low if 0.0 < high - low < 1e3 else 0.0


def moments_of(inertial: Element) -> np.ndarray:
    """(3,) principal moments of a link's inertia, rising [kg m²]."""
    xx, yy, zz, xy, xz, yz = (float(attribute(inertial, "inertia", key, "0")) for key in MOMENTS)
    return np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def norm(text: str) -> float:
    """Length of a vector that is written as three numbers."""
    return math.hypot(*map(float, text.split()))


def attribute(parent: Element, tag: str, name: str, default: str) -> str:
    """An attribute of a child element, or `default`."""
    element = parent.find(tag)
    return default if element is None else element.get(name, default)
