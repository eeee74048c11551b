"""Exported URDF and MJCF: read back, and simulated beside flexviz's own simulator."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from flexviz.analysis.identification import identify
from flexviz.base.errors import InputError
from flexviz.base.resources import sessions_dir
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.simulation import Run, Sampled, make_plan, replay, simulate_run
from flexviz.outlets.exporting import IdentifiedRobot, write
from flexviz.outlets.exporting.bodies import carriers
from flexviz.outlets.exporting.coverage import MJCF, LeftOut
from flexviz.outlets.exporting.mjcf import timestep
from flexviz.robot.model import EffectValue
from flexviz.robot.robot import Robot
from tests.exporting_cases import document, identified, plan, short_set
from tests.small_set import LINK, URDF, write_small_set

mujoco = pytest.importorskip("mujoco")

Array = NDArray[np.float64]
PERCENT = 0.01
# effects whose motion is the same in MuJoCo, and those with nearly the same
EXACT = (
    "quadratic_friction", "stiffness_hardening", "backlash:joint1", "joint_damping:joint2", "cable_spring",
    "base_tilt", "torque_gain", "torque_offset", "payload_error:p2",
)  # fmt: skip
NEARLY = ("coulomb_friction", "link_coulomb_friction", "torque_delay", "coupled_friction")
MJCF_CHECKED = {name.split(":")[0] for name in EXACT} | {*NEARLY, "presliding_hysteresis", "torque_limit"}
URDF_CHECKED = {"coulomb_friction", "link_coulomb_friction", "presliding_hysteresis", "payload_error"}
NOT_IN_MJCF = [name for name, e in MJCF.items() if isinstance(e, LeftOut) and name != "external_contact"]


@pytest.fixture(scope="module")
def planar(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    return short_set("planar-2r", tmp_path_factory.mktemp("planar"))


@pytest.fixture(scope="module")
def panda(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    return short_set("panda", tmp_path_factory.mktemp("panda"))


def small_set(folder: Path, urdf: str = URDF) -> MeasurementSet:
    """The small arm with another description."""
    write_small_set(folder)
    (folder / "robot.urdf").write_text(urdf, encoding="utf-8")
    return read_set(folder)


def small_model(measurements: MeasurementSet) -> Any:
    """Its CAD inertias with the planar arm's other values."""
    return replace(plan("planar-2r").model, inertial=measurements.robot.cad_parameters)


# -- URDF ----------------------------------------------------------------------------------------------------


def bare(element: ElementTree.Element) -> list[Any]:
    """An element without what an export writes, to compare."""
    kept = [child for child in element if child.tag not in ("inertial", "dynamics")]
    return [element.tag, element.attrib, (element.text or "").strip(), [bare(child) for child in kept]]


