"""The links' visual shapes for MJCF: boxes, cylinders and spheres unchanged, meshes as STL."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from typing import Any

import numpy as np

from flexviz.base.errors import InputError
from flexviz.content.scene import geometry_mesh, thinned_mesh
from flexviz.outlets.exporting.xml_text import number_text
from flexviz.robot._pinocchio import pin
from flexviz.robot.robot import Robot

MAX_FACES = 100_000  # per mesh; MuJoCo's limit is 200,000
GREY = (0.7, 0.7, 0.72, 1.0)


class Shapes:
    """Turns links into visual geoms and collects their meshes.

    Attributes:
        assets: <mesh> elements.
        files: file name -> STL.
        missing: unreadable meshes, one line each.
    """

    def __init__(self, robot: Robot, folder: str) -> None:
        self._robot, self._folder, self._urdf = robot, folder, robot.description
        self.assets: list[ElementTree.Element] = []
        self.files: dict[str, bytes] = {}
        self.missing: list[str] = []

    def geoms(self, link: str) -> list[ElementTree.Element]:
        """The visual shapes of a link."""
        found = self._urdf.link_map.get(link)
        out = []
        for k, visual in enumerate(found.visuals if found is not None else ()):
            element = ElementTree.Element("geom", contype="0", conaffinity="0", group="2")
            if self._shape(element, visual.geometry, f"{link}_{k}"):
                if visual.origin is not None:
                    quaternion = pin.Quaternion(visual.origin[:3, :3].astype(float)).coeffs()  # x y z w
                    element.set("pos", number_text(visual.origin[:3, 3]))
                    element.set("quat", number_text((quaternion[3], *quaternion[:3])))
                element.set("rgba", number_text(self._colour(visual.material)))
                out.append(element)
        return out

    def _shape(self, element: ElementTree.Element, geometry: Any, name: str) -> bool:
        if geometry.mesh is not None:
            return self._mesh(element, geometry, name)
        if geometry.box is not None:
            kind, size = "box", np.asarray(geometry.box.size) / 2
        elif geometry.cylinder is not None:
            kind, size = "cylinder", np.array([geometry.cylinder.radius, geometry.cylinder.length / 2])
        elif geometry.sphere is not None:
            kind, size = "sphere", geometry.sphere.radius
        else:
            return False
        element.attrib |= {"type": kind, "size": number_text(size)}
        return True

    def _mesh(self, element: ElementTree.Element, geometry: Any, name: str) -> bool:
        try:
            mesh = thinned_mesh(geometry_mesh(geometry, self._robot), MAX_FACES)
        except InputError as error:
            self.missing.append(f"mesh {geometry.mesh.filename}: {error.message}")
            return False
        file = f"{self._folder}/{name}.stl"
        self.files[file] = mesh.export(file_type="stl")
        self.assets.append(ElementTree.Element("mesh", name=name, file=file, inertia="shell"))
        element.attrib |= {"type": "mesh", "mesh": name}
        return True

    def _colour(self, material: Any) -> Any:
        if material is not None and material.color is None:
            material = self._urdf._material_map.get(material.name)
        return GREY if material is None or material.color is None else material.color.rgba
