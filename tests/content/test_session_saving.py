"""Sessions survive: being killed while they are saved, older versions, data that move, change or vanish."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.base import files
from flexviz.base.errors import InputError
from flexviz.content.session import (
    SESSION_FILE,
    Autosave,
    Session,
    SessionChanged,
    find_unsaved,
    open_session,
    packing,
    relocate,
    save_session,
)
from flexviz.content.session.document import FORMAT
from flexviz.data.measurements import MeasurementSet, fingerprint, read_set, require_unchanged
from tests.found import DIAGNOSIS
from tests.small_session import small_session
from tests.small_set import write_small_set

ROOT = Path(__file__).resolve().parents[2]
KEEP_AND_DIE = """
import os, sys
from pathlib import Path
from flexviz.content.session import Autosave, open_session
opened, keeper = open_session(sys.argv[1]), Autosave(lambda: Path(sys.argv[2]))
keeper.keep(opened.session.with_note("kept in time"), opened.measurements)
keeper.flush()
os.kill(os.getpid(), 9)
"""
Kept = tuple[MeasurementSet, Session, Path]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Kept:
    root = tmp_path_factory.mktemp("saving")
    measurements, session = small_session(root / "small")
    return measurements, session, save_session(session, measurements, root / "kept")


@pytest.fixture
def kept(made: Kept, tmp_path: Path) -> Kept:
    """A set and its session that a test may spoil."""
    shutil.copytree(made[0].path.parent, tmp_path / "work")
    measurements = read_set(tmp_path / "work" / "small")
    session = open_session(tmp_path / "work" / "kept").session
    return measurements, session, save_session(session, measurements, tmp_path / "work" / "kept")


# -- whole or not there --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_twenty_kills_lose_nothing() -> None:
    run = subprocess.run(
        [sys.executable, "-m", "benchmarks.kills", "20"], cwd=ROOT, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert "20 sessions open and hold what was saved last" in run.stdout


def test_a_result_too_large_to_be_opened_is_not_saved(kept: Kept, monkeypatch: pytest.MonkeyPatch) -> None:
    measurements, session, folder = kept
    before = (folder / SESSION_FILE).read_bytes()
    monkeypatch.setattr(packing, "LARGEST_UNPACKED", 1000)
    with pytest.raises(InputError, match="cannot be saved in a session, expected at most 1,000"):
        save_session(session.with_note("more"), measurements, folder)
    assert (folder / SESSION_FILE).read_bytes() == before


@pytest.mark.parametrize("fails", ["fsync", "replace"])
def test_a_save_that_fails_leaves_the_old_one(kept: Kept, monkeypatch: Any, fails: str) -> None:
    measurements, session, folder = kept
    before = (folder / SESSION_FILE).read_bytes()

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, fails, full)
    with pytest.raises(InputError, match=r"kept: cannot be saved \(No space left on device\)"):
        save_session(session.with_note("more"), measurements, folder)
    monkeypatch.undo()
    assert (folder / SESSION_FILE).read_bytes() == before and open_session(folder).session.past
    assert not [file for file in folder.rglob("*") if file.name.endswith(files.PART)]


def test_what_an_interrupted_save_left_is_removed_by_the_next(kept: Kept) -> None:
    measurements, session, folder = kept
    left = [folder / f".{SESSION_FILE}.x1{files.PART}", folder / "results" / f".abc.npz.x2{files.PART}"]
    for file in left:
        file.write_bytes(b"half")
    mine = folder / ".mine.part"
    mine.write_text("not a session's")
    save_session(session, measurements, folder)
    assert not any(file.exists() for file in left) and mine.exists()


def test_results_are_written_once_and_removed_with_their_states(kept: Kept) -> None:
    measurements, session, folder = kept
    stamps = {file.name: file.stat().st_mtime_ns for file in folder.glob("results/*")}
    save_session(session.with_note("more"), measurements, folder)
    assert {file.name: file.stat().st_mtime_ns for file in folder.glob("results/*")} == stamps
    save_session(Session.of(measurements), measurements, folder)
    assert stamps and not list(folder.glob("results/*"))


def test_notes_times_and_recordings_come_back(kept: Kept) -> None:
    measurements, session, folder = kept
    recording = folder.parent / "a.rrd"
    session = session.with_note(" both motors warm ").with_recording(recording)
    save_session(session.undo().redo(), measurements, folder)
    again = open_session(folder).session
    assert [note.text for note in again.notes] == ["both motors warm"]
    assert again.notes[0].when.startswith("20") and again.recordings == (recording.resolve(),)
    assert [(s.when, s.version) for s in again.past] == [(s.when, s.version) for s in session.past]
    assert json.loads((folder / SESSION_FILE).read_text())["recordings"] == ["../a.rrd"]
    with pytest.raises(InputError, match="empty note"):
        session.with_note(" ")


def test_another_sets_session_is_not_overwritten(kept: Kept, tmp_path: Path) -> None:
    _, _, folder = kept
    other = read_set(write_small_set(tmp_path / "other"))
    with pytest.raises(InputError, match='session of another measurement set, "small"'):
        save_session(Session.of(other), other, folder)


# -- the set by reference and hash ---------------------------------------------------------------------------


def test_set_and_session_can_be_moved_together_or_the_session_alone(kept: Kept, tmp_path: Path) -> None:
    measurements, _, folder = kept
    shutil.move(folder, tmp_path / "alone")
    assert open_session(tmp_path / "alone").measurements.path == measurements.path
    shutil.move(tmp_path / "alone", folder)
    shutil.move(folder.parent, tmp_path / "elsewhere")
    opened = open_session(tmp_path / "elsewhere" / "kept")
    assert opened.measurements.path == tmp_path / "elsewhere" / "small" and not opened.changed


def test_a_missing_set_or_file_is_named(kept: Kept, tmp_path: Path) -> None:
    measurements, _, folder = kept
    shutil.move(measurements.path / "b.parquet", tmp_path / "b.parquet")
    with pytest.raises(InputError, match=r"session\.json, set: the data file b\.parquet .* is missing"):
        open_session(folder)
    shutil.move(tmp_path / "b.parquet", measurements.path / "b.parquet")
    shutil.move(measurements.path, tmp_path / "away")
    with pytest.raises(InputError, match=r'set "small" is missing.*flexviz session SESSION --set'):
        open_session(folder)
    opened = relocate(folder, tmp_path / "away")
    assert not opened.changed and opened.session.past
    save_session(opened.session, opened.measurements, folder)
    assert open_session(folder).measurements.path == tmp_path / "away"
    with pytest.raises(InputError, match="carries its measurement set"):
        relocate(save_session(opened.session, opened.measurements, tmp_path / "c", carry=True), folder)


def test_changed_data_are_named_and_no_result_counts_as_theirs(kept: Kept) -> None:
    measurements, session, folder = kept
    assert session.past[-1].analysis.up_to_date and session.past[-1].analysis.diagnosis_up_to_date
    table = measurements.path / "a.csv"
    table.write_text(table.read_text().replace("\n0,", "\n0.0,", 1))
    opened = open_session(folder)
    assert opened.changed == ("a.csv",) and opened.measurements.warnings[0].values == {"files": ("a.csv",)}
    for step in (*opened.session.steps, *opened.session.future):
        assert not step.analysis.up_to_date and not step.analysis.diagnosis_up_to_date
    assert opened.session.analysis.identification is not None
    urdf = measurements.path / "robot.urdf"
    urdf.write_text(urdf.read_text().replace('mass value="4"', 'mass value="4.5"'))
    assert open_session(folder).changed == ("robot.urdf", "a.csv")


def test_data_that_change_after_reading_are_not_taken_for_those_of_the_results(kept: Kept) -> None:
    measurements, session, folder = kept
    table = measurements.path / "a.csv"
    table.write_text(table.read_text().replace("\n0,", "\n0.0,", 1))
    save_session(session, measurements, folder)
    assert open_session(folder).changed == ("a.csv",)
    with pytest.raises(InputError, match=r"a\.csv changed since the set was read"):
        require_unchanged(measurements)
    require_unchanged(read_set(measurements.path))


def test_a_session_can_be_saved_after_its_set_has_been_removed(kept: Kept, tmp_path: Path) -> None:
    measurements, session, _ = kept
    shutil.move(measurements.path, tmp_path / "away")
    folder = save_session(session, measurements, tmp_path / "later")
    assert relocate(folder, tmp_path / "away").session.past


def test_what_another_program_has_saved_is_not_overwritten(kept: Kept) -> None:
    measurements, session, folder = kept
    save = "from flexviz.content.session import open_session; o = open_session({!r}); o.save()"
    subprocess.run([sys.executable, "-c", save.format(str(folder))], cwd=ROOT, check=True)
    theirs = (folder / SESSION_FILE).read_bytes()
    with pytest.raises(SessionChanged, match="saved by another program meanwhile"):
        save_session(session.with_note("mine"), measurements, folder)
    assert (folder / SESSION_FILE).read_bytes() == theirs
    open_session(folder).save()  # once theirs is read, it may be continued
    open_session(folder).save()


def test_the_fingerprint_is_that_of_the_files(kept: Kept) -> None:
    measurements, _, folder = kept
    found = fingerprint(measurements)
    assert {f.name for f in found.files} == {
        "measurements.toml", "robot.urdf", "a.csv", "b.parquet", "sub/c.csv"
    }  # fmt: skip
    assert all(files.sha256_of(measurements.path / f.name) == f.sha256 for f in found.files)
    assert json.loads((folder / SESSION_FILE).read_text())["set"]["sha256"] == found.sha256


def test_a_session_is_not_taken_for_a_set(made: Kept) -> None:
    with pytest.raises(InputError, match=r"kept: is a saved session, expected the measurement set"):
        read_set(made[2])


# -- versions ------------------------------------------------------------------------------------------------


def test_a_session_of_format_1_opens_and_is_saved_as_todays(tmp_path: Path) -> None:
    folder = write_small_set(tmp_path / "old")
    for name in ("session.json", "session.npz"):
        shutil.copy(ROOT / "tests" / "fixtures" / "session_format_1" / name, folder)
    assert json.loads((folder / SESSION_FILE).read_text())["format"] == 1
    opened = open_session(folder)
    session = opened.session
    assert [step.label for step in session.steps] == ["opened small", "identified", "looked", "offset"]
    assert session.redoes == "width" and not opened.changed and not session.notes
    result, diagnosis = session.analysis.identification, session.analysis.diagnosis
    assert result is not None and diagnosis is not None and diagnosis.guard is not None
    assert result.residuals["g1"].residual.shape == (9, 2) and session.past[-1].analysis.up_to_date
    save_session(session, opened.measurements, folder)
    assert json.loads((folder / SESSION_FILE).read_text())["format"] == FORMAT
    assert not (folder / "session.npz").exists()
    again = open_session(folder).session.analysis.identification
    assert again is not None and np.array_equal(again.covariance, result.covariance)


FORMAT_2_CURVE_NOTE = "a stopgap drawn through the residual, not a model: it says where, not why"


def test_a_session_of_format_2_opens_and_is_saved_as_todays(tmp_path: Path) -> None:
    folder = write_small_set(tmp_path / "small")
    shutil.copytree(ROOT / "tests" / "fixtures" / "session_format_2", folder, dirs_exist_ok=True)
    opened = open_session(folder)
    session = opened.session
    assert [step.label for step in session.steps] == ["opened small", "identified", "looked", "offset"]
    assert session.redoes == "width" and not opened.changed and session.notes[0].text == "a note"
    result, diagnosis = session.analysis.identification, session.analysis.diagnosis
    assert result is not None and diagnosis is not None
    expected = DIAGNOSIS.to_dict()  # free curve, guard and typed notes included
    expected["free_curve"]["note"] = FORMAT_2_CURVE_NOTE  # saved in the words of that version
    assert diagnosis.to_dict() == expected
    assert session.analysis.model_steps[0].step.groups == DIAGNOSIS.steps[0].groups
    save_session(session, opened.measurements, folder)
    assert json.loads((folder / SESSION_FILE).read_text())["format"] == FORMAT
    again = open_session(folder).session.analysis.diagnosis
    assert again is not None and again.notes == diagnosis.notes == DIAGNOSIS.notes


def spoiled(change: Callable[[Any], None]) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        document = json.loads((folder / SESSION_FILE).read_text())
        change(document)
        (folder / SESSION_FILE).write_text(json.dumps(document))

    return spoil


def swap_results(folder: Path) -> None:
    first, second = sorted(folder.glob("results/*.npz"))[:2]
    first.write_bytes(second.read_bytes())


@pytest.mark.parametrize(
    "spoil, said",
    [
        (spoiled(lambda d: d.update(format=99, flexviz="9.9")), "format 99 by flexviz 9.9"),
        (spoiled(lambda d: d.update(format=True)), '"format" is True'),
        (spoiled(lambda d: d.update(set=None)), "reference to a measurement set"),
        (spoiled(lambda d: d["set"].update(path=7)), "something other than names"),
        (spoiled(lambda d: d["arrays"][0].update(file="../../etc/passwd")), "list of arrays"),
        (spoiled(lambda d: d["arrays"][0].update(count=1)), "expected 1"),
        (spoiled(lambda d: d.update(notes=["x"])), "notes"),
        (spoiled(lambda d: d.pop("arrays")), "arrays"),
        (swap_results, "results/"),
        (lambda folder: next(folder.glob("results/*.npz")).unlink(), "No such file"),
    ],
)
def test_what_is_wrong_is_said(kept: Kept, spoil: Callable[[Path], None], said: str) -> None:
    folder = kept[2]
    spoil(folder)
    with pytest.raises(InputError, match=rf"session\.json.*{said}"):
        open_session(folder)


def test_flipped_bits_of_results_are_one_line(kept: Kept) -> None:
    folder = kept[2]
    file = sorted(folder.glob("results/*.npz"))[0]
    whole, rng = file.read_bytes(), np.random.default_rng(0)
    for at in (*range(20), *rng.integers(len(whole), size=20)):
        spoilt = bytearray(whole)
        spoilt[at] ^= 1 << int(rng.integers(8))
        file.write_bytes(spoilt)
        try:
            open_session(folder)
        except InputError as error:
            assert "results/" in str(error)


def values_in(document: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The path of every plain value."""
    inside = document.items() if isinstance(document, dict) else enumerate(document)
    for key, value in inside:
        if isinstance(value, dict | list):
            yield from values_in(value, (*path, key))
        else:
            yield (*path, key)


