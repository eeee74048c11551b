"""The robot of a set to be: found from the mapping, and its files to be written into the set."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

from flexviz.errors import InputError
from flexviz.robot import Robot, is_library_robot
from flexviz.robot_files import mesh_names, resolve_mesh


def files_of(robot: Robot) -> tuple[str, dict[str, str | bytes | Path], list[str]]:
    """What the set says of its robot, the files that it needs for that, and what was noticed.

    A URDF goes into the set as robot.urdf, its meshes beside it in meshes/.
    """
    if is_library_robot(robot.source):
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
