"""What a robot description must hold: readable numbers, possible masses, a tree of bounded size.

URDF libraries drop an element with an unreadable number and go on; here each is an `InputError`.
"""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.base.schemas import first_repeated, shown

LARGEST_URDF = 32 * 2**20  # [bytes]
MAX_LINKS = 1000  # Pinocchio's parser and model are recursive
MAX_JOINTS = 128  # moving ones of a set; Pinocchio's work space grows with their cube (150 MB)
LARGEST_MASS = 1e6  # [kg]
LARGEST_LENGTH = 1e4  # [m]
WORLD = "world"
JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
AXIS_TYPES = ("revolute", "continuous", "prismatic", "planar")
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
SLACK = 1e-3  # of the largest moment: rounding in hand-written inertias
# element -> attribute -> (how many numbers, least, largest)
Range = tuple[int, float, float]
LENGTH: Range = (1, 0.0, LARGEST_LENGTH)
POSITION: Range = (3, -LARGEST_LENGTH, LARGEST_LENGTH)
ANY: Range = (1, -math.inf, math.inf)
FINITE: Range = (1, -LARGEST_LENGTH, LARGEST_LENGTH)
NUMBERS: dict[str, dict[str, Range]] = {
    "origin": {"xyz": POSITION, "rpy": POSITION},
    "axis": {"xyz": POSITION},
    "mass": {"value": (1, 0.0, LARGEST_MASS)},
    "inertia": dict.fromkeys(MOMENTS, (1, -1e12, 1e12)),
    "limit": {"lower": ANY, "upper": ANY, "effort": ANY, "velocity": ANY},
    "dynamics": {"damping": ANY, "friction": ANY},
    "mimic": {"multiplier": FINITE, "offset": FINITE},
    "box": {"size": (3, 0.0, LARGEST_LENGTH)},
    "cylinder": {"radius": LENGTH, "length": LENGTH},
    "sphere": {"radius": LENGTH},
    "mesh": {"scale": (3, -1e6, 1e6)},
    "color": {"rgba": (4, -math.inf, math.inf)},
}
NEEDED = {
    "mass": ("value",),
    "inertia": MOMENTS,
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "mesh": ("filename",),
}


def check_urdf(root: Element, file: Path) -> tuple[Fact, ...]:
    """InputError for the first element of a description that cannot be meant.

    An undeclared base link called "world" is added; a fact says so.
    """
    notes = _add_world(root)
    links, joints = root.findall("link"), root.findall("joint")
    if len(links) > MAX_LINKS:
        raise InputError(f"{len(links)} links, expected at most {MAX_LINKS}", file=file)
    for elements in (links, joints):
        for element in elements:
            if not element.get("name"):
                raise InputError(f"a <{element.tag}> has no name, expected one", file=file)
        if twice := first_repeated(element.get("name", "") for element in elements):
            raise InputError(f'two {elements[0].tag}s are called "{twice}"', file=file)
    for element in (*links, *joints):
        place = f'{element.tag} "{element.get("name")}"'
        for part in element.iter():
            _check_numbers(part, file, place)
    for link in links:
        for inertial in link.findall("inertial"):
            for name in ("mass", "inertia"):
                if inertial.find(name) is None:
                    message = f"<inertial> has no <{name}>, expected one"
                    raise InputError(message, file=file, place=f'link "{link.get("name")}"')
    names = {link.get("name") for link in links}
    parents = dict(_check_joint(joint, names, file) for joint in joints)
    if len(links) != len(joints) + 1 or len(parents) != len(joints) or _has_cycle(parents):
        message = (
            f"{len(links)} links and {len(joints)} joints form no tree: each but the first needs one joint"
        )
        raise InputError(message, file=file)
    return notes


def _add_world(root: Element) -> tuple[Fact, ...]:
    """Declare the base link that some exporters only name as a parent."""
    declared = {link.get("name") for link in root.findall("link")}
    parents = {end.get("link") for joint in root.findall("joint") for end in joint.findall("parent")}
    if WORLD in declared or WORLD not in parents:
        return ()
    root.insert(0, Element("link", {"name": WORLD}))
    return (Fact("world-added"),)


def _has_cycle(parents: dict[str, str]) -> bool:
    """Whether going from child to parent ever returns to a link."""
    safe: set[str] = set()
    for link in parents:
        way: set[str] = set()
        while link in parents and link not in safe:
            if link in way:
                return True
            way.add(link)
            link = parents[link]
        safe |= way
    return False


def _check_joint(joint: Element, links: set[str | None], file: Path) -> tuple[str, str]:
    """Its child and parent link."""
    place = f'joint "{joint.get("name")}"'
    kind = joint.get("type")
    if kind not in JOINT_TYPES:
        message = f"found {shown(kind)}, expected {', '.join(JOINT_TYPES)}"
        raise InputError(message, file=file, place=f"{place}, type")
    ends: list[str] = []
    for end in ("child", "parent"):
        element = joint.find(end)
        link = None if element is None else element.get("link")
        if link is None or link not in links:
            raise InputError(f"link {shown(link)} does not exist", file=file, place=f"{place}, {end}")
        ends.append(link)
    axis = joint.find("axis")
    if kind in AXIS_TYPES and axis is not None:
        direction = [float(number) for number in axis.get("xyz", "1 0 0").split()]
        if math.hypot(*direction) < 1e-9:
            message = f'found "{axis.get("xyz")}", expected a direction'
            raise InputError(message, file=file, place=f"{place}, axis xyz")
    return ends[0], ends[1]


def _check_numbers(element: Element, file: Path, place: str) -> None:
    """InputError unless the attributes of an element hold as many numbers as they should, in their range."""
    tag = element.tag
    for name in NEEDED.get(tag, ()):
        if element.get(name) is None:
            raise InputError(f"<{tag}> has no {name}, expected one", file=file, place=place)
    for name, (count, low, high) in NUMBERS.get(tag, {}).items():
        text = element.get(name)
        if text is None:
            continue
        what = "a number" if count == 1 else f"{count} numbers"
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != count or "_" in text or any(map(math.isnan, values)):
            raise InputError(
                f"found {shown(text)}, expected {what}", file=file, place=f"{place}, {tag} {name}"
            )
        if any(not low <= value <= high for value in values):
            message = f"found {shown(text)}, expected {what} from {low:g} to {high:g}"
            raise InputError(message, file=file, place=f"{place}, {tag} {name}")


def check_body(joint: str, mass: float, inertia: np.ndarray, file: Path) -> None:
    """InputError unless a body [kg] with this inertia (3, 3) about its centre of mass [kg m²] can exist."""
    moments = np.linalg.eigvalsh(inertia)
    if mass < 0.0 or moments[0] < -SLACK * max(moments[-1], 0.0) - 1e-12:
        found = ", ".join(f"{moment:.4g}" for moment in moments)
        message = f"no body has a mass of {mass:g} kg and the principal moments {found} kg m²"
        raise InputError(message, file=file, place=f'what moves with joint "{joint}"')