def test_fields_of_a_wrong_type_are_one_line(kept: Kept) -> None:
    folder = kept[2]
    text = (folder / SESSION_FILE).read_text()
    paths = [path for path in values_in(json.loads(text)) if path[0] in ("present", "shared", "notes")]
    rng = np.random.default_rng(0)
    refused = 0
    for number in rng.choice(len(paths), 60, replace=False):
        document = json.loads(text)
        *above, last = paths[number]
        place = document
        for key in above:
            place = place[key]
        place[last] = [7, "x", None, True, [], {"~": "nan"}][rng.integers(6)]
        (folder / SESSION_FILE).write_text(json.dumps(document))
        try:
            analysis = open_session(folder).session.analysis
            for result in (analysis.identification, analysis.diagnosis):
                if result is not None:
                    result.to_dict()
        except InputError as error:
            refused += 1
            assert "session.json" in str(error)
    assert refused > 30


# -- unsaved work --------------------------------------------------------------------------------------------


def test_unsaved_work_of_a_dead_process_is_found_and_a_living_ones_is_not(kept: Kept, tmp_path: Path) -> None:
    measurements, session, folder = kept
    root = tmp_path / "unsaved"
    keeper = Autosave(lambda: root)
    keeper.keep(session, measurements)
    keeper.keep(session.with_note("last"), measurements)
    assert keeper.flush() and find_unsaved(root, measurements.path) is None
    keeper.close()
    found = find_unsaved(root, measurements.path)
    assert found is not None and open_session(found.folder).session.notes[-1].text == "last"
    assert find_unsaved(root, measurements.path, folder) == found
    os.utime(folder / SESSION_FILE, (2e9, 2e9))
    assert find_unsaved(root, measurements.path, folder) is None  # that session is newer


