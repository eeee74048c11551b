"""The robot's own URDF with the identified values, everything else unchanged.

A URDF has rigid joints only: the friction of motor and link is added up, motor inertia and stiffness are
comments. Inertial parameters that the data do not determine stay near CAD; comments list them.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import PurePosixPath
from typing import Any
from xml.dom import minidom

from flexviz.base.errors import InputError
from flexviz.base.units import joint_unit
from flexviz.content.wording import mounting_text
from flexviz.outlets.exporting.bodies import Carrier, carriers
from flexviz.outlets.exporting.identified import FormatFiles, IdentifiedRobot
from flexviz.outlets.exporting.servo_values import servo_joints
from flexviz.outlets.exporting.xml_text import comment_text, number_text
from flexviz.robot.model import INERTIAL_NAMES
from flexviz.robot.robot_files import resolve_mesh

TENSOR = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
GRADES = {"yes": "determined by the data", "weak": "weakly determined", "no": "prior (near CAD)"}


def urdf(identified: IdentifiedRobot) -> FormatFiles:
    """The URDF and its meshes.

    Meshes named by `package://` stay where they are; those with relative paths are copied.
    """
    identified.require_bodies()
    document: Any = minidom.parseString(identified.robot.urdf_path.read_bytes())
    root = document.documentElement
    missing = identified.left_out("urdf")
    if mounted := mounting_text(identified.robot.gravity):
        missing.append(f"{mounted}: set it in the program that loads the URDF")
    files = _meshes(identified, root, missing)
    links = {element.getAttribute("name"): element for element in _children(root, "link")}
    joints = {element.getAttribute("name"): element for element in _children(root, "joint")}
    for i, carrier in enumerate(carriers(identified.robot, identified.inertial)):
        _write_inertia(document, links[carrier.link], i, carrier, identified)
        for name in carrier.emptied:
            for element in list(_children(links[name], "inertial")):
                text = f" its inertia is included in {carrier.link}, to which it is fixed (flexviz) "
                links[name].replaceChild(document.createComment(text), element)
        _write_dynamics(document, joints[identified.joints[i]], i, identified)
    note = "Joint friction: motor and link together. Comments in links and joints give the other values."
    return _finished(identified, document, files, missing, note)


def servo_urdf(identified: IdentifiedRobot) -> FormatFiles:
    """The URDF of a robot whose joints follow goals: its masses are the URDF's own, only friction is new."""
    document: Any = minidom.parseString(identified.robot.urdf_path.read_bytes())
    root, missing = document.documentElement, identified.left_out("urdf")
    if identified.payload is not None:
        missing.append(f"payload {identified.payload}: the masses of a servo's robot are those of its URDF")
    files = _meshes(identified, root, missing)
    joints = {element.getAttribute("name"): element for element in _children(root, "joint")}
    for joint in servo_joints(identified):
        element = joints[joint.name]
        old = next(_children(element, "dynamics"), None)
        new = old.cloneNode(True) if old is not None else document.createElement("dynamics")
        new.setAttribute("damping", number_text(joint.get("motor_viscous_friction")))
        new.setAttribute("friction", number_text(joint.get("coulomb_friction.coulomb")))
        lines = [f"flexviz: no place in a URDF for motor_inertia {joint.get('motor_inertia')!r} kg m²,"]
        lines.append(f"gain {joint.get('gain')!r} Nm/rad")
        comment = document.createComment(comment_text(lines, _indent(element)))
        _put(document, element, old, [comment, new])
    return _finished(identified, document, files, missing, "Joint friction: viscous and dry.")


def _finished(
    identified: IdentifiedRobot, document: Any, files: dict[str, bytes], missing: list[str], note: str
) -> FormatFiles:
    about = [*identified.heading, *(f"NOT CONTAINED: {text}" for text in missing), note]
    root = document.documentElement
    document.insertBefore(document.createComment(comment_text(about)), root)
    text = document.toxml(encoding="utf-8").replace(b"?><", b"?>\n<", 1).replace(b"--><", b"-->\n<")
    return FormatFiles({f"{identified.name}.urdf": text + b"\n", **files}, missing)