@pytest.mark.parametrize("preset", ["planar-2r", "panda"])
def test_urdf_read_again_gives_the_same(preset: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    measurements = request.getfixturevalue(preset.split("-")[0])
    hidden = "coulomb_friction", "link_coulomb_friction", "presliding_hysteresis", "payload_error:p2"
    model = plan(preset, *hidden).model
    model = replace(model, inertial=1.07 * model.inertial)  # not the CAD values
    made = identified(measurements, model, payload="p2")
    inertial = model.inertial + 1.1 * measurements.robot.payload_parameters(measurements.payloads["p2"])
    done = write(made, tmp_path / "out", ["urdf"])
    (file,) = done.files["urdf"]
    again = Robot.load(file, measurements.joints)
    np.testing.assert_allclose(again.cad_parameters, inertial, rtol=1e-12, atol=1e-13)
    np.testing.assert_array_equal(again.upper_limit, measurements.robot.upper_limit)
    given = ElementTree.parse(measurements.robot.urdf_path).getroot()
    root = ElementTree.parse(file).getroot()
    assert bare(root) == bare(given)
    comments = file.read_text(encoding="utf-8").count("<!--")
    assert comments >= measurements.robot.urdf_path.read_text().count("<!--") + 2 * measurements.robot.n
    for i, joint in enumerate(measurements.joints):
        (dynamics,) = root.findall(f"joint[@name='{joint}']/dynamics")
        dry = sum(e.parameters["coulomb"] for e in model.effects if e.joint == joint)
        viscous = model.link_viscous_friction[i] + model.motor_viscous_friction[i]
        assert float(dynamics.get("damping", "")) == pytest.approx(viscous, rel=1e-15)
        assert float(dynamics.get("friction", "")) == pytest.approx(dry, rel=1e-15)
    assert done.left_out["urdf"] == ()


def test_urdf_says_what_stays_with_the_prior(planar: MeasurementSet, tmp_path: Path) -> None:
    found = document(plan("planar-2r", "backlash").model).model_dump()
    for p in found["parameters"]:
        p["identifiable"] = {"mass": "no", "izz": "weak", "stiffness": "weak"}.get(p["name"], "yes")
    from flexviz.content.results import ResultDocument
    from flexviz.outlets.exporting import identified_robot

    made = identified_robot(planar, ResultDocument.model_validate(found))
    done = write(made, tmp_path / "out", ["urdf"])
    text = done.files["urdf"][0].read_text(encoding="utf-8")
    assert text.count("prior (near CAD): mass\n") + text.count("prior (near CAD): mass ") == 2
    assert text.count("weakly determined: izz") == 2
    assert "motor_inertia 2.45 kg m² (determined by the data)" in text
    assert "stiffness 1000.0 Nm/rad (weakly determined)" in text
    assert [line.split(":")[0] for line in done.left_out["urdf"]] == ["backlash", "backlash"]
    assert "NOT CONTAINED: backlash:joint1: a URDF" in text


def test_locked_and_fixed_links_keep_their_inertia(panda: MeasurementSet) -> None:
    model = plan("panda").model
    hand = carriers(panda.robot, model.inertial)[6]
    assert hand.link == "panda_link7" and not hand.emptied
    assert {"panda_hand", "panda_link8", "panda_leftfinger", "panda_rightfinger"} <= set(hand.others)


def test_a_link_takes_all_where_nothing_else_could_exist(panda: MeasurementSet, tmp_path: Path) -> None:
    """Lighter than what the CAD says of the other links alone."""
    model = plan("panda").model
    inertial = model.inertial.copy()
    inertial[6] *= 0.3
    made = identified(panda, replace(model, inertial=inertial))
    assert carriers(panda.robot, inertial)[6].emptied
    (file,) = write(made, tmp_path / "out", ["urdf"]).files["urdf"]
    np.testing.assert_allclose(
        Robot.load(file, panda.joints).cad_parameters, inertial, rtol=1e-12, atol=1e-13
    )
    assert "its inertia is included in panda_link7" in file.read_text(encoding="utf-8")


def test_bodies_that_cannot_exist_are_refused(planar: MeasurementSet, tmp_path: Path) -> None:
    model = plan("planar-2r").model
    inertial = model.inertial.copy()
    inertial[1, 9] = 5.0  # Izz far above Ixx + Iyy
    made = identified(planar, replace(model, inertial=inertial))
    for name in ("urdf", "mjcf"):
        with pytest.raises(InputError, match=r"of joint2 are not physically consistent: .* is -1\.\d"):
            write(made, tmp_path / "out", ["json", name])
        assert not list(tmp_path.iterdir())
    assert len(write(made, tmp_path / "out", ["json", "yaml", "c", "python"]).files) == 4


def test_meshes_of_relative_paths_come_along(tmp_path: Path) -> None:
    import trimesh

    for k, name in enumerate(("above/box.stl", "set/box.stl", "set/shapes/ball.stl")):
        (tmp_path / name).parent.mkdir(exist_ok=True, parents=True)
        trimesh.creation.box(extents=(0.1, 0.1, 0.1 + k)).export(tmp_path / name)
    names = "../above/box.stl", "box.stl", "shapes/ball.stl", "gone.stl", "package://other/away.stl"
    visuals = "".join(f'<visual><geometry><mesh filename="{n}"/></geometry></visual>' for n in names)
    urdf = URDF.replace(
        LINK.format(name="link2"), LINK.format(name="link2").replace("</link>", visuals + "</link>")
    )
    measurements = small_set(tmp_path / "set", urdf)
    done = write(identified(measurements, small_model(measurements)), tmp_path / "out", ["urdf", "mjcf"])
    root = ElementTree.parse(done.files["urdf"][0]).getroot()
    found = [mesh.get("filename") for mesh in root.iter("mesh")]
    assert found == ["meshes/box.stl", "box.stl", "shapes/ball.stl", "gone.stl", "package://other/away.stl"]
    for name, source in zip(found[:3], names, strict=False):
        assert (tmp_path / "out" / str(name)).read_bytes() == (tmp_path / "set" / source).read_bytes()
    assert any("gone.stl" in line for line in done.left_out["urdf"])
    assert any("gone.stl" in line for line in done.left_out["mjcf"])
    compiled = mujoco.MjModel.from_xml_path(str(done.files["mjcf"][0]))
    assert compiled.nmesh == 3


# -- MJCF ----------------------------------------------------------------------------------------------------


def load(made: IdentifiedRobot, folder: Path) -> Any:
    """The exported model as MuJoCo compiles it."""
    return mujoco.MjModel.from_xml_path(str(write(made, folder, ["mjcf"]).files["mjcf"][0]))


def mujoco_run(
    compiled: Any, joints: tuple[str, ...], ours: Run, velocity: Array, kp: Array, kd: Array
) -> Array:
    """θ and q (2, N, n) as MuJoCo has them under the same controller, from the same state."""
    data = mujoco.MjData(compiled)
    at_q, at_m = ([compiled.joint(j + end).qposadr[0] for j in joints] for end in ("", "_motor"))
    vq, vm = ([compiled.joint(j + end).dofadr[0] for j in joints] for end in ("", "_motor"))
    data.qpos[at_q], data.qpos[at_m] = ours.q[0], ours.theta[0]
    data.qvel[vq], data.qvel[vm] = ours.q_velocity[0], ours.theta_velocity[0]
    out = np.empty((2, *ours.theta.shape))
    steps = round(ours.torque_hold / compiled.opt.timestep)
    assert steps * compiled.opt.timestep == pytest.approx(ours.torque_hold)
    for k in range(len(ours.time)):
        out[0, k], out[1, k] = data.qpos[at_m], data.qpos[at_q]
        data.ctrl[:] = kp * (ours.theta_ref[k] - out[0, k]) + kd * (velocity[k] - data.qvel[vm])
        for _ in range(steps):
            mujoco.mj_step(compiled, data)
    return out


def worst(theirs: Array, ours: Run) -> float:
    """The largest difference of θ or q, rms relative to the rms of its motion about its mean."""
    mine = np.stack((ours.theta, ours.q))
    motion = np.sqrt(np.mean((mine - mine.mean(axis=1, keepdims=True)) ** 2, axis=1))
    return float((np.sqrt(np.mean((theirs - mine) ** 2, axis=1)) / motion).max())


def compared(made: IdentifiedRobot, folder: Path, preset: str, duration: float, group: int = 0) -> float:
    """`worst` for a preset's own motion and controller."""
    scene = make_plan(preset)
    reference, controller = scene.groups[group].reference, scene.controller
    ours = simulate_run(
        scene.robot, made.model, payload=made.bodies, payload_name=made.payload, reference=reference,
        controller=controller, duration=duration,
    )  # fmt: skip
    velocity = reference.sample(ours.time)[1]
    compiled = load(made, folder)
    return worst(mujoco_run(compiled, made.joints, ours, velocity, controller.kp, controller.kd), ours)


def test_identified_motion_in_mujoco(tmp_path: Path) -> None:
    """The whole way: identify, export, load, and drive both along the recorded reference."""
    measurements = read_set(sessions_dir() / "planar-2r-demo")
    found = identify(measurements, effects=["coulomb_friction"], refine=False)
    from flexviz.outlets.exporting import identified_robot

    made = identified_robot(measurements, found)
    group = measurements.groups[1]
    first = group.segments[0]
    cut = {name: getattr(first, name)[:2001] for name in ("time", "theta", "tau")}
    short = replace(group, segments=(replace(first, **cut),))
    kp, kd = measurements.kp, measurements.kd
    assert kp is not None and kd is not None
    carried = identified_robot(measurements, found, payload=group.payload)
    ours = replay(measurements.robot, made.model, short, kp, kd, torque_hold=measurements.torque_hold)
    assert ours.facts[0].values["loop"] == "closed"
    hold = measurements.torque_hold
    time = np.arange(round(ours.time[-1] / hold)) * hold
    wanted = group.at("theta_ref", short.segments[0].time)
    assert wanted is not None
    position, velocity = Sampled(short.segments[0].time, wanted).sample(time)
    every = round(short.segments[0].step / hold)
    fine = replace(
        ours, time=time, theta_ref=position, torque_hold=hold,
        **{name: np.repeat(getattr(ours, name), every, axis=0)[: len(time)] for name in ("theta", "q")},
    )  # fmt: skip
    compiled = load(carried, tmp_path / "out")
    theirs = mujoco_run(compiled, measurements.joints, fine, velocity, kp, kd)[:, ::every]
    rows = theirs.shape[1]
    assert worst(theirs, replace(ours, theta=ours.theta[:rows], q=ours.q[:rows])) < PERCENT


def test_effects_with_a_place_move_alike(planar: MeasurementSet, tmp_path: Path) -> None:
    made = identified(planar, plan("planar-2r", *EXACT).model, payload="p2")
    assert compared(made, tmp_path / "out", "planar-2r", 1.0) < 1e-7


@pytest.mark.parametrize("effect", NEARLY)
def test_effects_with_nearly_a_place(effect: str, planar: MeasurementSet, tmp_path: Path) -> None:
    made = identified(planar, plan("planar-2r", effect).model)
    assert write(made, tmp_path / "all", ["mjcf"]).left_out["mjcf"] == ()
    near = compared(made, tmp_path / "out", "planar-2r", 1.0)
    assert near < 0.5 * PERCENT


def test_panda(panda: MeasurementSet, tmp_path: Path) -> None:
    made = identified(panda, plan("panda", "stiffness_hardening:panda_joint2").model, payload="p3")
    assert compared(made, tmp_path / "out", "panda", 0.6, group=2) < 1e-6


def test_mjcf_read_again_gives_the_same(panda: MeasurementSet, tmp_path: Path) -> None:
    model = plan("panda", "coulomb_friction", "backlash", "stiffness_hardening", "torque_gain").model
    made = identified(panda, model)
    compiled = load(made, tmp_path / "out")
    for i, joint in enumerate(panda.joints):
        link, motor = compiled.joint(joint), compiled.joint(f"{joint}_motor")
        tendon, actuator = compiled.tendon(f"{joint}_elastic"), compiled.actuator(joint)
        assert compiled.dof_armature[motor.dofadr[0]] == model.motor_inertia[i]
        assert compiled.dof_damping[motor.dofadr[0]] == model.motor_viscous_friction[i]
        assert compiled.dof_damping[link.dofadr[0]] == model.link_viscous_friction[i]
        values = {e.effect: e.parameters for e in model.effects if e.joint == joint}
        assert compiled.dof_frictionloss[motor.dofadr[0]] == values["coulomb_friction"]["coulomb"]
        assert compiled.tendon_stiffness[tendon.id] == model.stiffness[i]
        cubic = values["stiffness_hardening"]["cubic_stiffness"]
        np.testing.assert_array_equal(compiled.tendon_stiffnesspoly[tendon.id], [0.0, cubic])
        half = values["backlash"]["half_width"]
        np.testing.assert_array_equal(compiled.tendon_lengthspring[tendon.id], [-half, half])
        assert actuator.gainprm[0] == 1 + values["torque_gain"]["gain_error"]
    # the links' inertias, by the mass matrix at a pose
    data = mujoco.MjData(compiled)
    q = np.linspace(-0.8, 0.4, 7)
    data.qpos[[compiled.joint(j).qposadr[0] for j in panda.joints]] = q
    mujoco.mj_forward(compiled, data)
    mass = np.zeros((compiled.nv, compiled.nv))
    mujoco.mj_fullM(compiled, data, mass)
    at = [compiled.joint(j).dofadr[0] for j in panda.joints]
    from flexviz.robot._pinocchio import pin

    pinocchio = panda.robot.model_with(model.inertial)
    expected = pin.crba(pinocchio, pinocchio.createData(), q)
    expected = np.triu(expected) + np.triu(expected, 1).T
    np.testing.assert_allclose(mass[np.ix_(at, at)], expected, atol=1e-7)


def test_a_torque_limit_is_the_force_range_of_the_actuator(planar: MeasurementSet, tmp_path: Path) -> None:
    limit = EffectValue("torque_limit", planar.joints[1], {"limit": 12.5})
    model = plan("planar-2r").model
    compiled = load(identified(planar, replace(model, effects=(*model.effects, limit))), tmp_path / "out")
    assert not compiled.actuator_forcelimited[compiled.actuator(planar.joints[0]).id]
    at = compiled.actuator(planar.joints[1]).id
    assert compiled.actuator_forcelimited[at] and list(compiled.actuator_forcerange[at]) == [-12.5, 12.5]


def test_what_mjcf_has_no_place_for_is_said(planar: MeasurementSet, tmp_path: Path) -> None:
    hidden = [*NOT_IN_MJCF, "coulomb_friction", "presliding_hysteresis", "external_contact"]
    model = plan("planar-2r", *hidden).model
    early = EffectValue("torque_delay", None, {"delay": -0.001})
    made = identified(planar, replace(model, effects=(*model.effects, early)))
    done = write(made, tmp_path / "out", ["mjcf"])
    named = {line.split(":")[0] for line in done.left_out["mjcf"]}
    assert named == {*NOT_IN_MJCF, "presliding_hysteresis", "external_contact", "torque_delay"}
    text = done.files["mjcf"][0].read_text(encoding="utf-8")
    assert all(f"NOT CONTAINED: {name}" in text for name in named)
    compiled = mujoco.MjModel.from_xml_path(str(done.files["mjcf"][0]))
    sliding = made.laws["motor_coulomb"] + [coulomb for _, _, coulomb in made.laws.rows["presliding"]]
    at = [compiled.joint(f"{j}_motor").dofadr[0] for j in planar.joints]
    np.testing.assert_array_equal(compiled.dof_frictionloss[at], sliding)


def test_the_time_step_follows_the_stiffest_joint(planar: MeasurementSet) -> None:
    model = plan("planar-2r").model
    soft, slow = timestep(identified(planar, model))
    hard, fast = timestep(identified(planar, replace(model, stiffness=np.array([1000.0, 1e9]))))
    assert soft == planar.torque_hold == 0.00025 and soft * slow < 0.3
    assert 0.15 < hard * fast <= 0.3 and np.log2(soft / hard) == round(np.log2(soft / hard)) > 0


def test_names_that_are_taken(tmp_path: Path) -> None:
    urdf = URDF.replace("joint2", "joint1_motor").replace('"base"', '"world"')
    write_small_set(tmp_path / "set")
    for file in ("robot.urdf", "measurements.toml", "a.csv", "sub/c.csv"):
        path = tmp_path / "set" / file
        path.write_text(
            (urdf if file == "robot.urdf" else path.read_text()).replace("joint2", "joint1_motor")
        )
    import pyarrow.parquet as papq

    table = papq.read_table(tmp_path / "set/b.parquet")
    names = [name.replace("joint2", "joint1_motor") for name in table.column_names]
    papq.write_table(table.rename_columns(names), tmp_path / "set/b.parquet")
    measurements = read_set(tmp_path / "set")
    model = replace(small_model(measurements), joints=measurements.joints)
    compiled = load(identified(measurements, model), tmp_path / "out")
    assert {compiled.joint(k).name for k in range(compiled.njnt)} == {
        "joint1", "joint1_motor", "joint1_motor_", "joint1_motor_motor",
    }  # fmt: skip
