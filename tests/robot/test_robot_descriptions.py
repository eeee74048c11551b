"""Robot descriptions as people have them: what is impossible is refused, what is decided is said."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.data.measurements import read_set
from flexviz.model.simulation import from_urdf, make_plan
from flexviz.model.simulation.sets import simulate_preset
from flexviz.outlets.exporting import write
from flexviz.outlets.exporting.followers import followers_of
from flexviz.outlets.terminal.simulate import summary
from flexviz.robot.robot import Robot
from tests.exporting_cases import identified
from tests.shared_data import FAULTS
from tests.small_set import JOINT, LINK, URDF

TENSOR = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
SECOND = URDF.index('<link name="link2">')  # what changes is the second link
END = "</robot>"
FINGER = '<link name="{name}"><inertial><origin xyz="0.05 0 0"/><mass value="0.2"/>' + TENSOR.replace(
    "0.1", "0.001"
)
FINGERS = "".join(
    FINGER.format(name=name)
    + "</inertial></link>"
    + JOINT.format(name=f"{name}_joint", parent="link2", child=name, x=0.4)
    for name in ("left", "right")
)
MIMIC = '<mimic joint="left_joint" multiplier="-1" offset="0.1"/></joint>'
GRIPPER = URDF.replace(END, FINGERS[: -len("</joint>")] + MIMIC + END)
TIP = '<link name="tip"/>' + JOINT.format(name="roll", parent="link2", child="tip", x=0.3)
POINT = (  # on the joint's axis
    '<link name="tip"><inertial><mass value="1"/>' + TENSOR.replace("0.1", "0") + "</inertial></link>"
    + JOINT.format(name="roll", parent="link2", child="tip", x=0.3)
)  # fmt: skip


def fault(name: str) -> Path:
    file = FAULTS / name
    if not file.exists():
        pytest.skip("the inputs that failed once are not here")
    return file


def written(folder: Path, text: str, name: str = "arm.urdf") -> Path:
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return file


def with_inertia(inertia: str) -> str:
    """The small arm with another inertia of its second link (4 kg, 0.5 m from joint to joint)."""
    return URDF[:SECOND] + URDF[SECOND:].replace(TENSOR, inertia, 1)


def tensor(xx: float, yy: float, zz: float, xy: float = 0.0, xz: float = 0.0, yz: float = 0.0) -> str:
    return f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="{xy}" ixz="{xz}" iyz="{yz}"/>'


def test_a_lost_decimal_point_is_refused_with_link_and_value() -> None:
    with pytest.raises(InputError) as error:
        make_plan(fault("03-inertia-decimal-point/decimal.urdf"))
    said = str(error.value)
    assert 'link "forearm"' in said and "izz = 8.5" in said and "850 times" in said and "0.002, 0.008" in said


REFUSED = {
    "decimal point of another moment": (tensor(0.01, 3.0, 0.02), ("iyy = 3", "100 times")),
    "a moment too small": (tensor(0.1, 0.0001, 0.02), ("ixx = 0.1", "4.98 times")),
    "a product too large": (tensor(0.1, 0.1, 0.1, xy=0.08), ("ixy = 0.08", "0.02, 0.1, 0.18", "50 %")),
    "six per cent": (tensor(0.1, 0.1, 0.212), ("6 %", "izz = 0.212")),
    "all in another unit": (tensor(100.0, 100.0, 100.0), ("100 kg m² and 4 kg", "radius of gyration of 5 m")),
}


@pytest.mark.parametrize("what", REFUSED)
def test_impossible_inertias_are_refused(what: str, tmp_path: Path) -> None:
    inertia, words = REFUSED[what]
    with pytest.raises(InputError) as error:
        Robot.load(written(tmp_path, with_inertia(inertia)))
    assert all(word in str(error.value) for word in ('link "link2"', *words)), str(error.value)


def test_small_violations_are_reported_and_rounding_is_not(tmp_path: Path) -> None:
    (note,) = Robot.load(written(tmp_path, with_inertia(tensor(0.1, 0.1, 0.206)))).notes
    assert note.values["link"] == "link2" and note.values["excess"] == pytest.approx(0.03)
    assert note.values["suspect"] == "izz = 0.206" and "by 3 %" in note.text
    (wide,) = Robot.load(written(tmp_path, with_inertia(tensor(5.0, 5.0, 5.0)))).notes
    assert (wide.kind, wide.values["longest"]) == ("inertia-wide", 0.5)
    assert wide.values["radius"] == pytest.approx(1.118, abs=1e-3)


SILENT = {
    "rounded": tensor(0.1, 0.1, 0.20001),
    "a thin rod": tensor(0.0, 0.1, 0.1),
    "a plate": tensor(0.05, 0.05, 0.1),
    "a point": tensor(0.0, 0.0, 0.0),
    "turned axes": tensor(0.1, 0.06, 0.1, xy=0.02),
}


@pytest.mark.parametrize("what", SILENT)
def test_possible_inertias_are_not_mentioned(what: str, tmp_path: Path) -> None:
    assert Robot.load(written(tmp_path, with_inertia(SILENT[what]))).notes == ()


def test_what_does_not_move_or_does_not_matter_is_not_checked(tmp_path: Path) -> None:
    wrong = f"<inertial><mass value='1e-6'/>{tensor(1e-9, 1e-9, 1e-6)}</inertial>"
    base = URDF.replace('<link name="base"/>', f'<link name="base">{wrong.replace("e-", "e-0")}</link>')
    sensor = f'<link name="imu">{wrong}</link>' + JOINT.format(
        name="glue", parent="link2", child="imu", x=0.1
    )
    glued = base.replace(END, sensor.replace('"revolute"', '"fixed"') + END)
    assert Robot.load(written(tmp_path, glued)).notes == ()


def test_a_joint_without_load_is_locked_and_named() -> None:
    plan = make_plan(fault("04-moving-massless-link/masslesslink.urdf"))
    assert plan.robot.joints == ("shoulder_yaw", "shoulder_pitch", "elbow")
    assert plan.robot.notes == (Fact("joints-without-load", "odd", ("wrist_roll",)),)


@pytest.mark.parametrize("tip", [TIP, POINT, TIP.replace('"revolute"', '"continuous"')])
def test_joints_without_load(tip: str, tmp_path: Path) -> None:
    file = written(tmp_path, URDF.replace(END, tip + END))
    robot = Robot.load(file)
    assert robot.joints == ("joint1", "joint2") and robot.notes[-1].joints == ("roll",)
    assert Robot.load(file, ["joint1", "joint2", "roll"]).notes == ()  # asked for: a payload may be on it
    assert np.isfinite(make_plan(file).model.stiffness).all()


def test_joints_with_load_further_out_move(tmp_path: Path) -> None:
    """A massless link between two joints is no joint without a load, nor is a hand on a light one."""
    between = URDF[:SECOND].replace(LINK.format(name="link1"), '<link name="link1"/>') + URDF[SECOND:]
    assert Robot.load(written(tmp_path, between)).joints == ("joint1", "joint2")
    assert Robot.load(written(tmp_path, URDF)).notes == ()
    hand = LINK.format(name="hand") + JOINT.format(name="hold", parent="tip", child="hand", x=0.1).replace(
        '"revolute"', '"fixed"'
    )
    assert Robot.load(written(tmp_path, URDF.replace(END, TIP + hand + END))).n == 3


XACRO = {
    "expressions": URDF.replace('value="4"', 'value="${m1}"'),
    "a macro": URDF.replace(
        '<robot name="arm">', '<robot xmlns:xacro="http://www.ros.org/wiki/xacro">'
    ).replace(END, '<xacro:include filename="hand.xacro"/></robot>'),
    "an undeclared prefix": URDF.replace(END, '<xacro:hand parent="link2"/></robot>'),
    "an argument": URDF.replace('name="arm"', 'name="$(arg name)"'),
}


@pytest.mark.parametrize("what", XACRO)
def test_xacro_is_recognised(what: str, tmp_path: Path) -> None:
    for name in ("arm.urdf", "arm.urdf.xacro", "arm.xacro"):
        with pytest.raises(InputError, match=rf"xacro {name} > robot\.urdf"):
            make_plan(written(tmp_path, XACRO[what], name))


@pytest.mark.parametrize("name", ["arm.urdf.xacro", "arm_macro.urdf", "arm_x.urdf"])
def test_xacro_given_as_a_robot(name: str) -> None:
    with pytest.raises(InputError, match=f"this is xacro, .*: xacro {name} > robot.urdf"):
        make_plan(fault(f"08-xacro-given-as-robot/{name}"))


def test_expanded_xacro_and_other_formats(tmp_path: Path) -> None:
    """What xacro leaves in its output (name space, comments) is no xacro; SDF and MJCF are named."""
    head = '<!-- <xacro:hand x="${x}"/> --><robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="arm">'
    expanded = URDF.replace('<robot name="arm">', head)
    assert Robot.load(written(tmp_path, expanded)).notes == ()
    for name, text, word in (("a.sdf", "<sdf/>", "SDF"), ("a.mjcf", "<mujoco/>", "a MuJoCo model")):
        with pytest.raises(InputError, match=f"this is {word}; .*expected <robot>: a URDF"):
            make_plan(written(tmp_path, text, name))


def test_mimic_fingers_are_one_joint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(from_urdf, "DURATION", 0.3)
    done = simulate_preset(fault("09-mimic-fingers/mimic.urdf"), tmp_path / "set")
    said = "finger_r_joint (-1 × finger_l_joint)"
    assert done.plan.robot.joints == ("shoulder_yaw", "shoulder_pitch", "elbow", "finger_l_joint")
    assert any(said in line and "locked" in line for line in summary(done))
    assert any(said in warning.text for warning in read_set(done.folder).warnings)


def test_mimic_joints(tmp_path: Path) -> None:
    file = written(tmp_path, GRIPPER)
    robot = Robot.load(file)
    assert robot.joints == ("joint1", "joint2", "left_joint")
    locked = {"how": "locked", "follows": ("-1 × left_joint + 0.1",)}
    assert robot.notes[-1] == Fact("mimic-joints", joints=("right_joint",), values=locked)
    turned = robot.link_poses(np.zeros(3))["right"][:3, :3]  # locked where the leader's zero puts it
    np.testing.assert_allclose(np.arccos(turned[0, 0]), 0.1, atol=1e-9)
    arm = Robot.load(file, ["joint1", "joint2"])
    assert arm.notes == () and arm.joints == ("joint1", "joint2")  # both fingers locked, as the set says
    own = Robot.load(file, ["left_joint", "right_joint"])
    assert (own.notes[-1].joints, own.notes[-1].values["how"]) == (("right_joint",), "own")


def test_followers_of_followers_and_of_nothing(tmp_path: Path) -> None:
    third = FINGER.format(name="third") + "</inertial></link>" + JOINT.format(
        name="third_joint", parent="right", child="third", x=0.1
    ).replace("</joint>", '<mimic joint="right_joint" multiplier="2"/></joint>')  # fmt: skip
    robot = Robot.load(written(tmp_path, GRIPPER.replace(END, third + END)))
    assert (robot.mimics["third_joint"].leader, robot.mimics["third_joint"].multiplier) == (
        "left_joint",
        -2.0,
    )
    assert robot.mimics["third_joint"].offset == pytest.approx(0.2)
    found = followers_of(robot, robot.cad_parameters)
    assert [(one.joint, one.above) for one in found.coupled] == [
        ("right_joint", None),
        ("third_joint", "right_joint"),
    ]
    assert found.rest[1, 0] == pytest.approx(4.0) and not found.welded
    lost = Robot.load(written(tmp_path, GRIPPER.replace('mimic joint="left_joint"', 'mimic joint="lift"')))
    assert (lost.notes[-1].joints, lost.notes[-1].values["how"]) == (("right_joint",), "lost")


def test_free_bases_and_frictions_of_locked_joints_are_said(tmp_path: Path) -> None:
    free = URDF.replace('<link name="base"/>', '<link name="world"/><link name="base"/>').replace(
        END,
        JOINT.format(name="free", parent="world", child="base", x=0).replace("revolute", "floating") + END,
    )
    held = (Fact("joint-held", joints=("free",), values={"type": "floating"}),)
    assert Robot.load(written(tmp_path, free)).notes == held
    assert Robot.load(written(tmp_path, free), ["joint1"]).notes == held
    rough = GRIPPER.replace(MIMIC, f'<dynamics damping="0.3"/>{MIMIC}')
    assert Fact("dynamics-unused", joints=("right_joint",)) in Robot.load(written(tmp_path, rough)).notes
    smooth = GRIPPER.replace(MIMIC, f'<dynamics damping="0" friction="0"/>{MIMIC}')
    assert len(Robot.load(written(tmp_path, smooth)).notes) == 1


def test_an_implicit_world(tmp_path: Path) -> None:
    mounted = URDF.replace(END, JOINT.format(name="mount", parent="world", child="base", x=0) + END)
    robot = Robot.load(written(tmp_path, mounted.replace('"mount" type="revolute"', '"mount" type="fixed"')))
    assert robot.joints == ("joint1", "joint2") and robot.notes[0].kind == "world-added"
    with pytest.raises(InputError, match='parent: link "wrld" does not exist'):
        Robot.load(written(tmp_path, mounted.replace('"world"', '"wrld"')))


def test_mjcf_couples_what_the_urdf_couples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In MuJoCo the second finger follows the first as the URDF's <mimic> says; the mass is the same."""
    mujoco = pytest.importorskip("mujoco")
    monkeypatch.setattr(from_urdf, "DURATION", 0.3)
    simulated = simulate_preset(written(tmp_path, GRIPPER), tmp_path / "set")
    done = write(
        identified(read_set(simulated.folder), simulated.plan.model), tmp_path / "out", ["urdf", "mjcf"]
    )
    model = mujoco.MjModel.from_xml_path(str(done.files["mjcf"][0]))
    state = mujoco.MjData(model)
    state.qpos[model.joint("right_joint").qposadr] = 0.1
    for _ in range(400):
        state.ctrl[2] = 2.0 * (0.4 - state.joint("left_joint_motor").qpos[0])
        mujoco.mj_step(model, state)
    left, right = (float(state.joint(f"{side}_joint").qpos[0]) for side in ("left", "right"))
    assert abs(left) > 0.05 and right == pytest.approx(0.1 - left, abs=0.01)
    assert model.body_mass.sum() == pytest.approx(8.4, abs=1e-6)
    exported = ElementTree.parse(done.files["urdf"][0]).getroot()
    (mimic,) = exported.findall("joint[@name='right_joint']/mimic")
    assert mimic.attrib == {"joint": "left_joint", "multiplier": "-1", "offset": "0.1"}
    for files in done.files.values():
        assert "Locked while identified: right_joint" in files[0].read_text(encoding="utf-8")