def _write_inertia(document: Any, link: Any, i: int, carrier: Carrier, identified: IdentifiedRobot) -> None:
    """Replace a link's inertia by the identified inertia of joint i."""
    joint = identified.joints[i]
    lines = [f"flexviz: inertia of all that {joint} moves"]
    for grade, meaning in GRADES.items():
        if names := [name for name in INERTIAL_NAMES if identified.grade(name, joint) == grade]:
            lines.append(f"{meaning}: {', '.join(names)}")
    if carrier.others:
        verb = "are included here" if carrier.emptied else "keep their inertia"
        lines.append(f"links fixed to it {verb}: {', '.join(carrier.emptied or carrier.others)}")
    if any(identified.robot.joint_of_link(body.link) == i for body in identified.bodies):
        lines.append(f"the payload {identified.payload} is included")
    old = next(_children(link, "inertial"), None)
    origin = next(_children(old, "origin"), None) if old is not None else None
    rpy, indent = origin.getAttribute("rpy") if origin is not None else "", _indent(link)
    parts = {
        "origin": {"xyz": number_text(carrier.inertia.lever), "rpy": rpy or "0 0 0"},
        "mass": {"value": number_text(carrier.inertia.mass)},
        "inertia": {name: number_text(carrier.tensor[at]) for name, at in TENSOR.items()},
    }
    inertial = document.createElement("inertial")
    for name, attributes in parts.items():
        inertial.appendChild(document.createTextNode(f"\n{indent}  "))
        element = inertial.appendChild(document.createElement(name))
        for key, value in attributes.items():
            element.setAttribute(key, value)
    inertial.appendChild(document.createTextNode(f"\n{indent}"))
    _put(document, link, old, [document.createComment(comment_text(lines, indent)), inertial])


def _write_dynamics(document: Any, joint: Any, i: int, identified: IdentifiedRobot) -> None:
    """Replace joint i's damping and friction; a comment gives the rest."""
    laws = identified.laws
    old = next(_children(joint, "dynamics"), None)
    element = old.cloneNode(True) if old is not None else document.createElement("dynamics")
    element.setAttribute("damping", number_text(laws["motor_viscous"][i] + laws["link_viscous"][i]))
    element.setAttribute("friction", number_text(laws.sliding_friction(i) + laws["link_coulomb"][i]))

    def graded(parameter: str, unit: str) -> str:
        value = float(laws[parameter.removesuffix("_friction")][i])
        unit = joint_unit(unit, bool(identified.robot.prismatic[i]))
        return f"{parameter} {value!r} {unit} ({GRADES[identified.grade(parameter, identified.joints[i])]})"

    stiffness = graded("stiffness", "Nm/rad")
    if identified.has_motors:
        lines = [
            f"flexviz: no place in a URDF for {graded('motor_inertia', 'kg m²')}",
            f"(reflected to the joint, add it to the diagonal of the mass matrix) and {stiffness}",
            f"damping is the sum of {graded('motor_viscous_friction', 'Nm s/rad')}",
            f"and {graded('link_viscous_friction', 'Nm s/rad')}",
        ]
    else:
        lines = [f"flexviz: no place in a URDF for {stiffness}"]
    comment = document.createComment(comment_text(lines, _indent(joint)))
    _put(document, joint, old, [comment, element])


def _put(document: Any, parent: Any, old: Any | None, new: list[Any]) -> None:
    """Replace `old`, or append to `parent`, with each new node on its own line."""
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


def _meshes(identified: IdentifiedRobot, root: Any, missing: list[str]) -> dict[str, bytes]:
    """Copies of the meshes with relative paths, which then name the copies."""
    files: dict[str, bytes] = {}
    for element in root.getElementsByTagName("mesh"):
        name = element.getAttribute("filename")
        if "://" in name or not name:
            continue
        try:
            path = resolve_mesh(name, identified.robot.urdf_path)
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
