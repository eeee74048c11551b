"""Whether a robot description is in m, kg and kg m²: CAD exports write mm, g or g mm² into a URDF.

Three numbers of robots of any size lie within narrow bounds: the longest link l [m], the mass of what moves
over its cube m/l³ [kg/m³], and the radius of gyration of a link over its length √(I₃/m)/l. Where one of them
is out of bounds as the description stands, and other units bring all three into them, it is in these units.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from flexviz.base.errors import InputError
from flexviz.robot.urdf_inertias import attribute, extents_of, moments_of, norm


@dataclass(frozen=True)
class Bound:
    """Where a number of real robots lies.

    Attributes:
        low, high: what no robot exceeds.
        typical, decades: mean and standard deviation of the decimal logarithm over the robots of
            example-robot-data, the former as a number.
    """

    low: float
    high: float
    typical: float
    decades: float

    def has(self, value: float) -> bool:
        """Whether a number is possible."""
        return self.low <= value <= self.high

    def distance(self, value: float) -> float:
        """How far a number is from the typical one, in standard deviations squared; 0 for one that is 0."""
        return (math.log10(value / self.typical) / self.decades) ** 2 if value > 0.0 else 0.0


LENGTH = Bound(0.02, 10.0, 0.44, 0.25)  # [m] of the longest link
DENSITY = Bound(0.005, 7850.0, 100.0, 0.75)  # [kg/m³] over its cube; at most that of steel
GYRATION = Bound(0.0, 4.0, 0.18, 0.25)  # [-] over its length; that of point masses is 0
LENGTHS = {"m": 1.0, "cm": 1e2, "mm": 1e3}  # [1/m] how many are 1 m
MASSES = {"kg": 1.0, "g": 1e3, "t": 1e-3}  # [1/kg] how many are 1 kg


@dataclass(frozen=True)
class Size:
    """Numbers of a robot as they stand in its description.

    Attributes:
        longest: length of the longest link.
        reach: of the longest chain of links.
        mass: of all that moves.
        gyration: √(I₃/m) of a link, the median by mass.
    """

    longest: float
    reach: float
    mass: float
    gyration: float


@dataclass(frozen=True)
class Units:
    """Units that a description may be in; `inertia`: of mass and of length, "kg", "m" for kg m²."""

    length: str = "m"
    mass: str = "kg"
    inertia: tuple[str, str] = ("kg", "m")

    @property
    def scales(self) -> tuple[float, float, float]:
        """How many of the units are 1 m, 1 kg, 1 kg m²."""
        mass, length = self.inertia
        return LENGTHS[self.length], MASSES[self.mass], MASSES[mass] * LENGTHS[length] ** 2

    @property
    def names(self) -> tuple[str, str, str]:
        """Of the lengths, masses and inertias."""
        mass, length = self.inertia
        return self.length, self.mass, f"{mass} {length}²"

    def judged(self, size: Size) -> tuple[tuple[Bound, float], ...]:
        """What a robot of this size would be in these units: bounds and numbers."""
        length, mass, inertia = self.scales
        longest = size.longest / length
        gyration = size.gyration * math.sqrt(mass / inertia)  # [m]
        return (
            (LENGTH, longest),
            (DENSITY, size.mass / mass / longest**3),
            (GYRATION, gyration / longest),
        )

    def possible(self, size: Size) -> bool:
        """Whether a robot of this size can be meant."""
        return all(bound.has(value) for bound, value in self.judged(size))

    def distance(self, size: Size) -> float:
        """How untypical a robot of this size would be."""
        return sum(bound.distance(value) for bound, value in self.judged(size))


SI = Units()
CHOICES = (  # inertias in the units of masses and lengths, or in SI; or they alone in other units
    *(
        Units(length, mass, own)
        for length, mass in product(LENGTHS, ("kg", "g"))
        for own in ((mass, length), SI.inertia)
    ),
    Units("mm", "t", ("t", "mm")),  # with N and s the consistent system of many CAD programs
    *(Units(inertia=own) for own in (("kg", "cm"), ("kg", "mm"), ("g", "mm"))),
)


def check_units(root: Element, moving: Collection[str], file: Path) -> None:
    """InputError for a description in other units than m, kg and kg m²; `moving`: links that move."""
    size = size_of(root, moving)
    units = None if size is None else likely_units(size)
    if size is None or units is None:
        return
    length, mass, _ = units.scales
    found = f"a robot that reaches {_number(size.reach)} m, of {_number(size.mass)} kg"
    if not GYRATION.has(size.gyration / size.longest):
        found += f", with radii of gyration of {_number(size.gyration)} m"
    whats = zip(("lengths", "masses", "inertias"), units.names, SI.names, strict=True)
    guess = ", ".join(f"{what} in {unit}" for what, unit, own in whats if unit != own)
    then = f"{_number(size.reach / length)} m and {_number(size.mass / mass)} kg are plausible"
    raise InputError(f"the description is of {found}: {guess}? {then}. {_remedy(units)}", file=file)


def likely_units(size: Size) -> Units | None:
    """The units that make the most typical robot of an impossible one; None: SI, or none."""
    if SI.possible(size):
        return None
    possible = [units for units in CHOICES if units.possible(size)]
    return min(possible, key=lambda units: units.distance(size), default=None)


def size_of(root: Element, moving: Collection[str]) -> Size | None:
    """The size of a robot; None where nothing heavy moves, or all is in one place."""
    bodies = []
    for link in root.findall("link"):
        inertial = link.find("inertial")
        mass = 0.0 if inertial is None else float(attribute(inertial, "mass", "value", "0"))
        if inertial is not None and link.get("name") in moving and mass > 0.0:
            bodies.append((math.sqrt(max(moments_of(inertial)[-1], 0.0) / mass), mass))
    longest = extents_of(root).longest
    if not bodies or longest == 0.0:
        return None
    radii, masses = np.array(sorted(bodies)).T
    middle = int(np.searchsorted(np.cumsum(masses), 0.5 * masses.sum()))
    return Size(longest, _reach(root), float(masses.sum()), float(radii[middle]))


def _reach(root: Element) -> float:
    """Length of the longest chain: origins of its joints, then the last centre of mass."""
    parents = {_end(joint, "child"): joint for joint in root.findall("joint")}

    def length(link: Element) -> float:
        inertial = link.find("inertial")
        total = 0.0 if inertial is None else norm(attribute(inertial, "origin", "xyz", "0 0 0"))
        joint = parents.get(link.get("name", ""))
        while joint is not None:
            total += norm(attribute(joint, "origin", "xyz", "0 0 0"))
            joint = parents.get(_end(joint, "parent"))
        return total

    return max(map(length, root.findall("link")), default=0.0)


def _end(joint: Element, tag: str) -> str:
    return attribute(joint, tag, "link", "")


def _remedy(units: Units) -> str:
    """What to divide, in words."""
    whats = ("length (xyz of each origin, sizes, travel of sliding joints)", "mass", "inertia")
    by_scale: dict[float, list[str]] = {}
    for what, scale in zip(whats, units.scales, strict=True):
        by_scale.setdefault(scale, []).append(f"every {what}")
    kept = by_scale.pop(1.0, [])
    parts = [
        f"{'divide' if scale > 1.0 else 'multiply'} {_listed(some)} by {max(scale, 1.0 / scale):,.0f}"
        for scale, some in by_scale.items()
    ]
    text = _listed(parts)
    stay = f"; leave {_listed(kept)}" if kept else ""
    return text[0].upper() + text[1:] + stay.replace(whats[0], "length")


def _listed(parts: Iterable[str]) -> str:
    *first, last = parts
    return f"{', '.join(first)} and {last}" if first else last


def _number(value: float) -> str:
    """Three digits, without an exponent."""
    return f"{value:,.0f}" if value >= 100.0 else f"{value:.3g}"
