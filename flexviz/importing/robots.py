"""The robot of a set to be: found from the mapping, and its files to be written into the set."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path

from flexviz.errors import FlexvizError, InputError
from flexviz.importing.draft import is_named
from flexviz.robot import Robot
from flexviz.robot_files import mesh_names, resolve_mesh


def load_robot(source: str, joints: Sequence[str] | None, folder: Path, file: Path) -> Robot:
    """The robot with these joints; a path is relative to `folder`, errors name `file`, the mapping."""
    try:
        return Robot.load(source, joints, base=folder)
    except InputError as error:
        wrong_joint = any(f'joint "{joint}"' in error.message for joint in joints or ())
        place = "joints" if wrong_joint else "robot"
        shown = error.message if wrong_joint else f"{source}: {error.message}"
        raise InputError(shown, file=file, place=place) from None
    except FlexvizError:
        raise
    except Exception as error:  # whatever a broken robot description makes the libraries raise
        raise InputError(f'"{source}" cannot be used as a robot: {error}', file=file, place="robot") from None


def files_of(robot: Robot) -> tuple[str, dict[str, str | bytes | Path], list[str]]:
    """What the set says of its robot, the files that it needs for that, and what was noticed.

    A URDF goes into the set as robot.urdf, its meshes beside it in meshes/.
    """
    if is_named(robot.source):
        return robot.source, {}, []
    text = robot.urdf_path.read_text(encoding="utf-8-sig")
    files: dict[str, str | bytes | Path] = {}
    notes: list[str] = []
    renamed: dict[str, str] = {}
    for name in mesh_names(text):
        try:
            found = resolve_mesh(name, robot.urdf_path)
        except InputError as error:
            notes.append(f"{error.message}: the robot can be identified but not drawn")
            continue
        inside = f"meshes/{found.name}"
        if inside in files:
            inside = f"meshes/{len(files)}_{found.name}"
        files[inside] = found
        renamed[name] = inside
    if renamed:
        root = ElementTree.fromstring(text)
        for mesh in root.iter("mesh"):
            mesh.set("filename", renamed.get(mesh.get("filename", ""), mesh.get("filename", "")))
        text = ElementTree.tostring(root, encoding="unicode")
    return "robot.urdf", {"robot.urdf": text, **files}, notes
