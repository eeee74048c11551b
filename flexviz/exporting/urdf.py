"""The robot's own URDF with what was identified in it, and everything else as it was.

A URDF knows rigid joints: motor and link friction act on one joint and add up; motor inertia and stiffness
have no place and stand in comments. Inertias that the data do not determine are near the CAD values; a
comment says which.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import PurePosixPath
from typing import Any
from xml.dom import minidom

from flexviz.equation import INERTIAL_NAMES
from flexviz.errors import InputError
from flexviz.exporting.bodies import Carrier, carriers
from flexviz.exporting.subject import Subject, left_out
from flexviz.exporting.xml_text import comment_text, number_text
from flexviz.robot_files import resolve_mesh

GRADES = {"yes": "determined by the data", "weak": "weakly determined", "no": "prior (near CAD)"}


def urdf(subject: Subject) -> tuple[dict[str, bytes], list[str]]:
    """The URDF and its meshes by file name, and what it does not hold.

    Meshes that are named by `package://` stay where they are; those of relative paths come along.
    """
    subject.require_bodies()
    document: Any = minidom.parseString(subject.robot.urdf_path.read_bytes())
    root = document.documentElement
    missing = left_out(subject, "urdf")
    files = _meshes(subject, root, missing)
    links = {element.getAttribute("name"): element for element in _children(root, "link")}
    joints = {element.getAttribute("name"): element for element in _children(root, "joint")}
    for joint, carrier in zip(subject.joints, carriers(subject.robot, subject.inertial), strict=True):
        _write_inertia(document, links[carrier.link], joint, carrier, subject)
        for name in carrier.emptied:
            for element in list(_children(links[name], "inertial")):
                text = f" its inertia is that of {carrier.link}, which it moves with (flexviz) "
                links[name].replaceChild(document.createComment(text), element)
        _write_dynamics(document, joints[joint], joint, subject)
    about = [*subject.heading, *(f"NOT CONTAINED: {text}" for text in missing)]
    about += [
        "Joint friction: motor and link together. Comments in links and joints say what else was found."
    ]
    document.insertBefore(document.createComment(comment_text(about)), root)
    text = document.toxml(encoding="utf-8").replace(b"?><", b"?>\n<", 1).replace(b"--><", b"-->\n<")
    return {f"{subject.name}.urdf": text + b"\n", **files}, missing


def _write_inertia(document: Any, link: Any, joint: str, carrier: Carrier, subject: Subject) -> None:
    found = carrier.inertia
    grades = subject.graded(INERTIAL_NAMES, joint)
    lines = [f"flexviz: of what {joint} moves"] + [
        f"{GRADES[grade]}: {', '.join(names)}" for grade, names in grades.items() if names
    ]
    if carrier.others:
        verb = "are counted here" if carrier.emptied else "keep their own inertia"
        lines.append(f"links that move with it {verb}: {', '.join(carrier.emptied or carrier.others)}")
    if any(subject.robot.joint_of_link(body.link) == _index(subject, joint) for body in subject.bodies):
        lines.append(f"the payload {subject.payload} is contained")
    old = next(_children(link, "inertial"), None)
    origin = next(_children(old, "origin"), None) if old is not None else None
    i, indent = found.inertia, _indent(link)
    parts = {
        "origin": {
            "xyz": number_text(found.com),
            "rpy": (origin.getAttribute("rpy") if origin is not None else "") or "0 0 0",
        },
        "mass": {"value": number_text(found.mass)},
        "inertia": {
            name: number_text(i[r, c])
            for name, r, c in (
                ("ixx", 0, 0), ("ixy", 0, 1), ("ixz", 0, 2), ("iyy", 1, 1), ("iyz", 1, 2), ("izz", 2, 2),
            )
        },
    }  # fmt: skip
    inertial = document.createElement("inertial")
    for name, attributes in parts.items():
        element = document.createElement(name)
        for key, value in attributes.items():
            element.setAttribute(key, value)
        inertial.appendChild(document.createTextNode(f"\n{indent}  "))
        inertial.appendChild(element)
    inertial.appendChild(document.createTextNode(f"\n{indent}"))
    _put(document, link, old, [document.createComment(comment_text(lines, indent)), inertial])


def _write_dynamics(document: Any, joint: Any, name: str, subject: Subject) -> None:
    i, laws = _index(subject, name), subject.laws
    damping = float(laws["motor_viscous"][i] + laws["link_viscous"][i])
    friction = laws.sliding_friction(i) + float(laws["link_coulomb"][i])
    old = next(_children(joint, "dynamics"), None)
    element = old.cloneNode(True) if old is not None else document.createElement("dynamics")
    element.setAttribute("damping", number_text(damping))
    element.setAttribute("friction", number_text(friction))

    def graded(parameter: str, unit: str) -> str:
        value = float(laws[parameter.removesuffix("_friction")][i])
        return f"{parameter} {value!r} {unit} ({GRADES[subject.grade(parameter, name)]})"

    lines = [
        "flexviz: no place in a URDF for " + graded("motor_inertia", "kg m²"),
        "(reflected to the joint, add it to the diagonal of the mass matrix) and "
        + graded("stiffness", "Nm/rad"),
        "damping is the sum of " + graded("motor_viscous_friction", "Nm s/rad"),
        "and " + graded("link_viscous_friction", "Nm s/rad"),
    ]
    comment = document.createComment(comment_text(lines, _indent(joint)))
    _put(document, joint, old, [comment, element])


def _put(document: Any, parent: Any, old: Any | None, new: list[Any]) -> None:
    """Put elements where `old` stands, or at the end of `parent`, each on a line of its own."""
    end = parent.lastChild
    before = old if old is not None else end if end is not None and end.nodeName == "#text" else None
    for k, node in enumerate(new):
        if old is None or k:
            parent.insertBefore(document.createTextNode(f"\n{_indent(parent)}"), before)
        parent.insertBefore(node, before)
    if old is not None:
        parent.removeChild(old)


def _indent(parent: Any) -> str:
    """The spaces before an element's children."""
    first = parent.firstChild
    text = first.data if first is not None and first.nodeName == "#text" else ""
    return text.rpartition("\n")[2] if "\n" in text and not text.strip() else "    "


def _meshes(subject: Subject, root: Any, missing: list[str]) -> dict[str, bytes]:
    """Files that relative mesh names stand for; the names become those of the copies."""
    files: dict[str, bytes] = {}
    for element in root.getElementsByTagName("mesh"):
        name = element.getAttribute("filename")
        if "://" in name or not name:
            continue
        try:
            path = resolve_mesh(name, subject.robot.urdf_path)
        except InputError as error:
            missing.append(f"mesh {name}: {error.message}")
            continue
        place, content = PurePosixPath(name), path.read_bytes()
        stays = not place.is_absolute() and ".." not in place.parts
        inside = place if stays else PurePosixPath("meshes", place.name)
        while files.get(inside.as_posix(), content) != content:  # another mesh of this name
            inside = inside.with_stem(inside.stem + "_")
        files[inside.as_posix()] = content
        element.setAttribute("filename", inside.as_posix())
        material = path.with_suffix(".mtl")
        if path.suffix.lower() == ".obj" and material.is_file():
            files[inside.with_suffix(".mtl").as_posix()] = material.read_bytes()
    return files


def _children(element: Any, tag: str) -> Iterator[Any]:
    return (child for child in element.childNodes if child.nodeName == tag)


def _index(subject: Subject, joint: str) -> int:
    return subject.joints.index(joint)
