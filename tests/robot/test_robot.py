"""Robots: sources, joint order, locked joints, payloads, meshes, errors."""

from pathlib import Path

import numpy as np
import pytest

from flexviz.base.errors import InputError
from flexviz.content.scene import robot_shape
from flexviz.robot._pinocchio import pin
from flexviz.robot.model import FlexibleModel
from flexviz.robot.robot import PayloadBody, Robot
from flexviz.robot.robot_files import resolve_mesh

ARM = [f"panda_joint{i}" for i in range(1, 8)]
MIXED = [ARM[i] for i in (2, 0, 6, 1, 3, 5, 4)]

INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
SLIDER = f"""<robot name="slider">
  <link name="world"/>
  <link name="cart"><inertial><mass value="2"/><origin xyz="0 0 0.1"/>{INERTIA}</inertial>
    <visual><geometry><mesh filename="package://nowhere/cart.stl"/></geometry></visual></link>
  <link name="wheel"><inertial><mass value="1"/>{INERTIA}</inertial></link>
  <link name="finger"><inertial><mass value="1"/>{INERTIA}</inertial></link>
  <joint name="z_slide" type="prismatic"><parent link="world"/><child link="cart"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="spin" type="continuous"><parent link="cart"/><child link="wheel"/><axis xyz="0 0 1"/></joint>
  <joint name="a_follow" type="revolute"><parent link="cart"/><child link="finger"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/><mimic joint="spin"/></joint>
</robot>"""


@pytest.fixture
def slider(tmp_path: Path) -> Path:
    (tmp_path / "slider.urdf").write_text(SLIDER)
    return tmp_path


@pytest.mark.parametrize("name", ["panda", "ur5", "ur10", "z1", "ur5_robot", "anymal_c_simple"])
def test_short_names(name: str) -> None:
    robot = Robot.load(f"example-robot-data:{name}")
    assert robot.n == robot.model.nq == robot.model.nv > 0
    assert robot.source == f"example-robot-data:{name}"


def test_joint_order_and_locked_joints() -> None:
    robot = Robot.load("example-robot-data:panda", MIXED)
    assert robot.joints == tuple(MIXED)
    assert [robot.model.names[1 + int(i)] for i in robot.order] == MIXED
    x = np.arange(14.0).reshape(2, 7)
    assert np.array_equal(robot.from_pin(robot.to_pin(x)), x)
    straight = Robot.load("example-robot-data:panda", ARM)
    assert straight.to_pin(x) is x and straight.from_pin(x) is x
    np.testing.assert_allclose(robot.cad_parameters, straight.cad_parameters[[2, 0, 6, 1, 3, 5, 4]])
    # the locked fingers and the hand move with joint 7
    assert robot.joint_of_link("panda_leftfinger") == MIXED.index("panda_joint7")
    assert robot.joint_of_link("panda_link0") is None


def test_continuous_prismatic_mimic(slider: Path) -> None:
    robot = Robot.load("slider.urdf", base=slider)
    assert set(robot.joints) == {"z_slide", "spin"} and robot.model.nq == robot.model.nv == 2
    every = Robot.load("slider.urdf", ["z_slide", "spin", "a_follow"], slider)
    assert every.model.nq == every.model.nv == 3
    assert Robot.load("slider.urdf", ["spin"], slider).n == 1


def test_model_with_gives_back_the_cad_inertias() -> None:
    robot = Robot.load("example-robot-data:panda", MIXED)
    model = robot.model_with(robot.cad_parameters, gravity=(0, 1, -9))
    for mine, cad in zip(model.inertias[1:], robot.model.inertias[1:], strict=True):
        np.testing.assert_allclose(mine.toDynamicParameters(), cad.toDynamicParameters(), atol=1e-12)
    np.testing.assert_allclose(model.gravity.linear, [0, 1, -9])
    np.testing.assert_allclose(robot.model.gravity.linear, [0, 0, -9.81])


