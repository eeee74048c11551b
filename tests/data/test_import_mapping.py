"""Mapping files: what they mean, and one line for everything in them or in a log that is not right."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pytest
from import_data import message, motor_messages, truth, write_lerobot, write_mapping, write_mcap, write_robot

from flexviz.base.errors import InputError
from flexviz.data.importing import import_logs, read_mapping
from flexviz.data.measurements import read_set
from flexviz.outlets.terminal import main

DATA = truth(rows=600)
SIMPLE = """format = 1
robot = "robot.urdf"
[time]
column = "t"
[[logs]]
file = "run.csv"
group = "g1"
[joints.joint1]
theta = "p1"
tau = "m1"
[joints.joint2]
theta = "p2"
tau = "m2"
"""


@pytest.fixture(autouse=True)
def no_delay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flexviz.data.importing.importing.torque_delay", lambda *_: None)


def write(folder: Path, mapping: str = SIMPLE, **changed: np.ndarray) -> Path:
    """A mapping, its robot and its log; `changed` are columns of the log."""
    write_robot(folder)
    table = {"t": DATA.time}
    for j in range(2):
        table |= {f"p{j + 1}": DATA.theta[:, j], f"m{j + 1}": DATA.tau[:, j], f"q{j + 1}": DATA.q[:, j]}
    pacsv.write_csv(pa.table(table | changed), folder / "run.csv")
    (folder / "mapping.toml").write_text(mapping)
    return folder / "mapping.toml"


def test_everything_is_undone(tmp_path: Path) -> None:
    """Counts and amperes of the motor, turned round and with an offset, become rad and Nm of the joint."""
    gear, constant, counts = 101.0, 0.12, 2 * np.pi / 4096
    mapping = SIMPLE.replace(
        'theta = "p1"\ntau = "m1"\n',
        f"gear = {gear}\ntorque_constant = {constant}\n"
        f'theta = {{ from = "p1", unit = {counts}, side = "motor", sign = -1, offset = 0.3 }}\n'
        'tau = { from = "m1", unit = "mA", side = "motor", sign = -1 }\n'
        'q = { from = "q1", unit = "rev" }\n'
        'tau_joint = { from = "k1", unit = "kNm" }\n'
        'theta_ref = { from = "r1", unit = "mrad" }\n',
    )
    changed = {
        "p1": -(DATA.theta[:, 0] - 0.3) * gear / counts,
        "m1": -DATA.tau[:, 0] / gear / constant * 1e3,
        "q1": DATA.q[:, 0] / (2 * np.pi),
        "k1": 1.1e-3 * DATA.tau[:, 0],
        "r1": 1.02e3 * DATA.q[:, 0],
    }
    file = write(tmp_path, mapping, **changed)
    done = import_logs(file, None, accept=True)
    table = done.groups[0].table
    assert np.allclose(table.theta, DATA.theta, atol=1e-12) and np.allclose(table.tau, DATA.tau, atol=1e-11)
    assert table.q is not None and np.allclose(table.q[:, 0], DATA.q[:, 0]) and np.isnan(table.q[:, 1]).all()
    assert table.tau_joint is not None and np.allclose(table.tau_joint[:, 0], 1.1 * DATA.tau[:, 0])
    assert table.theta_ref is not None and np.allclose(table.theta_ref[:, 0], 1.02 * DATA.q[:, 0])


def test_a_negative_gear_turns_the_other_way(tmp_path: Path) -> None:
    keys = 'gear = -50.0\ntheta = { from = "p1", side = "motor" }\ntau = { from = "m1", side = "motor" }\n'
    mapping = SIMPLE.replace('theta = "p1"\ntau = "m1"\n', keys)
    file = write(tmp_path, mapping, p1=-50 * DATA.theta[:, 0], m1=-DATA.tau[:, 0] / 50)
    done = import_logs(file, None)
    assert not done.issues
    assert np.allclose(done.groups[0].table.theta, DATA.theta) and np.allclose(
        done.groups[0].table.tau, DATA.tau
    )


COUPLED = """[coupling]
joints = ["joint2", "joint1"]
matrix = [[1.0, -0.5], [0.0, 1.0]]
"""


def test_a_coupling_conserves_power(tmp_path: Path) -> None:
    """Joint angles are the matrix times the motors', torques follow from equal power; offsets come last."""
    gears, drive = np.array([50.0, -80.0]), np.array([[1.0, 0.0], [-0.5, 1.0]])
    motor_theta = (DATA.theta - [0.2, 0.0]) @ np.linalg.inv(drive).T * gears
    motor_tau = DATA.tau @ drive / gears
    speed, motor_speed = (np.gradient(x, DATA.time, axis=0) for x in (DATA.theta, motor_theta))
    np.testing.assert_allclose(
        np.sum(motor_tau * motor_speed, axis=1), np.sum(DATA.tau * speed, axis=1), atol=1e-9
    )
    mapping = SIMPLE.replace("[joints.joint1]", COUPLED + "[joints.joint1]")
    for j, gear in enumerate(gears, start=1):
        offset = ", offset = 0.2" if j == 1 else ""
        mapping = mapping.replace(f'theta = "p{j}"', f'theta = {{ from = "p{j}", side = "motor"{offset} }}')
        mapping = mapping.replace(
            f'tau = "m{j}"', f'tau = {{ from = "m{j}", side = "motor" }}\ngear = {gear}'
        )
    columns = {
        f"{name}{j + 1}": x[:, j] for name, x in (("p", motor_theta), ("m", motor_tau)) for j in (0, 1)
    }
    done = import_logs(write(tmp_path, mapping, **columns), None)
    assert not done.issues
    table = done.groups[0].table
    assert np.allclose(table.theta, DATA.theta) and np.allclose(table.tau, DATA.tau)


