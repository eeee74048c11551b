"""Arms as plain numbers: a randomised planar 2R, and the links of a URDF; both written out as URDF."""

from __future__ import annotations

import sysconfig
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
Vector = tuple[float, float, float]

URDFS = {
    "panda": ("panda_description/urdf/panda.urdf", "panda_joint1"),
    "ur5": ("ur_description/urdf/ur5_robot.urdf", "shoulder_pan_joint"),
}


@dataclass(frozen=True)
class Body:
    """A rigid body in the frame of the link that carries it.

    Attributes:
        mass: [kg].
        com: its centre of mass [m].
        inertia: Ixx Iyy Izz Ixy Ixz Iyz about the centre of mass, along the link's axes [kg m²].
    """

    mass: float
    com: Vector
    inertia: tuple[float, float, float, float, float, float]

    def scaled(self, factor: float) -> Body:
        """Mass and inertia `factor` times as large."""
        i = [factor * x for x in self.inertia]
        return Body(factor * self.mass, self.com, (i[0], i[1], i[2], i[3], i[4], i[5]))


@dataclass(frozen=True)
class Link:
    """A link and the hinge that carries it on the link before.

    Attributes:
        name, joint: of the link and of its hinge.
        xyz, rpy: where the hinge stands in the frame of the link before [m, rad].
        axis: of the hinge.
        body: the link's own mass.
    """

    name: str
    joint: str
    xyz: Vector
    rpy: Vector
    axis: Vector
    body: Body


@dataclass(frozen=True)
class Arm:
    """A chain of links on a fixed base."""

    name: str
    links: tuple[Link, ...]

    @property
    def joints(self) -> tuple[str, ...]:
        return tuple(link.joint for link in self.links)


def planar_arm(rng: np.random.Generator) -> Arm:
    """Two links that swing in the vertical x–z plane, positive upwards."""

    def link(k: int, mass: float, com: float, gyration: float) -> Link:
        m = mass * rng.uniform(0.8, 1.2)
        c = (com * rng.uniform(0.8, 1.2), 0.0, rng.uniform(0.008, 0.02))
        i = m * (gyration * rng.uniform(0.9, 1.1)) ** 2
        body = Body(m, c, (0.7 * i, i, 0.7 * i, 0.0, 0.0, 0.0))
        place = (0.5 if k > 1 else 0.0, 0.0, 0.0)
        return Link(f"link{k}", f"joint{k}", place, (0.0, 0.0, 0.0), (0.0, -1.0, 0.0), body)

    return Arm("planar_2r", (link(1, 6.5, 0.21, 0.28), link(2, 4.0, 0.19, 0.25)))


def urdf_arm(name: str) -> Arm:
    """The moving links of a robot of example-robot-data, from its XML."""
    file, first = URDFS[name]
    robots = Path(sysconfig.get_paths()["purelib"], "cmeel.prefix/share/example-robot-data/robots")
    root = ElementTree.parse(robots / file).getroot()
    bodies = {e.get("name", ""): _body(e) for e in root.findall("link")}
    hinges = {
        _child(e, "parent", "link"): e
        for e in root.findall("joint")
        if e.get("type") in {"revolute", "continuous"}
    }
    joint = next(e for e in root.findall("joint") if e.get("name") == first)
    links = []
    while joint is not None:
        child = _child(joint, "child", "link")
        links.append(
            Link(
                child,
                joint.get("name", ""),
                _numbers(joint.find("origin"), "xyz"),
                _numbers(joint.find("origin"), "rpy"),
                _numbers(joint.find("axis"), "xyz"),
                bodies[child],
            )
        )
        joint = hinges.get(child)
    return Arm(name, tuple(links))


def varied(arm: Arm, rng: np.random.Generator, share: float) -> Arm:
    """The arm with masses, centres and inertias each up to `share` off, as a wrong drawing has them."""

    def factor() -> float:
        return float(rng.uniform(1 - share, 1 + share))

    def vary(link: Link) -> Link:
        b = link.body
        com = (b.com[0] * factor(), b.com[1] * factor(), b.com[2] * factor())
        mass, size = factor(), factor()
        i = [size * x for x in b.inertia]
        return replace(link, body=Body(mass * b.mass, com, (i[0], i[1], i[2], i[3], i[4], i[5])))

    return replace(arm, links=tuple(map(vary, arm.links)))


def urdf_text(arm: Arm) -> str:
    """The arm as URDF."""
    lines = [f'<robot name="{arm.name}">', '  <link name="base"/>']
    before = "base"
    for link in arm.links:
        b = link.body
        moments = zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), b.inertia, strict=True)
        lines += [
            f'  <link name="{link.name}"><inertial><origin xyz="{text(b.com)}"/><mass value="{b.mass:.9g}"/>',
            "    <inertia " + " ".join(f'{k}="{v:.9g}"' for k, v in moments) + "/></inertial></link>",
            f'  <joint name="{link.joint}" type="revolute">',
            f'    <parent link="{before}"/><child link="{link.name}"/>',
            f'    <origin xyz="{text(link.xyz)}" rpy="{text(link.rpy)}"/><axis xyz="{text(link.axis)}"/>',
            '    <limit lower="-3.14" upper="3.14" effort="1000" velocity="10"/></joint>',
        ]
        before = link.name
    return "\n".join([*lines, "</robot>", ""])


def text(values: tuple[float, ...] | Array) -> str:
    """Numbers for an XML attribute."""
    return " ".join(f"{float(x):.12g}" for x in values)


def _body(link: ElementTree.Element) -> Body:
    inertial = link.find("inertial")
    if inertial is None:
        return Body(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    tensor, mass = inertial.find("inertia"), inertial.find("mass")
    assert tensor is not None and mass is not None
    assert not any(_numbers(inertial.find("origin"), "rpy")), "inertia along other axes than the link's"
    i = [float(tensor.get(k, 0)) for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")]
    com = _numbers(inertial.find("origin"), "xyz")
    return Body(float(mass.get("value", 0)), com, (i[0], i[1], i[2], i[3], i[4], i[5]))


def _child(element: ElementTree.Element, tag: str, key: str) -> str:
    found = element.find(tag)
    return "" if found is None else found.get(key, "")


def _numbers(element: ElementTree.Element | None, key: str) -> Vector:
    x = [float(v) for v in ("0 0 0" if element is None else element.get(key, "0 0 0")).split()]
    return x[0], x[1], x[2]
