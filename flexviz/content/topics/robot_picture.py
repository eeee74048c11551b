"""The robot as flat shaded polygons in SVG, its links coloured by their joint's error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.base.arrays import Array
from flexviz.content.blocks import Picture
from flexviz.content.charts import COLOURS, cividis, css
from flexviz.content.scene import RobotShape, lean_shape, robot_shape, scene_layout
from flexviz.content.topics.story import Story
from flexviz.content.view import LinkColours, link_colours
from flexviz.content.wording import error_text, escape, number

FACES = 300  # of a link
SIZE = (420, 250)  # [px] of the picture of one robot or two
TOP, BOTTOM = 26, 34  # [px] for the names above the robots, and the scale below
LIGHT = np.array([0.25, 0.55, 0.8]) / np.linalg.norm([0.25, 0.55, 0.8])  # to the right, up, to the viewer
AMBIENT = 0.45  # share of a face's brightness that does not depend on its direction


def robot_picture(content: Story, group: str) -> Picture | None:
    """The robot in a pose of a group, with the errors before and after; once if there is only one model."""
    steps = content.steps
    if not steps:
        return None
    chosen = (steps[0], steps[-1]) if len(steps) > 1 else steps
    found = [link_colours(step, content.spread, chosen) for step in chosen]
    colours = [one for one in found if one is not None]
    measurements = content.measurements
    theta = measurements.group(group).joined("theta")
    shape = lean_shape(robot_shape(measurements.robot), FACES)
    layout = scene_layout(measurements.robot, shape, theta)
    poses = measurements.robot.link_poses(theta[len(theta) // 2])
    width, height = SIZE
    pitch = width / len(chosen)
    scale = min(0.46 * pitch / layout.width, (height - TOP - BOTTOM) / (2.1 * layout.size))
    middle = (TOP + height - BOTTOM) / 2
    parts: list[str] = []
    names = ("before", "after")[-len(chosen) :] if len(chosen) > 1 else ("",)
    for k, (one, name) in enumerate(zip(colours, names, strict=True)):
        at = np.array([(k + 0.5) * pitch, middle])
        parts += faces(shape, poses, layout.axes, layout.centre, scale, at, one)
        label = escape(f"{name}: {error_text(one.errors)}" if name else error_text(one.errors))
        parts.append(f'<text x="{at[0]:g}" y="16" text-anchor="middle">{label}</text>')
    told = "Links are coloured by their joint's error"
    told += ", before and after." if len(chosen) > 1 else "."
    return Picture("The robot", told, SIZE, [*parts, *_scale_bar(colours[0].end, colours[0].errors.unit)])


def faces(
    shape: RobotShape, poses: dict[str, Array], view: Array, centre: Array, scale: float, at: Array,
    colours: LinkColours,
) -> list[str]:  # fmt: skip
    """The faces turned to the viewer, those behind first; view (3, 3): right, up and towards the viewer."""
    drawn: list[tuple[float, str]] = []
    for body in shape.bodies:
        pose = poses[body.link]
        points = (body.vertices @ pose[:3, :3].T + pose[:3, 3] - centre) @ view.T
        corners = points[body.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = np.linalg.norm(normals, axis=1)
        bright = AMBIENT + (1 - AMBIENT) * np.maximum(normals @ LIGHT / np.maximum(size, 1e-12), 0.0)
        colour = COLOURS.body if body.joint is None else colours.colours[body.joint]
        flat = np.round(at + scale * corners[:, :, :2] * [1.0, -1.0], 1)
        for k in np.flatnonzero((normals[:, 2] > 0) & (size > 0)):
            red, green, blue = (round(bright[k] * value) for value in colour)
            fill = css((red, green, blue))
            path = " ".join(f"{x:g},{y:g}" for x, y in flat[k])
            polygon = f'<polygon points="{path}" fill="{fill}" stroke="{fill}" stroke-width="0.4"/>'
            drawn.append((float(corners[k, :, 2].mean()), polygon))
    return [polygon for _, polygon in sorted(drawn, key=lambda one: one[0])]


def _scale_bar(end: float, unit: str, steps: int = 24) -> Sequence[str]:
    """The colours from no error to the largest one."""
    width, height = SIZE
    left, cell = width / 2 - 70, 140 / steps
    bars = [
        f'<rect x="{left + k * cell:.1f}" y="{height - 18}" width="{cell + 0.5:.1f}" height="9" '
        f'fill="{css(cividis(k / (steps - 1)))}"/>'
        for k in range(steps)
    ]
    ends = (left - 6, "end", "0"), (left + 146, "start", f"{number(end, 3)} {unit}")
    words = [f'<text x="{x:g}" y="{height - 9}" text-anchor="{a}">{escape(t)}</text>' for x, a, t in ends]
    return [*bars, *words]