def test_groups_payloads_and_what_the_set_says(tmp_path: Path) -> None:
    top = """torque_hold = 0.002
[initial]
stiffness = [2000.0, 1500.0]
[controller]
kp = [10.0, 6.0]
kd = [5.0, 2.0]
[model]
effects = ["coulomb_friction"]
[payloads.p2]
bodies = [{ link = "link2", mass = 2.0, com = [0.3, 0, 0], inertia = [0.004, 0.004, 0.004, 0, 0, 0] }]
[[logs]]
file = "run.csv"
group = "held-out"
trajectory = "t1"
payload = "p2"
validation = true
from = 0.2
to = 0.6
"""
    mapping = SIMPLE.replace('robot = "robot.urdf"\n', 'robot = "robot.urdf"\n' + top)
    file = write(tmp_path, mapping, t=5.0 + DATA.time)  # from and to count from the first sample
    done = import_logs(file, tmp_path / "set", table_format="csv")
    measurements = read_set(tmp_path / "set")
    assert done.folder == tmp_path / "set" and [g.name for g in measurements.groups] == ["held-out", "g1"]
    held, whole = measurements.groups
    assert held.validation and held.trajectory == "t1" and held.bodies[0].mass == 2.0
    assert whole.trajectory == "g1" and whole.payload == "none" and not whole.bodies
    chosen = (DATA.time >= 0.2) & (DATA.time <= 0.6)
    assert np.array_equal(held.segments[0].theta, DATA.theta[chosen]) and held.time[0] == 0.0
    assert done.groups[0].notes == ("the part from time stamp 5.2 to 5.6 s is used",)
    assert measurements.torque_hold == 0.002 and measurements.effects == ("coulomb_friction",)
    assert measurements.kp is not None and measurements.initial_stiffness is not None
    assert (tmp_path / "set" / "robot.urdf").is_file() and held.file.suffix == ".csv"


def test_meshes_come_along(tmp_path: Path) -> None:
    file = write(tmp_path)
    (tmp_path / "mesh dir").mkdir()
    (tmp_path / "mesh dir" / "a.stl").write_bytes(b"solid a\nendsolid a\n")
    mesh = '<visual><geometry><mesh filename="{}"/></geometry></visual>'
    urdf = (tmp_path / "robot.urdf").read_text()
    both = mesh.format("mesh dir/a.stl") + mesh.format("package://gone/b.stl")
    both += mesh.format("package://gone/c.stl") + mesh.format("file:///etc/passwd")
    (tmp_path / "robot.urdf").write_text(
        urdf.replace('<link name="base"/>', f'<link name="base">{both}</link>')
    )
    done = import_logs(file, tmp_path / "set")
    assert (tmp_path / "set" / "meshes" / "a.stl").read_bytes().startswith(b"solid a")
    assert 'filename="meshes/a.stl"' in (tmp_path / "set" / "robot.urdf").read_text()
    (warning,) = done.warnings
    assert warning.values["count"] == 3 and "gone/b.stl" in warning.values["first"]
    assert [file.name for file in (tmp_path / "set" / "meshes").iterdir()] == ["a.stl"]


