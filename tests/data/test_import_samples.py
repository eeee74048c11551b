"""What is wrong with the samples of logs: cause, rows and a remedy that works; silence where nothing is."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from independent.cases import make_case
from shared_data import FAULTS, REAL

from benchmarks.sample_faults import HARMLESS, KINDS, issues_of, log_of, named, write_log
from flexviz.analysis.diagnosis import diagnose
from flexviz.analysis.identification import identify
from flexviz.analysis.motion import MOTION
from flexviz.base.errors import InputError
from flexviz.content.wording import issue_message, issue_text
from flexviz.data.importing import import_logs, inspect_logs
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.data.noise import white_noise
from flexviz.outlets.terminal import main

pytestmark = pytest.mark.usefixtures("no_delay")
Case = tuple[int, str, str]
CASES = ((1, "coulomb_friction", "2r"), (2, "none", "2r"), (3, "coulomb_friction", "ur5"))
ALL = {kind for one in KINDS.values() for kind in one.names} | {"jumps"}
OTHERS = (  # one fault of each kind on the other recordings; the others there are a study
    "counts of 16 bits wrap", "signed torque read as unsigned", "zeros for lost values",
    "second publisher without effort", "second publisher with effort", "joints updated in turn",
    "stale torque", "brakes closed in between", "a hand pushes", "position that never changes",
    "filtered before it was written",
)  # fmt: skip


def case_name(case: Case) -> str:
    return f"{case[2]}-{case[0]}"


FAULTY = [  # recording and fault
    pytest.param(
        case,
        name,
        marks=() if case is CASES[0] else pytest.mark.slow if name in OTHERS else pytest.mark.study,
        id=f"{case_name(case)}-{name}",
    )
    for case in CASES
    for name in KINDS
]


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Case], MeasurementSet]:
    """Recordings without fault, by a simulator that shares no code; each is made once."""

    @cache
    def made(case: Case) -> MeasurementSet:
        seed, kind, robot = case
        folder = tmp_path_factory.mktemp("good") / robot
        make_case(seed, kind, robot, folder, duration=10.0)
        return read_set(folder, logged=False)

    return made


@pytest.fixture(params=CASES, ids=case_name)
def good(request: pytest.FixtureRequest, recordings: Callable[[Case], MeasurementSet]) -> MeasurementSet:
    return recordings(request.param)


@pytest.mark.parametrize(("good", "name"), FAULTY, indirect=["good"])
def test_a_fault_is_named_with_rows_and_remedy(good: MeasurementSet, name: str, tmp_path: Path) -> None:
    kind, group = KINDS[name], good.fit_groups[0]
    log = log_of(good, group, len(good.joints))
    place = kind.spoil(log)
    issues = issues_of(tmp_path, good, group, log)
    assert named(kind, issues) == "right", list(map(str, issues))
    issue = next(i for i in issues if i.kind in kind.names)
    assert re.search(r"rows? \d+|in all rows", issue_message(issue)) and "?" in issue_message(issue)
    if place is not None:
        begin, end = map(float, re.findall(r"\(([\d.]+) to ([\d.]+) s\)", issue_message(issue))[0])
        assert begin == pytest.approx(place[0], abs=0.6) and end == pytest.approx(place[1], abs=0.6)
    if kind.key:
        assert f"Proposed: {kind.key} = " in issue_message(issue)
        mended = import_logs(tmp_path / "mapping.toml", None, mend=True)
        assert mended.mended and not {i.kind for i in mended.issues} & set(kind.names)


@pytest.mark.parametrize("name", HARMLESS)
def test_what_is_no_fault_is_not_named(good: MeasurementSet, name: str, tmp_path: Path) -> None:
    group = good.fit_groups[0]
    log = log_of(good, group, 0)
    HARMLESS[name](log)
    assert not [issue_text(issue) for issue in issues_of(tmp_path, good, group, log) if issue.kind in ALL]


@pytest.mark.parametrize("held", [2, 8])
def test_the_noise_of_repeated_values_is_that_of_new_ones(held: int) -> None:
    """Joints that are updated in turn, too: 8 times as much was told."""
    rng = np.random.default_rng(0)
    time = 1e-3 * np.arange(20_000)
    y = np.stack([np.sin(3 * time), np.cos(2 * time)], axis=1) + 1e-4 * rng.normal(size=(20_000, 2))
    for j in range(2):
        y[:, j] = y[np.maximum(np.arange(20_000) - (np.arange(20_000) + j) % held, 0), j]
    np.testing.assert_allclose(white_noise(y), np.sqrt(held) * 1e-4, rtol=0.1)


# -- inputs that failed --------------------------------------------------------------------------------------

GIVEN = {
    "02-two-publishers-on-joint-states": ("messages", "theta", "two publishers", "complete_rows = true"),
    "05-unsigned-current-counts": ("wrapped", "tau", "unsigned", "wrap = 65536"),
    "07-brakes-closed-at-start": ("held", "tau", "brakes", "from = 2.5"),
}


@pytest.mark.parametrize("name", GIVEN)
def test_given_faults(name: str, tmp_path: Path) -> None:
    mapping = FAULTS / name / "map.toml"
    if not mapping.is_file():
        pytest.skip("the inputs are not here")
    kind, signal, cause, proposal = GIVEN[name]
    (issue,) = import_logs(mapping, None).issues
    assert (issue.kind, issue.signal) == (kind, signal) and "joint1" in issue.joints
    assert cause in issue_message(issue) and proposal in issue_message(issue)
    import_logs(mapping, tmp_path / "set", mend=True)
    found = identify(read_set(tmp_path / "set"))
    assert found.converged
    assert max(np.array(found.residual.rms) / found.residual.torque_spread) < MOTION.tolerance


def test_two_publishers_are_refused_where_they_are_imported_all_the_same(tmp_path: Path) -> None:
    mapping = FAULTS / "02-two-publishers-on-joint-states" / "map.toml"
    if not mapping.is_file():
        pytest.skip("the inputs are not here")
    import_logs(mapping, tmp_path / "set", accept=True)
    measurements = read_set(tmp_path / "set")
    for command in (identify, diagnose):
        with pytest.raises(InputError, match=r"t1p1\.parquet, row \d+, column theta_joint\d: the position"):
            command(measurements)


@pytest.mark.parametrize("name", ["a0", "c1"])
def test_recordings_have_no_such_fault(name: str, tmp_path: Path) -> None:
    folder = REAL / "dfki_pendulum" / name
    if not folder.is_dir():
        pytest.skip("the recordings are not here")
    measurements = read_set(folder)
    group = measurements.fit_groups[0]
    issues = issues_of(tmp_path, measurements, group, log_of(measurements, group, 0))
    assert not [issue_text(issue) for issue in issues if issue.kind in ALL]


# -- the mapping ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("good", CASES[:1], indirect=True)
def test_proposals_are_comments_of_the_draft(good: MeasurementSet, tmp_path: Path) -> None:
    """They become keys when the user takes the number sign away, not before."""
    group = good.fit_groups[0]
    log = log_of(good, group, 1)
    KINDS["angle wraps at 2π"].spoil(log)
    write_log(tmp_path, good, group, log)
    text = (tmp_path / "log.csv").read_text()
    names = ["time"] + [
        f"{s}_{j}" for joint in range(good.n) for s, j in (("theta", joint + 1), ("tau", joint + 1))
    ]
    (tmp_path / "log.csv").write_text(",".join(names) + text[text.index("\n") :])
    drafted = inspect_logs([tmp_path / "log.csv"], str(good.path / "robot.urdf")).draft.text(
        tmp_path / "m.toml"
    )
    lines = [line for line in drafted.splitlines() if "wrap = " in line and line.startswith("# theta = {")]
    assert lines and "wrap = " not in "\n".join(line for line in drafted.splitlines() if line[:1] != "#")


@pytest.mark.parametrize("good", CASES[:1], indirect=True)
def test_the_command_mends(good: MeasurementSet, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    group = good.fit_groups[0]
    log = log_of(good, group, 1)
    KINDS["spikes of a position"].spoil(log)
    mapping = write_log(tmp_path, good, group, log)
    assert main(["import", str(mapping), "--out", str(tmp_path / "set")]) == 2
    assert "Proposed: drop_jumps = true" in capsys.readouterr().out
    assert main(["import", str(mapping), "--out", str(tmp_path / "set"), "--mend"]) == 0
    assert 'set as proposed: drop_jumps = true for log "g"' in capsys.readouterr().out
    assert read_set(tmp_path / "set").groups
