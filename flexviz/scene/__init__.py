"""The 3D scene as plain data: robot shapes, motion, placement and torque arrows."""

from flexviz.scene.layout import FIELD_OF_VIEW, LAYOUTS, SceneLayout, scene_layout
from flexviz.scene.motion import RobotMotion, measured_motion, nice_factor, scene_labels, with_replay
from flexviz.scene.shape import RobotShape, geometry_mesh, robot_shape, thinned_mesh
from flexviz.scene.torque import ARROW_RADIUS, torque_arrow, torque_axes

__all__ = [
    "ARROW_RADIUS",
    "FIELD_OF_VIEW",
    "LAYOUTS",
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