def test_no_two_results(tmp_path: Path) -> None:
    """A set that is there is not touched, and a name that is taken is refused before any work."""
    file = write(tmp_path)
    import_logs(file, tmp_path / "set")
    before = sorted((tmp_path / "set").iterdir())
    with pytest.raises(InputError, match="already there"):
        import_logs(file, tmp_path / "set")
    assert sorted((tmp_path / "set").iterdir()) == before


def swap(old: str, new: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        assert old in text
        return text.replace(old, new)

    return change


BAD = {
    "unknown key": (
        swap("robot =", "rabot ="),
        r'mapping\.toml, rabot: unknown key "rabot"; did you mean "robot"',
    ),
    "key of a joint": (
        swap('tau = "m1"', 'tau = "m1"\nratio = 3'),
        r"joints\.joint1\.ratio: unknown key .*gear",
    ),
    "key of a signal": (
        swap('"p1"', '{ from = "p1", units = "deg" }'),
        r'joints\.joint1\.theta\.units: unknown key "units"; did you mean "unit"',
    ),
    "unit": (
        swap('"p1"', '{ from = "p1", unit = "degr" }'),
        r'joint1\.theta\.unit: found "degr".*did you mean "deg"',
    ),
    "unit of a torque": (
        swap('"m1"', '{ from = "m1", unit = "rad" }'),
        r"joint1\.tau\.unit: found \"rad\".*mNm",
    ),
    "size of a unit": (swap('"p1"', '{ from = "p1", unit = -1.0 }'), r"joint1\.theta\.unit: found -1\.0"),
    "side": (
        swap('"p1"', '{ from = "p1", side = "gear" }'),
        r'joint1\.theta\.side: found "gear", expected "joint" or "motor"',
    ),
    "sign": (swap('"p1"', '{ from = "p1", sign = 2 }'), r"joint1\.theta\.sign: found 2, expected 1 or -1"),
    "side without gear": (
        swap('"p1"', '{ from = "p1", side = "motor" }'),
        r"joints\.joint1: theta is before the gear, expected gear \(motor turns per joint turn; 1\.0",
    ),
    "coupling of nothing": (
        swap("[time]", COUPLED + "[time]"),
        r'mapping\.toml, coupling: no signal of joint2, joint1 has side = "motor"',
    ),
    "coupling of one side": (
        lambda text: swap("[time]", COUPLED + "[time]")(text).replace(
            'theta = "p1"', 'theta = { from = "p1", side = "motor" }\ngear = 2.0'
        ),
        r"joints\.joint2: theta of the coupled joint2, joint1 is before and behind the coupling",
    ),
    "coupling of an unknown joint": (
        swap("[time]", COUPLED.replace("joint2", "joint3") + "[time]"),
        r'coupling\.joints: "joint3" is no joint; .*joint1',
    ),
    "coupling without an inverse": (
        swap("[time]", COUPLED.replace("[0.0, 1.0]", "[2.0, -1.0]") + "[time]"),
        r"coupling\.matrix: it has no inverse",
    ),
    "coupling that is not square": (
        swap("[time]", COUPLED.replace("[0.0, 1.0]", "[0.0]") + "[time]"),
        r"coupling\.matrix: expected 2 rows of 2 numbers",
    ),
    "gear": (
        swap('tau = "m1"', 'tau = "m1"\ngear = 0'),
        r"joints\.joint1\.gear: found 0: expected a number other than 0",
    ),
    "no theta": (
        swap('theta = "p1"\n', ""),
        r"joints\.joint1\.theta: this key is missing, expected theta = \{ from",
    ),
    "column": (swap('"p1"', '"p11"'), r'joints\.joint1\.theta: "p11" is not in run\.csv; did you mean "p1"'),
    "column twice": (swap('"p2"', '"p1"'), r'joints\.joint2\.theta: "p1" is joints\.joint1\.theta already'),
    "time": (swap('column = "t"', 'column = "time"'), r'time\.column: "time" is not in run\.csv'),
    "no time": (
        swap('column = "t"\n', ""),
        r'time\.column: which column of run\.csv is the time\? likely: "t"',
    ),
    "time unit": (swap('column = "t"', 'column = "t"\nunit = "min"'), r'time\.unit: found "min"'),
    "constant": (
        swap('"m1"', '{ from = "m1", unit = "A" }'),
        r"joints\.joint1: tau is a current, expected torque_constant",
    ),
    "file": (swap("run.csv", "ran.csv"), r'log 1 "g1", file: "ran\.csv" does not exist'),
    "robot": (
        swap("robot.urdf", "other.urdf"),
        r"mapping\.toml, robot: other\.urdf: robot description not found",
    ),
    "joint": (
        swap("[joints.joint2]", "[joints.joint3]"),
        r'mapping\.toml, joints: joint "joint3" is not a moving joint',
    ),
    "payload": (swap('group = "g1"', 'group = "g1"\npayload = "p9"'), r'log 1 "g1", payload: payload "p9"'),
    "from and to": (
        swap('group = "g1"', 'group = "g1"\nfrom = 2\nto = 1'),
        r'log 1 "g1", to: found 1, expected more than from',
    ),
    "too short": (
        swap('group = "g1"', 'group = "g1"\nfrom = 1.19'),
        r'log "g1": run\.csv has 5 samples from 1\.19 s, .*counted from its first sample it lasts 1\.198 s',
    ),
    "group twice": (
        swap("[joints.joint1]", '[[logs]]\nfile = "run.csv"\ngroup = "g1"\n[joints.joint1]'),
        "two logs",
    ),
    "stiffness": (
        swap("[time]", "[initial]\nstiffness = [1.0]\n[time]"),
        r"initial\.stiffness: 1 values for 2 joints",
    ),
    "TOML": (swap("[time]", "[time"), r"mapping\.toml: not valid TOML"),
    "format": (swap("format = 1", "format = 2"), "format: found 2, this program reads format 1"),
    "a set": (swap("[[logs]]", "[[groups]]"), "this is a measurement set, expected a mapping with"),
    "wrong units": (swap('"m1"', '{ from = "m1", unit = "kNm" }'), ""),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_mapping(tmp_path: Path, case: str, capsys: pytest.CaptureFixture[str]) -> None:
    change, expected = BAD[case]
    file = write(tmp_path, change(SIMPLE))
    assert main(["import", str(file), "--out", str(tmp_path / "set")]) == 2
    output = capsys.readouterr()
    assert not (tmp_path / "set").exists() and "Traceback" not in output.err
    errors = [line for line in output.err.splitlines() if line.startswith("flexviz: ")]
    if case == "wrong units":  # nothing is wrong with the mapping by itself: the data contradict it
        assert not errors and "nothing was written" in output.out
        return
    assert len(errors) == 1 and re.search(expected, errors[0]), errors
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mapping.toml", "robot.urdf", "run.csv"]


def ragged(file: Path) -> None:
    file.write_text("t,p1\n" + "\n".join("1,2" if i != 50 else "1,2,3" for i in range(100)))


def one_message(file: Path) -> None:
    write_mcap(file, motor_messages(DATA)[:1])


def cut_short(file: Path) -> None:
    write_mcap(file, motor_messages(DATA))
    file.write_bytes(file.read_bytes()[:-200])


def garbled(file: Path) -> None:
    write_mcap(file, motor_messages(DATA))
    content = bytearray(file.read_bytes())
    content[len(content) // 3 : len(content) // 3 + 40] = bytes(40)
    file.write_bytes(content)


def no_states(file: Path) -> None:
    from mcap_ros2.writer import Writer

    with file.open("wb") as stream:
        writer = Writer(stream)
        schema = writer.register_msgdef("std_msgs/msg/Bool", "bool data")
        writer.write_message("/on", schema, {"data": True}, log_time=1)
        writer.finish()


def unnamed(file: Path) -> None:
    write_mcap(file, [(i, "/js", message(i * 10**6 + 1, [], [])) for i in range(100)])


def old_lerobot(file: Path) -> None:
    write_lerobot(file, [DATA], "v1.6", None)


def no_episode(file: Path) -> None:
    write_lerobot(file, [DATA], "v2.1", None)


FILES = {
    "empty.csv": (lambda file: file.write_bytes(b""), "no rows of numbers were found"),
    "binary.csv": (lambda file: file.write_bytes(bytes(range(256))), "not a text file"),
    "prose.csv": (lambda file: file.write_text("dear diary\nit rained\n"), "no rows of numbers"),
    "one_column.txt": (lambda file: file.write_text("tau\n" + "1\n" * 99), "holds one number.*npz"),
    "ragged.csv": (ragged, "row 51 .line 52.: found 3 values for 2 columns"),
    "short.csv": (lambda file: file.write_text("a,b\n1,2\n3,4\n"), "2 rows, expected at least 32"),
    "header.csv": (
        lambda file: file.write_text("a,b,c,d\n" + "1,2\n" * 99),
        r"header: the header has 4 names for 2 columns",
    ),
    "a.parquet": (lambda file: file.write_bytes(b"PAR1 no"), "not a readable Parquet table"),
    "a.mat": (
        lambda file: file.write_bytes(b"MATLAB 5.0 MAT-file".ljust(400, b"x")),
        r"not a readable \.mat file",
    ),
    "empty.mcap": (lambda file: file.write_bytes(b""), "not a readable bag: .*empty"),
    "cut.mcap": (cut_short, "not a readable bag: .*`mcap recover`"),
    "garbled.mcap": (garbled, "not a readable bag"),
    "no.mcap": (
        no_states,
        r"no topic holds sensor_msgs/msg/JointState or another.*; the bag has /on \(std_msgs/msg/Bool\)",
    ),
    "one.mcap": (one_message, "only 1 messages, expected at least 32"),
    "unnamed.mcap": (unnamed, "no joint has 32 messages"),
    "a.db3": (lambda file: file.write_bytes(b"SQLite no"), "not a readable bag"),
    "a.bag": (lambda file: file.write_bytes(b"#ROSBAG no"), "not a readable bag"),
    "a.xyz": (lambda file: file.write_text("1"), r'"\.xyz" is no known format; .* MCAP'),
    "folder": (lambda file: file.mkdir(), "neither a ROS 2 bag"),
    "old": (old_lerobot, r'codebase_version: found "v1\.6", expected v2\.x or v3\.x'),
    "episodes": (no_episode, r"which episode\? expected episode = 0 … 0"),
}


@pytest.mark.parametrize("name", FILES)
def test_bad_log(tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    create, expected = FILES[name]
    create(tmp_path / name)
    write_robot(tmp_path)
    mapping = write_mapping(tmp_path, [name], '"p#"', '"m#"')
    assert main(["import", str(mapping), "--out", str(tmp_path / "set")]) == 2
    output = capsys.readouterr()
    assert "Traceback" not in output.err and not (tmp_path / "set").exists()
    errors = [line for line in output.err.splitlines() if line.startswith("flexviz: ")]
    assert len(errors) == 1 and name in errors[0] and re.search(expected, errors[0]), errors


def test_what_the_set_itself_refuses_names_the_set_to_be(tmp_path: Path) -> None:
    """The checks of a measurement set run before it is there, and name the place where it would be."""
    tau = np.tile(DATA.tau[:, :1] * 1e7, 2)  # no unit explains it
    file = write(tmp_path, m1=tau[:, 0], m2=tau[:, 1])
    with pytest.raises(InputError) as caught:
        import_logs(file, tmp_path / "set", accept=True)
    assert str(tmp_path / "set" / "g1.parquet") in str(caught.value) and ".flexviz" not in str(caught.value)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mapping.toml", "robot.urdf", "run.csv"]


def test_mapping_reads_windows_text(tmp_path: Path) -> None:
    file = tmp_path / "m.toml"
    file.write_bytes(b"\xef\xbb\xbf" + SIMPLE.replace("\n", "\r\n").encode())
    assert read_mapping(file).names == ("joint1", "joint2")
