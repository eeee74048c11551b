"""The 3D scene as plain data: robot shapes, motion, placement and torque arrows."""

from flexviz.scene.motion import (
    ARROW_RADIUS,
    RobotMotion,
    measured_motion,
    nice_factor,
    scene_labels,
    torque_arrow,
    torque_axes,
    with_replay,
)
from flexviz.scene.shape import (
    FIELD_OF_VIEW,
    LAYOUTS,
    VIEWS,
    RobotShape,
    SceneLayout,
    geometry_mesh,
    robot_shape,
    scene_layout,
    thinned_mesh,
)

__all__ = [
    "ARROW_RADIUS",
    "FIELD_OF_VIEW",
    "LAYOUTS",
    "VIEWS",
    "RobotMotion",
    "RobotShape",
    "SceneLayout",
    "geometry_mesh",
    "measured_motion",
    "nice_factor",
    "robot_shape",
    "scene_labels",
    "scene_layout",
    "thinned_mesh",
    "torque_arrow",
    "torque_axes",
    "with_replay",
]
