"""Find robot descriptions, their meshes, and ready-made settings of robots.

A robot is given as the path of a URDF, as `example-robot-data:<name>` (the collection installed beside
Pinocchio) or as `robots:<name>` (shipped with flexviz). Meshes are named by plain paths or `package://` ones.
Settings are one TOML file per robot in `robots/`; lists have one value per joint, in the order of `joints`.
"""

from __future__ import annotations

import os
import re
import sysconfig
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from flexviz.base import toml
from flexviz.base.errors import InputError, choose_from
from flexviz.base.facts import Fact
from flexviz.base.resources import robots_dir
from flexviz.robot.urdf_checks import LARGEST_URDF, check_urdf
from flexviz.robot.urdf_joints import Mimic, mimics_of

EXAMPLE_ROBOT_DATA = "example-robot-data"
SHIPPED = "robots"
SETTINGS: tuple[str, ...] = ("planar_2r", "panda", "ur5")
MESH_SUFFIXES = {".stl", ".dae", ".obj", ".ply", ".off", ".glb", ".gltf", ".3mf"}
DESCRIPTION_SUFFIXES = (".urdf", ".xacro", ".sdf", ".mjcf")  # all but the first are refused with advice
XACRO = "this is xacro, which has to be expanded first: xacro {name} > robot.urdf"
_SUFFIXES = ("_robot", "_description")


def share_dir() -> Path:
    """The folder `package://` paths of example-robot-data are relative to."""
    paths = sysconfig.get_paths()
    folders = [Path(paths[key]) / "cmeel.prefix" / "share" for key in ("purelib", "platlib")]
    return next((folder for folder in folders if folder.is_dir()), folders[0])


@lru_cache(maxsize=1)
def example_robots() -> dict[str, Path]:
    """Short name -> URDF of every robot in the installed example-robot-data.

    A URDF is named by its file's stem without a closing "_robot" ("panda", "ur5"); where two folders use the
    same stem, by its folder ("anymal_b_simple").
    """
    root = share_dir() / EXAMPLE_ROBOT_DATA / "robots"
    files = sorted(root.glob("*/*/*.urdf"))
    stems = [_without_suffix(file.stem) for file in files]
    folders = [_without_suffix(file.relative_to(root).parts[0]) for file in files]
    return {
        stem if stems.count(stem) == 1 else folder: file
        for stem, folder, file in zip(stems, folders, files, strict=True)
    }


def is_library_robot(source: str) -> bool:
    """Whether a robot is named from a collection rather than by a path."""
    return source.startswith((f"{EXAMPLE_ROBOT_DATA}:", f"{SHIPPED}:"))


def find_urdf(source: str | Path, base: Path | None = None) -> Path:
    """The URDF file that `source` names; a plain path is relative to `base`."""
    text = str(source)
    if is_library_robot(text):
        scheme, _, name = text.partition(":")
        if scheme == SHIPPED:
            known = {file.stem: file for file in robots_dir().glob("*/*.urdf")}
        elif not (known := example_robots()):
            missing = "needs example-robot-data, which is not installed: pip install 'flexviz[robots]'"
            raise InputError(f'robot "{text}" {missing}')
        name = name if name in known else _without_suffix(name)
        if name not in known:
            raise InputError(f'robot "{text}" does not exist; {choose_from(name, sorted(known), limit=80)}')
        return known[name]
    path = Path(base or ".") / text
    if not path.is_file():
        expected = "expected the path of a URDF, example-robot-data:<name> or robots:<name>"
        raise InputError(f"robot description not found, {expected}", file=path)
    return path


@dataclass(frozen=True, eq=False)
class Description:
    """A robot description."""

    name: str
    root: Element
    text: str  # with joints that have nq == nv: continuous as revolute with wide limits, mimic ones free
    mimics: dict[str, Mimic]  # joint -> what it follows
    notes: tuple[Fact, ...]  # what was added


def read_urdf(path: Path) -> Description:
    """Read and check a URDF."""
    text = ""
    try:
        if path.stat().st_size > LARGEST_URDF:
            raise InputError(f"larger than {LARGEST_URDF:,} bytes, expected a robot description", file=path)
        text = path.read_text(encoding="utf-8-sig")
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        if "<xacro:" in text and "unbound prefix" in str(error):
            raise InputError(XACRO.format(name=path.name), file=path) from None
        line, column = error.position
        place = f"line {line}, column {column + 1}"
        raise InputError(f"not valid XML ({error})", file=path, place=place) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read ({error})", file=path) from None
    check_expanded(root, path)
    notes = check_urdf(root, path)
    mimics = mimics_of(root)
    for joint in root.findall("joint"):
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            if limit is None:
                limit = ElementTree.SubElement(joint, "limit", {"effort": "0", "velocity": "0"})
            limit.set("lower", "-1000")
            limit.set("upper", "1000")
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
    try:
        plain = ElementTree.tostring(root, encoding="unicode")
    except RecursionError:
        raise InputError("its elements are nested too deeply", file=path) from None
    return Description(root.get("name") or path.stem, root, plain, mimics, notes)


