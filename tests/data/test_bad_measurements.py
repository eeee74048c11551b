"""Every kind of bad measurement set gets one line that names the file, the place, and what is expected."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as papq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_set import URDF, columns, write_small_set, write_table

from flexviz.base.errors import FlexvizError, InputError, one_line
from flexviz.checks import with_plausibility_warnings
from flexviz.data.measurements import read_set

Spoil = Callable[[Path], object]


def edit(old: str, new: str) -> Spoil:
    """Replace a text in measurements.toml, everywhere."""

    def spoil(folder: Path) -> None:
        file = folder / "measurements.toml"
        text = file.read_text()
        assert old in text
        file.write_text(text.replace(old, new))

    return spoil


def cell(row: int, column: str, value: object, file: str = "a.csv") -> Spoil:
    """Put `value` into a cell (rows from 0)."""

    def spoil(folder: Path) -> None:
        table: dict = {name: list(x) for name, x in columns(1 if file.startswith("b") else 0).items()}
        table[column][row] = value
        if file.endswith(".csv"):
            lines = [",".join(table)] + [
                ",".join(map(str, values)) for values in zip(*table.values(), strict=True)
            ]
            (folder / file).write_text("\n".join(lines) + "\n")
        else:
            papq.write_table(pa.table(table), folder / file)

    return spoil


def table(change: Callable[[dict[str, np.ndarray]], object], file: str = "a.csv") -> Spoil:
    """Change the columns of a table."""

    def spoil(folder: Path) -> None:
        data = columns(1 if file.startswith("b") else 0)
        change(data)
        write_table(folder / file, data)

    return spoil


def scale(prefix: str, factor: float) -> Callable[[dict[str, np.ndarray]], object]:
    return lambda data: data.update({name: x * factor for name, x in data.items() if name.startswith(prefix)})


def still(prefix: str) -> Spoil:
    def spoil(folder: Path) -> None:
        for seed, name in enumerate(("a.csv", "b.parquet", "sub/c.csv")):
            data = columns(seed)
            constant = {key: np.full_like(x, 0.3) for key, x in data.items() if key.startswith(prefix)}
            write_table(folder / name, data | constant)

    return spoil


def only_gaps(folder: Path) -> None:
    for seed, name in enumerate(("a.csv", "b.parquet")):
        data = columns(seed)
        write_table(folder / name, data | {"time": data["time"] + 5.0 * np.floor(np.arange(2000) / 20)})


def content(name: str, data: str | bytes) -> Spoil:
    """Write a file of the set."""
    return lambda folder: (folder / name).write_bytes(data.encode() if isinstance(data, str) else data)


def link_outside(name: str) -> Spoil:
    """Move a file out of the folder and leave a symbolic link to it."""

    def spoil(folder: Path) -> None:
        (folder / name).rename(folder.parent / "outside")
        os.symlink(folder.parent / "outside", folder / name)

    return spoil


def moved(name: str, to: str) -> Spoil:
    return lambda folder: (folder / name).rename(folder / to)


def copied(name: str, to: str) -> Spoil:
    return lambda folder: shutil.copyfile(folder / name, folder / to)


A_CSV = 'file = "a.csv"'
P2 = 'bodies = [{ link = "link2", mass = 2.0'

# what is wrong: (how to spoil the set, words that the message must hold)
BAD: dict[str, tuple[Spoil, tuple[str, ...]]] = {
    "same file": (edit('file = "b.parquet"', 'file = "a.csv"'), ("a.csv", '"g1" and "g2" use the same file')),
    "grams": (
        edit("mass = 2.0", "mass = 2000.0"),
        ("payloads.p2.bodies, entry 1, mass", "2000 on a robot of 8 kg", "in grams? expected kg"),
    ),
    # the numbers
    "nan": (cell(16, "tau_joint1", float("nan")), ("a.csv", "row 17 (line 18)", "tau_joint1", "nan")),
    "nan in parquet": (
        cell(16, "theta_joint2", np.nan, "b.parquet"),
        ("b.parquet", "row 17", "theta_joint2"),
    ),
    "infinity": (cell(3, "theta_joint1", float("inf")), ("row 4 ", "theta_joint1", "inf")),
    "minus infinity": (cell(3, "q_joint1", -np.inf, "b.parquet"), ("b.parquet", "row 4", "q_joint1", "-inf")),
    "absurd number": (
        cell(3, "tau_joint2", -1e300),
        ("a.csv", "row 4 ", "tau_joint2", "-1e+300", "SI units"),
    ),
    "nan time": (cell(5, "time", float("nan")), ("row 6 ", "column time")),
    "empty cell": (cell(7, "theta_joint2", ""), ("row 8 (line 9)", "theta_joint2", "empty")),
    "null in parquet": (cell(7, "theta_joint2", None, "b.parquet"), ("row 8", "theta_joint2", "empty")),
    "text in a cell": (cell(9, "tau_joint2", "abc"), ("row 10 (line 11)", "tau_joint2", '"abc"', "number")),
    "late text in a cell": (cell(1999, "tau_joint2", "1.2.3"), ("row 2000 (line 2001)", '"1.2.3"')),
    "text column": (
        table(lambda d: d.update(tau_joint1=np.array(["a"] * 2000)), "b.parquet"),
        ("b.parquet", "tau_joint1", "string", "numbers"),
    ),
    "row too short": (content("a.csv", "time,theta_joint1\n0,1\n1\n"), ("tau_joint1", "missing")),
    "ragged row": (
        content("a.csv", ",".join(columns()) + "\n0,1,2,3,4,5\n0.1,1,2\n"),
        ("a.csv", "row 2 (line 3)", "3 values for 6 columns"),
    ),
    # the columns
    "missing column": (table(lambda d: d.pop("tau_joint2")), ("a.csv", "header", '"tau_joint2" is missing')),
    "missing column in parquet": (table(lambda d: d.pop("time"), "b.parquet"), ("b.parquet", '"time"')),
    "misspelt column": (
        table(lambda d: d.update(tau_join2=d.pop("tau_joint2"))),
        ("tau_joint2", 'did you mean "tau_join2"'),
    ),
    "no header": (content("a.csv", "0,1,2,3,4\n1,1,2,3,4\n"), ("a.csv", "header", "time")),
    "column twice": (content("a.csv", "time,q,q\n0,1,1\n"), ("a.csv", "header", '2 columns are called "q"')),
    "semicolons": (content("a.csv", "time;theta_joint1\n0;1\n"), ("a.csv", "header", "commas")),
    # the time
    "time repeats": (cell(20, "time", 19 * 0.002), ("a.csv", "row 21 (line 22)", "column time", "repeats")),
    "time decreases": (cell(20, "time", 0.0, "b.parquet"), ("b.parquet", "row 21", "time", "decreases")),
    "too few rows": (
        table(lambda d: d.update({k: x[:9] for k, x in d.items()})),
        ("a.csv", "9", "at least 32"),
    ),
    "no rows": (
        table(lambda d: d.update({k: x[:0] for k, x in d.items()}), "b.parquet"),
        ("b.parquet", "no rows"),
    ),
    "only gaps": (only_gaps, ("a.csv", "gap", "32 samples")),
    "nothing moves": (still("theta"), ("groups", "no joint moves", "theta_<joint>")),
    "no torque": (still("tau"), ("groups", "no torque changes")),
    "huge stiffness": (
        edit("stiffness = [2000", "stiffness = [1e300"),
        ("initial.stiffness", "at most 1e+12"),
    ),
    # the units
    "time in ms": (
        table(scale("time", 1e3)),
        ("a.csv", "column time", "milliseconds", "expected seconds"),
    ),
    "time in us": (table(scale("time", 1e6), "b.parquet"), ("b.parquet", "column time", "microseconds")),
    "time in ns": (table(scale("time", 1e9)), ("a.csv", "column time", "nanoseconds")),
    "theta in degrees": (table(scale("theta", 180 / np.pi)), ("a.csv", "column theta_joint", "degrees")),
    "one theta in degrees": (
        table(scale("theta_joint1", 57.3)),
        ("column theta_joint1", "degrees", "radians"),
    ),
    "motor angles": (table(scale("theta", 160.0)), ("a.csv", "column theta_", "gear", "radians")),
    "torque in mNm": (table(scale("tau", 1e3), "b.parquet"), ("b.parquet", "column tau_joint", "mNm", "Nm")),
    "one torque in mNm": (table(scale("tau_joint2", 1e3)), ("column tau_joint2", "mNm", "Nm")),
    "torque in kNm": (table(scale("tau", 1e-3)), ("a.csv", "column tau_joint", "kNm", "Nm")),
    "link encoder in degrees": (table(scale("q_", 57.3)), ("a.csv", "column q_joint1", "times", "rad")),
    "hold in ms": (edit("torque_hold = 0.001", "torque_hold = 1"), ("torque_hold", "at most 0.1")),
    "com in mm": (
        edit("[0.3, 0.0, 0.0]", "[300.0, 0.0, 0.0]"),
        ("payloads.p2.bodies, entry 1, com", "metres"),
    ),
    "inertia in kg mm²": (
        edit("[0.004, 0.004,", "[4000, 4000,"),
        ("payloads.p2.bodies, entry 1, inertia", "10 m"),
    ),
    # files
    "absolute path": (
        edit(A_CSV, 'file = "/etc/passwd"'),
        ("measurements.toml", 'group 1 "g1", file', "outside"),
    ),
    "path upwards": (edit(A_CSV, 'file = "../a.csv"'), ('group 1 "g1", file', '"../a.csv"', "outside")),
    "path up and back": (edit(A_CSV, 'file = "sub/../../x/a.csv"'), ('group 1 "g1", file', "outside")),
    "link to outside": (link_outside("a.csv"), ('group 1 "g1", file', "outside")),
    "folder link to outside": (link_outside("sub"), ('group 3 "g3", file', "outside")),
    "robot outside": (edit('"robot.urdf"', '"../robot.urdf"'), ("measurements.toml", "robot", "outside")),
    "robot link to outside": (link_outside("robot.urdf"), ("measurements.toml", "robot", "outside")),
    "absolute robot": (edit('"robot.urdf"', '"/etc/hostname"'), ("measurements.toml", "robot", "outside")),
    "no such table": (edit(A_CSV, 'file = "x.csv"'), ('group 1 "g1", file', '"x.csv"', "not exist")),
    "zero byte in a path": (edit(A_CSV, 'file = "a\\u0000.csv"'), ('group 1 "g1", file',)),
    "endless path": (edit(A_CSV, f'file = "{"a" * 5000}.csv"'), ('group 1 "g1", file',)),
    "a folder as table": (edit(A_CSV, 'file = "sub"'), ('group 1 "g1", file', '"sub"')),
    "unknown suffix": (
        lambda f: (moved("a.csv", "a.xls")(f), edit(A_CSV, 'file = "a.xls"')(f)),
        (".xls", "*.csv"),
    ),
    "empty table": (content("a.csv", ""), ("a.csv", "empty")),
    "binary table": (content("a.csv", bytes(range(256)) * 9), ("a.csv",)),
    "latin-1 table": (content("a.csv", "time,größe\n0,1\n".encode("latin-1")), ("a.csv", "UTF-8")),
    "parquet called csv": (copied("b.parquet", "a.csv"), ("a.csv", "Parquet")),
    "csv called parquet": (copied("a.csv", "b.parquet"), ("b.parquet", "Parquet")),
    "broken parquet": (content("b.parquet", b"PAR1" + b"\0" * 99 + b"PAR1"), ("b.parquet", "Parquet")),
    "cut parquet": (
        lambda f: (f / "b.parquet").write_bytes((f / "b.parquet").read_bytes()[:900]),
        ("b.parquet", "Parquet"),
    ),
    # the robot
    "no such robot": (
        edit('"robot.urdf"', '"example-robot-data:pandda"'),
        ("measurements.toml", "robot", '"panda"'),
    ),
    "no such shipped robot": (edit('"robot.urdf"', '"robots:planar_3r"'), ("robot", "planar_2r")),
    "no URDF": (content("robot.urdf", "<robot"), ("measurements.toml", "robot", "robot.urdf")),
    "other XML": (content("robot.urdf", "<svg/>"), ("measurements.toml", "robot", "<svg>")),
    "empty URDF": (content("robot.urdf", ""), ("measurements.toml", "robot")),
    "URDF without links": (content("robot.urdf", '<robot name="x"/>'), ("measurements.toml",)),
    "binary URDF": (content("robot.urdf", b"\xff\xfe\x00"), ("measurements.toml", "robot")),
    "unknown joint": (edit('["joint1", "joint2"]', '["joint1", "joint3"]'), ("joints", '"joint3"', "joint2")),
    "joint twice": (edit('["joint1", "joint2"]', '["joint1", "joint1"]'), ("joints", '"joint1"', "twice")),
    "no joints": (edit('["joint1", "joint2"]', "[]"), ("joints", "at least 1")),
    "unknown link": (
        edit('link = "link2"', 'link = "lnk2"'),
        ("payloads.p2.bodies, entry 1", '"lnk2"', '"link2"'),
    ),
    # the TOML
    "no TOML": (content("measurements.toml", "format: 1\n"), ("measurements.toml", "TOML", "line 1")),
    "key twice": (edit("format = 1", "format = 1\nformat = 1"), ("measurements.toml", "TOML")),
    "binary TOML": (content("measurements.toml", b"\xff\xfe\x00\x00"), ("measurements.toml", "UTF-8")),
    "empty TOML": (content("measurements.toml", ""), ("measurements.toml", "format", "missing")),
    "deep TOML": (content("measurements.toml", "a = " + "[" * 50000), ("measurements.toml", "TOML")),
    "format 2": (edit("format = 1", "format = 2"), ("measurements.toml", "format", "found 2", "format 1")),
    "format as text": (edit("format = 1", 'format = "1"'), ("format", 'found "1"')),
    "format true": (edit("format = 1", "format = true"), ("format", "found true")),
    "no format": (edit("format = 1", ""), ("format", "missing")),
    "no robot": (edit('robot = "robot.urdf"', ""), ("robot", "missing")),
    "no groups": (lambda f: edit(groups_of(f), "")(f), ("groups", "missing")),
    "empty groups": (
        lambda f: (edit(groups_of(f), "")(f), edit("format = 1", "format = 1\ngroups = []")(f)),
        ("groups", "at least 1"),
    ),
    "unknown key": (edit("torque_hold", "torque_hodl"), ('"torque_hodl"', 'did you mean "torque_hold"')),
    "unknown key in a group": (
        edit("validation =", "validate ="),
        ('group 3 "g3"', 'did you mean "validation"'),
    ),
    "unknown key in a body": (edit("mass = 2.0", "mas = 2.0"), ("payloads.p2.bodies, entry 1", '"mass"')),
    "unknown table": (edit("[controller]", "[controler]"), ('"controler"', '"controller"')),
    "unknown table in initial": (edit("motor_inertia", "rotor_inertia"), ("initial", '"motor_inertia"')),
    "number as robot": (edit('"robot.urdf"', "7"), ("robot", "found 7", "text")),
    "text as number": (edit("mass = 2.0", 'mass = "2 kg"'), ("payloads.p2.bodies, entry 1, mass", '"2 kg"')),
    "true as number": (edit("mass = 2.0", "mass = true"), ("mass", "found true", "number")),
    "number as truth": (edit("validation = true", "validation = 1"), ("validation", "true or false")),
    "table as list": (edit("stiffness = [2000, 1500.0]", "stiffness.a = 1"), ("initial.stiffness", "list")),
    "list as table": (edit("[payloads.p1]\nbodies = []", "[payloads]\np1 = []"), ("payloads.p1", "table")),
    "nan in the TOML": (edit("[2000, 1500.0]", "[nan, 1500.0]"), ("initial.stiffness, entry 1", "nan")),
    "huge number": (edit("[2000, 1500.0]", f"[1{'0' * 400}, 1500.0]"), ("initial.stiffness, entry 1",)),
    "infinite mass": (edit("mass = 2.0", "mass = inf"), ("mass", "finite")),
    "negative mass": (edit("mass = 2.0", "mass = -2.0"), ("mass", "at least 0")),
    "negative stiffness": (
        edit("[2000, 1500.0]", "[-2000, 1500.0]"),
        ("initial.stiffness, entry 1", "at least 0.001"),
    ),
    "negative hold": (edit("torque_hold = 0.001", "torque_hold = -0.1"), ("torque_hold", "at least 0")),
    "nan hold": (edit("torque_hold = 0.001", "torque_hold = nan"), ("torque_hold", "nan")),
    "short list": (edit("[2000, 1500.0]", "[2000]"), ("initial.stiffness", "1 values for 2 joints")),
    "long list": (edit("kd = [500.0, 250.0]", "kd = [5, 2, 1]"), ("controller.kd", "3 values for 2 joints")),
    "half a controller": (edit("kd = [500.0, 250.0]", ""), ("controller.kd", "missing")),
    "short com": (
        edit("[0.3, 0.0, 0.0]", "[0.3, 0.0]"),
        ("payloads.p2.bodies, entry 1, com", "2 values", "3"),
    ),
    "short inertia": (edit("0.004, 0, 0, 0]", "0.004]"), ("payloads.p2.bodies, entry 1, inertia", "6")),
    "impossible inertia": (
        edit("0.004, 0, 0, 0]", "0.004, 1, 0, 0]"),
        ("payloads.p2.bodies, entry 1, inertia", "moments"),
    ),
    "unknown payload": (
        edit('payload = "p1"', 'payload = "p3"'),
        ('group 1 "g1", payload', '"p3"', "p1, p2"),
    ),
    "unknown effect": (
        edit("coulomb_friction", "colomb_friction"),
        ("model.effects", 'mean "coulomb_friction"'),
    ),
    "effect twice": (edit('["coulomb_friction"]', '["backlash", "backlash"]'), ("model.effects", "twice")),
    "group twice": (edit('name = "g2"', 'name = "g1"'), ("groups", '"g1"')),
    "nameless group": (edit('name = "g2"', 'name = ""'), ("group 2", "name", "not empty")),
    "group without file": (edit(A_CSV, ""), ('group 1 "g1", file', "missing")),
    "control characters": (
        edit('payload = "p1"', 'payload = "p\\u001b[31m\\n1"'),
        ('group 1 "g1", payload',),
    ),
    # nothing there
    "no measurements.toml": (
        lambda f: (f / "measurements.toml").unlink(),
        ("measurements.toml", "not found"),
    ),
    "measurements.toml is a folder": (
        lambda f: ((f / "measurements.toml").unlink(), (f / "measurements.toml").mkdir()),
        ("measurements.toml",),
    ),
}


def groups_of(folder: Path) -> str:
    text = (folder / "measurements.toml").read_text()
    return text[text.index("[[groups]]") :]


@pytest.mark.parametrize("what", BAD)
def test_one_line(tmp_path: Path, what: str) -> None:
    folder = write_small_set(tmp_path / "small")
    spoil, words = BAD[what]
    spoil(folder)
    with pytest.raises(InputError) as caught:
        read_set(folder)
    check_line(caught.value, words)
    assert str(folder) in str(caught.value)


def check_line(error: InputError, words: tuple[str, ...] = ()) -> None:
    line = str(error)
    assert line == one_line(line) and line.isprintable() and 20 < len(line) < 2000, line
    assert error.__cause__ is None or error.__suppress_context__
    assert isinstance(error, ValueError) and isinstance(error, FlexvizError) and error.exit_code == 2
    for word in words:
        assert word in line, line


@pytest.mark.parametrize(
    "path", ["nowhere", "nowhere/measurements.toml", "small/a.csv", "", "a\0b", "x" * 5000]
)
def test_paths_that_are_no_sets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, path: str) -> None:
    write_small_set(tmp_path / "small")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as caught:
        read_set(path)
    check_line(caught.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (table(scale("tau", 50.0)), "tau of joint1, joint2: in g1, with unit ="),
        (table(lambda d: d.update(tau_joint2=np.zeros(2000))), "tau_joint2 never changes"),
        (table(lambda d: d.update(theta_ref_joint2=-d["theta_joint2"])), "theta_ref of joint2: it is -1"),
        (table(scale("time", 30.0)), "step is 0.06 s"),
        (
            lambda folder: write_table(folder / "sub/c.csv", columns(0)),
            '"g1" and "g3" hold the same samples: intervals are narrower',
        ),
    ],
    ids=["50 times", "constant", "opposite", "slow", "copy"],
)
def test_odd_is_only_a_warning(tmp_path: Path, change: Spoil, words: str) -> None:
    folder = write_small_set(tmp_path / "small")
    change(folder)
    warnings = [fact.text for fact in with_plausibility_warnings(read_set(folder)).warnings]
    assert any(words in line for line in warnings), warnings
    assert all(line == one_line(line) and str(folder) in line for line in warnings)


def test_plausible_data_pass(tmp_path: Path) -> None:
    """Offsets, friction far above what the masses need, wrong CAD, another direction: all silent."""
    folder = write_small_set(tmp_path / "small")

    def rough(d: dict[str, np.ndarray]) -> None:
        for j in ("1", "2"):
            v = np.gradient(d[f"theta_joint{j}"], d["time"])
            d[f"tau_joint{j}"] = d[f"tau_joint{j}"] + 150 * np.sign(np.round(v, 1)) - 60
            d[f"theta_joint{j}"] = d[f"theta_joint{j}"] + 1.5

    for factor in (1, 3, 0.3):
        (folder / "robot.urdf").write_text(URDF.replace('mass value="4"', f'mass value="{4 * factor}"'))
        table(rough)(folder)
        assert not with_plausibility_warnings(read_set(folder)).warnings


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_random_damage_is_never_a_traceback(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    """Overwrite, cut or insert bytes in any file of a set: it is read, or refused in one line."""
    folder = write_small_set(tmp_path_factory.mktemp("damaged") / "small")
    name = data.draw(st.sampled_from(["measurements.toml", "robot.urdf", "a.csv", "b.parquet"]))
    raw = (folder / name).read_bytes()
    at = data.draw(st.integers(0, len(raw)))
    length = data.draw(st.integers(0, 40))
    new = data.draw(st.binary(max_size=40))
    (folder / name).write_bytes(raw[:at] + new + raw[at + length :])
    try:
        read_set(folder)
    except InputError as error:
        check_line(error)