def test_a_killed_process_leaves_its_work(kept: Kept, tmp_path: Path) -> None:
    measurements, _, folder = kept
    root = tmp_path / "unsaved"
    run = subprocess.run([sys.executable, "-c", KEEP_AND_DIE, str(folder), str(root)], cwd=ROOT)
    assert run.returncode == -9
    found = find_unsaved(root, measurements.path)
    assert found is not None and open_session(found.folder).session.notes[-1].text == "kept in time"
    again = Autosave(lambda: root)
    opened = open_session(found.folder)
    again.inherit(found, opened.session, opened.measurements)
    assert again.flush() and not found.folder.exists()
    again.saved()
    again.close()
    assert not root.exists()


def test_only_the_newest_left_behind_stay_and_errors_are_told(kept: Kept, tmp_path: Path) -> None:
    measurements, session, _ = kept
    root, told = tmp_path / "unsaved", []
    for number in range(8):
        keeper = Autosave(lambda: root, told.append)
        keeper.keep(session.with_note(str(number)), measurements)
        keeper.close()
    notes = sorted(open_session(file).session.notes[-1].text for file in root.glob(f"*/*/{SESSION_FILE}"))
    assert notes == list("34567") and not told

    def nowhere() -> Path:
        raise InputError("nothing is written into the installed package")

    keeper = Autosave(nowhere, told.append)
    keeper.keep(session, measurements)
    keeper.close()
    assert told == ["unsaved work cannot be kept: nothing is written into the installed package"]