def check_expanded(root: Element, path: Path) -> None:
    """InputError for anything but a URDF: xacro that was not expanded, SDF, MuJoCo's format."""
    for element in root.iter():
        tag = element.tag if isinstance(element.tag, str) else ""
        if "xacro}" in tag or any(mark in text for text in element.attrib.values() for mark in ("${", "$(")):
            raise InputError(XACRO.format(name=path.name), file=path)
    if root.tag != "robot":
        other = {"sdf": "this is SDF; ", "mujoco": "this is a MuJoCo model; "}.get(root.tag, "")
        message = f"the outermost element is <{root.tag}>, expected <robot>: a URDF"
        raise InputError(f"{other}{message}", file=path)


def described() -> list[Path]:
    """Folders of installed robot descriptions: example-robot-data, and ROS packages by their variables."""
    found = [share_dir()]
    for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        found += [Path(part) for part in os.environ.get(variable, "").split(os.pathsep) if part]
    return [path.resolve() for path in found]


def mesh_names(urdf: str) -> Iterator[str]:
    """Every mesh file name in a URDF's text, each once."""
    names = (mesh.get("filename", "") for mesh in ElementTree.fromstring(urdf).iter("mesh"))
    return iter(dict.fromkeys(names))


def resolve_mesh(name: str, urdf_path: Path) -> Path:
    """The file of a mesh name in `urdf_path`; InputError if it does not exist or cannot be a mesh.

    Meshes are copied into measurement sets and exports: no other file may get there under that name, and none
    from elsewhere on this machine.
    """
    folder = urdf_path.parent
    match = re.match(r"(package|file|model)://(.*)", name)
    if match is None:
        tried = [folder / name]
    elif match[1] == "file":
        tried = [Path(match[2])]
    else:
        inside = match[2].split("/", 1)[-1]
        above = (parent / match[2] for parent in folder.resolve().parents)
        tried = [share_dir() / match[2], *above, folder / match[2], folder / inside, folder.parent / inside]
    packaged = match is not None and match[1] != "file"
    if packaged and ".." in Path(name).parts:
        raise InputError(f'mesh "{name}" leads out of its package', file=urdf_path)
    for path in tried:
        try:
            real = path.resolve() if path.is_file() else None
        except (OSError, ValueError):  # a name that is too long, or holds a zero byte
            continue
        if real is not None:
            roots = (folder.resolve().parent, *described())
            if not packaged and not any(real.is_relative_to(root) for root in roots):
                message = f'mesh "{name}" lies outside the folder of the robot description: copy it there'
                raise InputError(message, file=urdf_path)
            if {path.suffix.lower(), real.suffix.lower()} <= MESH_SUFFIXES:
                return path
            expected = ", ".join(sorted(MESH_SUFFIXES))
            raise InputError(f'mesh "{name}" is no mesh by its name, expected {expected}', file=urdf_path)
    raise InputError(f'mesh "{name}" not found (looked for {tried[0]})', file=urdf_path)


def _without_suffix(name: str) -> str:
    for suffix in _SUFFIXES:
        name = name.removesuffix(suffix)
    return name


@dataclass(frozen=True, eq=False)
class RobotSettings:
    """Typical values of a robot with flexible joints, all at the joint side; arrays are (n,)."""

    name: str
    robot: str  # argument of `Robot.load`
    joints: tuple[str, ...]
    stiffness: np.ndarray  # [Nm/rad]
    motor_inertia: np.ndarray  # [kg m²]
    link_viscous_friction: np.ndarray  # [Nm s/rad]
    motor_viscous_friction: np.ndarray  # [Nm s/rad]
    kp: np.ndarray  # [Nm/rad] controller gains
    kd: np.ndarray  # [Nm s/rad]
    cycle: float  # [s] of the controller
    theta_noise: np.ndarray  # [rad] standard deviation of the motor positions' noise
    torque_noise: np.ndarray  # [Nm] of the torques'


def load_settings(name: str) -> RobotSettings:
    """The settings called "planar_2r", "panda" or "ur5"."""
    if name not in SETTINGS:
        raise InputError(f'settings "{name}" do not exist; {choose_from(name, SETTINGS)}')
    table = toml.read(robots_dir() / f"{name}.toml")
    joints = tuple(table.pop("joints"))
    values: dict[str, Any] = {key: np.array(x) if isinstance(x, list) else x for key, x in table.items()}
    return RobotSettings(name=name, joints=joints, **values)
