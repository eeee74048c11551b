"""Generated C and Python code against Pinocchio and the library's own laws."""

from __future__ import annotations

import ctypes
import importlib.util
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from numpy.typing import NDArray

from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS, LawEffect, forget_effects, load_effects
from flexviz.outlets.exporting import FORMATS, IdentifiedRobot
from flexviz.outlets.exporting.code import c_code, python_code, section_names, with_sections
from flexviz.outlets.exporting.code_tables import code_tables
from flexviz.outlets.exporting.parameters import json_parameters
from flexviz.robot.model import EffectValue
from flexviz.robot.robot import Robot
from tests.exporting_cases import (
    deflections,
    differentiated,
    identified,
    library_link_torque,
    library_motor_torque,
    motion,
    plan,
    seen,
    short_set,
)

Array = NDArray[np.float64]
GCC = shutil.which("gcc")
needs_gcc = pytest.mark.skipif(GCC is None, reason="gcc is not installed")
EXACT = 1e-9
# every effect that is a torque on the motor, or that only shifts it; the others have tests of their own
MOTOR = (
    "coulomb_friction", "stribeck_friction", "quadratic_friction", "directional_friction",
    "thinning_friction",
    "load_dependent_friction",
    "driving_friction",
    "friction_drift", "torque_ripple", "torque_offset", "torque_gain", "stiffness_hardening",
    "transmission_error", "base_tilt", "motor_coupling", "coupled_friction",
    "presliding_hysteresis",
)  # fmt: skip
LINK = ("link_coulomb_friction", "cable_spring", "gravity_compensator")
CHECKED = {
    *MOTOR, *LINK, "payload_error", "backlash", "joint_damping", "torque_delay",
}  # fmt: skip


@dataclass
class Calculated:
    """What the code says, (N, n) each."""

    tau: Array
    theta: Array
    theta_velocity: Array
    tau_joint: Array
    rigid: Array
    link: Array


Run = Callable[[IdentifiedRobot, Path, Array, Array | float, bool], Calculated]


