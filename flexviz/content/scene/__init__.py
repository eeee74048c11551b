"""The 3D scene as plain data: robot shapes, motion, placement, and arcs of torque and deflection."""

from flexviz.content.scene.arcs import arc_arrow, joint_axes
from flexviz.content.scene.framing import FIELD_OF_VIEW, Box, Screen
from flexviz.content.scene.motion import RobotMotion, measured_motion, nice_factor, scene_labels, with_replay
from flexviz.content.scene.shape import (
    RobotShape,
    geometry_mesh,
    lean_shape,
    payload_place,
    robot_shape,
    thinned_mesh,
)
from flexviz.content.scene.stage import LAYOUTS, SIDE_BY_SIDE, VIEWS, SceneLayout, scene_layout