def test_payload_moves_into_the_joint_frame() -> None:
    robot = Robot.load("example-robot-data:panda", MIXED)
    hand = PayloadBody("panda_hand", 1.3, [0.02, -0.01, 0.1], [0.004, 0.005, 0.006, 0.0003, -0.0002, 0.0001])
    base = PayloadBody("panda_link0", 5.0, [0, 0, 1], [0] * 6)
    point = PayloadBody("panda_link4", 2.0, [0.1, 0, 0], [0] * 6)
    bodies = [hand, base, point]
    parameters = robot.payload_parameters(bodies)
    assert parameters[MIXED.index("panda_joint4"), 0] == 2.0
    # independent route: Pinocchio's own body appending
    expected = robot.model.copy()
    for body in (hand, point):
        frame = robot.model.frames[robot.model.getFrameId(body.link)]
        inertia = pin.Inertia(body.mass, body.com, body.inertia_matrix)
        expected.appendBodyToJoint(frame.parentJoint, inertia, frame.placement)
    model = robot.model_with(robot.cad_parameters, bodies)
    rng = np.random.default_rng(0)
    q, v, a = rng.normal(size=(3, 7))
    tau = pin.rnea(model, model.createData(), q, v, a)
    np.testing.assert_allclose(tau, pin.rnea(expected, expected.createData(), q, v, a), rtol=1e-10)
    # and linear in the parameters
    regressor = pin.computeJointTorqueRegressor(robot.model, robot.model.createData(), q, v, a)
    gamma = robot.cad_parameters + parameters
    np.testing.assert_allclose(regressor @ robot.to_pin(gamma.T).T.ravel(), tau, rtol=1e-9, atol=1e-9)


def test_link_poses() -> None:
    robot = Robot.load("example-robot-data:panda", MIXED)
    poses = robot.link_poses(np.zeros(7))
    assert set(robot.links) == set(poses)
    np.testing.assert_allclose(poses["panda_link0"], np.eye(4), atol=1e-12)
    np.testing.assert_allclose(poses["panda_hand"][:3, 3], [0.088, 0, 0.926], atol=1e-9)


def test_drawing_loads_every_mesh() -> None:
    shape = robot_shape(Robot.load("example-robot-data:panda", ARM))
    assert len(shape.bodies) >= 8 and not shape.missing


@pytest.mark.parametrize(
    ("source", "joints", "message"),
    [
        ("example-robot-data:pnda", None, 'did you mean "panda"'),
        ("robots:nothing", None, "planar_2r"),
        ("missing.urdf", None, "missing.urdf: robot description not found"),
        ("example-robot-data:panda", ["panda_join1"], 'did you mean "panda_joint1"? valid: panda_joint1'),
        ("example-robot-data:panda", ["panda_joint1", "panda_joint1"], "given twice, expected once"),
    ],
)
def test_bad_sources(source: str, joints: list[str] | None, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message.replace("?", r"\?")) as error:
        Robot.load(source, joints, tmp_path)
    assert "\n" not in str(error.value)


def test_bad_urdf_link_and_mesh(slider: Path) -> None:
    robot = Robot.load("slider.urdf", base=slider)
    with pytest.raises(InputError, match='link "cat" does not exist; did you mean "cart"'):
        robot.joint_of_link("cat")
    with pytest.raises(InputError, match=r'mesh "package://nowhere/cart\.stl" not found'):
        resolve_mesh("package://nowhere/cart.stl", robot.urdf_path)
    (slider / "bad.urdf").write_text("<robot><link></robot>")
    with pytest.raises(InputError, match="not valid XML"):
        Robot.load("bad.urdf", base=slider)


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("file:///etc/passwd", "outside the folder"),
        ("../secret.txt", "no mesh by its name"),
        ("link.stl", "no mesh by its name"),
        ("package://../../etc/x.stl", "leads out of its package"),
        ("package://slider/../secret.stl", "leads out of its package"),
        ("a" * 400, "not found"),
        ("a\0.stl", "not found"),
    ],
)
def test_only_meshes_are_taken_for_meshes(name: str, why: str, slider: Path) -> None:
    (slider.parent / "secret.txt").write_text("secret")
    (slider / "link.stl").symlink_to(slider.parent / "secret.txt")
    with pytest.raises(InputError, match=why):
        resolve_mesh(name, slider / "slider.urdf")


@pytest.mark.parametrize("form", ["{}", "file://{}", "../../elsewhere/private.stl"])
def test_meshes_from_elsewhere_are_not_taken(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh, urdf = tmp_path / "elsewhere" / "private.stl", tmp_path / "robot" / "urdf" / "slider.urdf"
    for file in (mesh, urdf):
        file.parent.mkdir(parents=True)
        file.write_text("solid private")
    name = form.format(mesh)
    with pytest.raises(InputError, match="outside the folder of the robot description"):
        resolve_mesh(name, urdf)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(mesh.parent))  # an installed description
    assert resolve_mesh(name, urdf).resolve() == mesh


def test_model_checks_shapes() -> None:
    one = np.ones(2)
    with pytest.raises(InputError, match="inertial has shape"):
        FlexibleModel(("a", "b"), one, one, one, one, np.ones((2, 9)))
    model = FlexibleModel(("a", "b"), one, one, one, one, np.ones((2, 10)))
    assert model.n == 2 and not model.stiffness.flags.writeable