@pytest.fixture(scope="module")
def planar(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    return short_set("planar-2r", tmp_path_factory.mktemp("planar"))


@pytest.fixture(scope="module")
def panda(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    return short_set("panda", tmp_path_factory.mktemp("panda"))


def module_of(made: IdentifiedRobot, folder: Path) -> ModuleType:
    """The exported Python, imported by itself."""
    ((name, content),) = python_code(made).contents.items()
    (folder / name).write_bytes(content)
    spec = importlib.util.spec_from_file_location(f"exported_{abs(hash(folder))}", folder / name)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def run_python(
    made: IdentifiedRobot, folder: Path, q: Array, time: Array | float, remember: bool
) -> Calculated:
    module = module_of(made, folder)
    memory = [module.Memory() if remember else None for _ in range(2)]
    out = module.inverse_dynamics(*q, time=time, memory=memory[0])
    rigid = module.rigid_inverse_dynamics(*q[:3], time=time, memory=memory[1])
    link = module.link_torque(*q[:3])
    return Calculated(out.tau, out.theta, out.theta_velocity, out.tau_joint, rigid, link)


STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")


def sources_of(made: IdentifiedRobot, folder: Path) -> Path:
    """The exported C, written to `folder`."""
    folder.mkdir(exist_ok=True)
    for name, content in c_code(made).contents.items():
        (folder / name).write_bytes(content)
    return folder / f"{made.name}_dynamics.c"


def run_c(made: IdentifiedRobot, folder: Path, q: Array, time: Array | float, remember: bool) -> Calculated:
    """The exported C, compiled without a warning, called as another program would."""
    n, count, name = made.robot.n, len(q[0]), made.name
    compiled = folder / f"{len(list(folder.iterdir()))}.so"  # one of the same name would not be loaded again
    command = [
        str(GCC),
        *STRICT,
        "-O1",
        "-shared",
        "-fPIC",
        "-o",
        compiled,
        sources_of(made, folder),
        "-lm",
    ]
    subprocess.run(command, check=True)
    library = ctypes.CDLL(str(compiled))

    class Memory(ctypes.Structure):
        _fields_ = [
            (key, ctypes.c_double * n if k else ctypes.c_int) for k, key in enumerate(("on", "at", "s"))
        ]

    out, rigid, link = np.empty((count, 4, n)), np.empty((count, n)), np.empty((count, n))
    times = np.broadcast_to(np.asarray(time, dtype=float), count).tolist()
    memory = [Memory(on=7), Memory(on=7)]
    for one in memory:
        library[f"{name}_reset"](ctypes.byref(one))
    given = [ctypes.byref(one) if remember else None for one in memory]
    inverse, stiff = library[f"{name}_inverse_dynamics"], library[f"{name}_rigid_inverse_dynamics"]
    q = np.ascontiguousarray(q)
    row = 8 * n  # bytes

    def place(array: Array, k: int, width: int = 1) -> ctypes.c_void_p:
        return ctypes.c_void_p(array.ctypes.data + k * width * row)

    for k in range(count):
        state = [place(q, d * count + k) for d in range(5)]
        at = ctypes.c_double(times[k])
        inverse(*state, at, given[0], place(out, k, 4))
        stiff(*state[:3], at, given[1], place(rigid, k))
        library[f"{name}_link_torque"](*state[:3], place(link, k))
    return Calculated(out[:, 0], out[:, 1], out[:, 2], out[:, 3], rigid, link)


LANGUAGES = [pytest.param(run_python, id="python"), pytest.param(run_c, id="c", marks=needs_gcc)]


def check(made: IdentifiedRobot, folder: Path, run: Run, *, remember: bool = False) -> Calculated:
    """Compare with the library along a periodic motion, without asking for a derivative of the code's own."""
    time, q = motion(made.robot.n)
    found = run(made, folder, q, time, remember)
    load = library_link_torque(made, q)
    scale = np.abs(load).max()
    np.testing.assert_allclose(found.tau_joint, load, atol=EXACT * scale)
    np.testing.assert_allclose(found.link, load, atol=EXACT * scale)
    gear = np.zeros_like(load)
    for effect in made.model.effects:
        if effect.effect == "transmission_error":
            i = made.joints.index(str(effect.joint))
            at = seen(made.model, i, time, q, np.stack([found.theta] * 3), load)
            law, values = EFFECTS["transmission_error"], np.array(list(effect.parameters.values()))
            assert isinstance(law, LawEffect)
            gear[:, i] += law.law(at, values)[0]
    np.testing.assert_allclose(found.theta + gear, q[0] + deflections(made, load), atol=EXACT)
    theta = np.stack([found.theta, differentiated(found.theta, 1), differentiated(found.theta, 2)])
    np.testing.assert_allclose(found.theta_velocity, theta[1], atol=EXACT * 10)
    torque = library_motor_torque(made, time, q, theta, load)
    np.testing.assert_allclose(found.tau, torque, atol=EXACT * np.abs(torque).max())
    rigid = library_motor_torque(made, time, q, q[:3], load)
    np.testing.assert_allclose(found.rigid, rigid, atol=EXACT * np.abs(rigid).max())
    return found


@pytest.mark.parametrize("run", LANGUAGES)
def test_base_model(run: Run, planar: MeasurementSet, tmp_path: Path) -> None:
    made = identified(planar, plan("planar-2r").model)
    check(made, tmp_path, run)
    assert section_names(c_code(made).contents["planar_2r_dynamics.c"].decode()) == set()


@pytest.mark.parametrize("effect", MOTOR)
def test_each_effect_in_python(effect: str, planar: MeasurementSet, tmp_path: Path) -> None:
    model = plan("planar-2r", effect).model
    check(identified(planar, model), tmp_path, run_python, remember=effect == "presliding_hysteresis")


@needs_gcc
def test_many_effects_in_c(panda: MeasurementSet, tmp_path: Path) -> None:
    hidden = [f"{effect}:panda_joint{1 + k % 6}" for k, effect in enumerate(MOTOR) if effect != "base_tilt"]
    model = plan("panda", "base_tilt", *hidden).model
    check(identified(panda, model), tmp_path, run_c, remember=True)


@needs_gcc
def test_c_and_python_agree_with_everything_on(planar: MeasurementSet, tmp_path: Path) -> None:
    everything = [name for name in EFFECTS if name not in ("payload_error", "external_contact")]
    made = identified(planar, plan("planar-2r", *everything).model)
    time, q = motion(2)
    c, python = (run(made, tmp_path, q, time, True) for run in (run_c, run_python))
    for name in ("tau", "theta", "theta_velocity", "tau_joint", "rigid", "link"):
        one, other = getattr(c, name), getattr(python, name)
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12 * np.abs(other).max())
    assert set(code_tables(made).sections) >= section_names(
        (Path(__file__).parents[2] / "flexviz/outlets/exporting/template.c").read_text()
    )


@needs_gcc
def test_c_with_one_effect_has_what_it_needs(planar: MeasurementSet, tmp_path: Path) -> None:
    """Each alone and on one joint: nothing is missing, and nothing is there that is not used."""
    sources = []
    for effect in (name for name in EFFECTS if name not in ("payload_error", "external_contact")):
        model = plan("planar-2r", effect).model
        there = tuple(e for e in model.effects if e.joint in (None, "joint2"))
        one = replace(model, effects=there or model.effects)
        sources.append(sources_of(identified(planar, one), tmp_path / effect))
    run = subprocess.run([str(GCC), *STRICT, "-fsyntax-only", *sources], capture_output=True, text=True)
    assert run.returncode == 0 and run.stderr == "", run.stderr


def test_sliding_joints_in_another_order(panda: MeasurementSet, tmp_path: Path) -> None:
    joints = [
        *(f"panda_joint{k}" for k in (3, 1, 2, 4, 5, 7, 6)),
        "panda_finger_joint2",
        "panda_finger_joint1",
    ]
    robot = Robot.load("example-robot-data:panda", joints)
    ones = np.linspace(1.0, 2.0, 9)
    base = plan("panda").model
    model = replace(
        base, joints=robot.joints, stiffness=3000 * ones, motor_inertia=ones, link_viscous_friction=ones,
        motor_viscous_friction=ones, inertial=robot.cad_parameters,
    )  # fmt: skip
    measurements = replace(panda, robot=robot, joints=robot.joints)
    check(identified(measurements, model), tmp_path, run_python)


@pytest.mark.parametrize("run", LANGUAGES)
def test_payload_is_carried_as_found(run: Run, planar: MeasurementSet, tmp_path: Path) -> None:
    wrong = EffectValue("payload_error", None, {"relative_mass_error": 0.3}, payload="p2")
    other = EffectValue("payload_error", None, {"relative_mass_error": 0.5}, payload="p3")
    model = replace(plan("planar-2r").model, effects=(wrong, other))
    made = identified(planar, model, payload="p2")
    mass = sum(body.mass for body in planar.payloads["p2"])
    assert sum(body.mass for body in made.laws.bodies) == pytest.approx(1.3 * mass) and mass > 0
    assert [line.split(": ")[0] for line in c_code(made).left_out] == ["payload_error:p3"]
    check(made, tmp_path, run)


@pytest.mark.parametrize("run", LANGUAGES)
def test_springs_and_dry_friction_of_the_link(run: Run, planar: MeasurementSet, tmp_path: Path) -> None:
    """Friction of the link is in torque and position; its jump is kept from their derivatives."""
    made = identified(planar, plan("planar-2r", *LINK).model)
    time, q = motion(2)
    found = run(made, tmp_path, q, time, False)
    model = made.model
    smooth, dry = library_link_torque(made, q), np.zeros_like(q[0])
    for effect in model.effects:
        i, values = model.joints.index(str(effect.joint)), list(effect.parameters.values())
        if effect.effect == "cable_spring":
            smooth[:, i] += values[0] * (q[0][:, i] - values[1])
        elif effect.effect == "gravity_compensator":
            smooth[:, i] += values[0] * np.sin(q[0][:, i]) + values[1] * np.cos(q[0][:, i])
        else:
            law = EFFECTS[effect.effect]
            assert isinstance(law, LawEffect)
            dry[:, i] += law.law(seen(model, i, time, q, q[:3], smooth), np.array(values))[0]
    bent = smooth / model.stiffness
    theta = [q[0] + bent, q[1] + differentiated(bent, 1), q[2] + differentiated(bent, 2)]
    np.testing.assert_allclose(found.tau_joint, smooth + dry, atol=EXACT * np.abs(smooth).max())
    np.testing.assert_allclose(found.theta, theta[0] + dry / model.stiffness, atol=EXACT)
    np.testing.assert_allclose(found.theta_velocity, theta[1], atol=10 * EXACT)
    torque = library_motor_torque(made, time, q, np.stack(theta), smooth + dry)
    np.testing.assert_allclose(found.tau, torque, atol=EXACT * np.abs(torque).max())
    # the exact derivatives of the sign would ask for hundreds of times more
    assert np.abs(found.tau).max() < 2 * np.abs(smooth).max()


@pytest.mark.parametrize("run", LANGUAGES)
def test_backlash_moves_the_position_only(run: Run, planar: MeasurementSet, tmp_path: Path) -> None:
    model = plan("planar-2r", "backlash").model
    with_play = identified(planar, model)
    time, q = motion(2)
    without = check(identified(planar, replace(model, effects=())), tmp_path, run)
    found = run(with_play, tmp_path, q, time, False)
    play = np.array([e.parameters["half_width"] for e in model.effects])
    np.testing.assert_allclose(found.theta - without.theta, play * np.sign(found.tau_joint), atol=EXACT)
    np.testing.assert_allclose(found.tau, without.tau, atol=EXACT * 100)
    assert len(np.unique(np.sign(found.tau_joint[:, 1]))) == 2


@pytest.mark.parametrize("run", LANGUAGES)
def test_joint_damping_is_as_good_as_it_says(run: Run, planar: MeasurementSet, tmp_path: Path) -> None:
    made = identified(planar, plan("planar-2r", "joint_damping").model)
    time, q = motion(2)
    found = run(made, tmp_path, q, time, False)
    load, k = library_link_torque(made, q), made.laws["stiffness"]
    spectrum = np.fft.rfft(load, axis=0)
    omega = 2j * np.pi * np.arange(len(spectrum)) / time[1] / len(time)
    bent = np.fft.irfft(spectrum / (k + made.laws["damping"] * omega[:, None]), len(load), axis=0)
    lag = made.laws["damping"] / k
    left = np.abs(lag**3 * differentiated(load, 3) / k).max()
    np.testing.assert_allclose(found.theta, q[0] + bent, atol=1.2 * left)
    theta = np.stack([q[0] + bent, q[1] + differentiated(bent, 1), q[2] + differentiated(bent, 2)])
    torque = library_motor_torque(made, time, q, theta, load)
    neglected = np.abs(made.laws["motor_inertia"] * lag * differentiated(bent, 3)).max()
    assert np.abs(found.tau - torque).max() < 1.3 * neglected < 0.02 * np.abs(torque).max()


def test_presliding_without_memory_slides_at_once(planar: MeasurementSet, tmp_path: Path) -> None:
    model = plan("planar-2r", "presliding_hysteresis").model
    coulomb = tuple(
        EffectValue("coulomb_friction", e.joint, {"coulomb": e.parameters["coulomb"]}) for e in model.effects
    )
    time, q = motion(2)
    found = run_python(identified(planar, model), tmp_path, q, time, False)
    sliding = run_python(identified(planar, replace(model, effects=coulomb)), tmp_path, q, time, False)
    np.testing.assert_array_equal(found.tau, sliding.tau)


def test_what_the_code_cannot_hold_is_said(planar: MeasurementSet) -> None:
    made = identified(planar, plan("planar-2r", "external_contact", "torque_delay").model)
    for export in (c_code, python_code):
        files, missing = export(made).contents, export(made).left_out
        assert len(missing) == 1 and missing[0].startswith("external_contact:joint2@")
        text = " ".join(list(files.values())[-1].decode().replace("\n * ", " ").split())
        assert f"NOT CONTAINED: {missing[0][:40]}" in text and "Torque delay: evaluate" in text


def test_user_defined_effects_are_named(planar: MeasurementSet) -> None:
    load_effects(Path(__file__).parents[2] / "examples" / "user_effects.py")
    try:
        own = EffectValue("cubic_friction", "joint1", {"cubic": 0.8})
        made = identified(planar, replace(plan("planar-2r").model, effects=(own,)))
        for export in FORMATS.values():
            found = export(made)
            assert found.contents and all(
                line.startswith("cubic_friction:joint1: a user-defined effect") for line in found.left_out
            )
        assert "cubic_friction" in json_parameters(made).contents["parameters.json"].decode()
    finally:
        forget_effects()


def test_delay_is_a_number_of_the_code(planar: MeasurementSet, tmp_path: Path) -> None:
    module = module_of(identified(planar, plan("planar-2r", "torque_delay").model), tmp_path)
    np.testing.assert_array_equal(module.TORQUE_DELAY, [0.002, 0.002])


def test_shapes_of_python(planar: MeasurementSet, tmp_path: Path) -> None:
    module = module_of(identified(planar, plan("planar-2r").model), tmp_path)
    _, q = motion(2)
    many, one = module.inverse_dynamics(*q[:, :3]), module.inverse_dynamics(*q[:, 1])
    assert many.tau.shape == (3, 2) and one.tau.shape == (2,) and one.theta.shape == (2,)
    np.testing.assert_allclose(many.tau[1], one.tau, rtol=1e-13)
    with pytest.raises(ValueError, match=r"expected \(2,\) or \(N, 2\)"):
        module.inverse_dynamics(*np.zeros((5, 3)))


def test_python_needs_numpy_only(planar: MeasurementSet, tmp_path: Path) -> None:
    module_of(identified(planar, plan("planar-2r", "coulomb_friction").model), tmp_path)
    program = (
        "import sys, planar_2r_dynamics as m; print(m.link_torque([0, 0], [0, 0], [0, 0])); "
        "assert not {'flexviz', 'pinocchio', 'scipy'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", program], cwd=tmp_path, check=True, capture_output=True)


def test_the_pattern_itself_runs() -> None:
    from flexviz.outlets.exporting import template

    rest = template.rigid_inverse_dynamics([0.3, -0.2], [0.0, 0.0], [0.0, 0.0])
    memory = template.Memory()
    slow = template.inverse_dynamics(
        [0.3, -0.2], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], memory=memory
    )
    np.testing.assert_allclose(slow.tau_joint, template.link_torque([0.3, -0.2], [0, 0], [0, 0]))
    assert np.abs(slow.tau - rest).max() < 1.0  # the ripple sees another angle


def test_sections() -> None:
    text = "a\n/* [one */\nb\n# [two\nc\n# two]\n/* one] */\nd # [not a mark\n"
    assert with_sections(text, ()) == "a\nd # [not a mark\n"
    assert with_sections(text, ("one",)) == "a\nb\nd # [not a mark\n"
    assert with_sections(text, ("one", "two")) == "a\nb\nc\nd # [not a mark\n"
    assert with_sections(text, ("two",)) == "a\nd # [not a mark\n"
    assert section_names(text) == {"one", "two"}
    for broken in ("# [one\n", "# one]\n", "# [one\n# two]\n"):
        with pytest.raises(AssertionError):
            with_sections(broken, ())
