"""The 3D scene as plain data: robot shapes, motion, placement, and arcs of torque and deflection."""

from flexviz.scene.arcs import arc_arrow, joint_axes
from flexviz.scene.motion import RobotMotion, measured_motion, nice_factor, scene_labels, with_replay
from flexviz.scene.shape import (
    FIELD_OF_VIEW,
    LAYOUTS,
    SIDE_BY_SIDE,
    VIEWS,
    RobotShape,
    SceneLayout,
    geometry_mesh,
    robot_shape,
    scene_layout,
    thinned_mesh,
)

__all__ = [
    "FIELD_OF_VIEW",
    "LAYOUTS",
    "SIDE_BY_SIDE",
    "VIEWS",
    "RobotMotion",
    "RobotShape",
    "SceneLayout",
    "arc_arrow",
    "geometry_mesh",
    "joint_axes",
    "measured_motion",
    "nice_factor",
    "robot_shape",
    "scene_labels",
    "scene_layout",
    "thinned_mesh",
    "with_replay",
]
