"""The robot of a set that is written: its description and meshes go into the set's folder."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from contextlib import suppress
from pathlib import Path

from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.robot.robot import Robot, is_library_robot
from flexviz.robot.robot_files import mesh_names, read_urdf, resolve_mesh


def robot_files(robot: Robot) -> tuple[str, dict[str, str | bytes | Path], list[Fact]]:
    """The set's name for its robot, the files it needs for that, and a fact on missing meshes.

    A URDF goes into the set as robot.urdf, its meshes beside it into meshes/.
    """
    if is_library_robot(robot.source):
        return robot.source, {}, []
    text = description(robot)
    files: dict[str, str | bytes | Path] = {}
    missing: list[str] = []
    renamed: dict[str, str] = {}
    for name in mesh_names(text):
        try:
            found = resolve_mesh(name, robot.urdf_path)
        except InputError as error:
            missing.append(error.message)
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
    values = {"count": len(missing), "first": "".join(missing[:1])}
    facts = [Fact("meshes-missing", "odd", values=values)] if missing else []
    return "robot.urdf", {"robot.urdf": text, **files}, facts


def description(robot: Robot) -> str:
    """The URDF as it is written in its file; the text that was read, where that has changed or gone."""
    with suppress(InputError, OSError):
        if read_urdf(robot.urdf_path).text == robot.urdf:
            return robot.urdf_path.read_text(encoding="utf-8-sig")
    return robot.urdf
