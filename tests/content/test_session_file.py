"""A session in a folder: everything comes back, and nothing but what was saved."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.base.errors import InputError
from flexviz.content.session import SESSION_FILE, Session, is_session, open_session, save_session, zipped
from flexviz.data.measurements import MeasurementSet, read_set
from tests.found import DIAGNOSIS, TIED_DIAGNOSIS
from tests.small_session import small_session


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[MeasurementSet, Session]:
    return small_session(tmp_path_factory.mktemp("session") / "small")


@pytest.fixture(scope="module")
def measurements(both: tuple[MeasurementSet, Session]) -> MeasurementSet:
    return both[0]


@pytest.fixture(scope="module")
def session(both: tuple[MeasurementSet, Session]) -> Session:
    return both[1]


def test_everything_comes_back(session: Session, measurements: MeasurementSet, tmp_path: Path) -> None:
    folder = save_session(session, measurements, tmp_path / "kept")
    opened = open_session(folder)
    again = opened.session
    assert again.analysis.effects == ("torque_offset:joint1",)
    assert [s.label for s in again.past] == [s.label for s in session.past] and again.redoes == "width"
    assert again.redo().analysis.fit.bandwidth == (30.0, 40.0)
    before, after = session.analysis.identification, again.analysis.identification
    assert before is not None and after is not None
    assert after is again.past[-1].analysis.identification  # one result, not one a step
    assert after.to_dict() == before.to_dict()
    for name, series in before.residuals.items():
        assert np.array_equal(series.residual, after.residuals[name].residual)
    assert again.analysis.diagnosis is not None and again.analysis.diagnosis.to_dict() == DIAGNOSIS.to_dict()
    assert again.past[-1].analysis.diagnosis_up_to_date and again.past[-1].analysis.up_to_date
    assert again.analysis.model_steps[0].step.groups == DIAGNOSIS.steps[0].groups
    assert again.analysis.path == opened.measurements.path == measurements.path
    assert not (folder / "measurements.toml").exists() and not opened.changed


def test_a_diagnosis_keeps_its_families_and_its_trace(measurements: MeasurementSet, tmp_path: Path) -> None:
    session = Session.of(measurements)
    session = session.then("diagnosed", session.analysis.with_diagnosis(TIED_DIAGNOSIS))
    folder = save_session(session, measurements, tmp_path / "kept")
    again = open_session(folder).session.analysis.diagnosis
    assert again is not None and again.findings[0].family == TIED_DIAGNOSIS.findings[0].family
    assert again.trace == TIED_DIAGNOSIS.trace and again.decoys == TIED_DIAGNOSIS.decoys
    added = session.analysis.with_effects(["coulomb_friction:joint2"]).with_diagnosis(DIAGNOSIS)
    later = save_session(session.then("added", added), measurements, tmp_path / "later")
    families = (("coulomb_friction:joint2", "dry_friction"),)
    assert open_session(later).session.analysis.model_steps[-1].families == families
    file = folder / SESSION_FILE
    document = json.loads(file.read_text())
    for packed in document["shared"]:  # as earlier versions wrote it
        for key in ("trace", "decoys"):
            packed.pop(key, None)
        for finding in packed.get("findings", []):
            finding.pop("family", None)
    file.write_text(json.dumps(document))
    old = open_session(folder).session.analysis.diagnosis
    assert old is not None and old.findings[0].family is None and old.trace == () and old.decoys is None


def test_a_set_without_session_has_none(measurements: MeasurementSet) -> None:
    assert not is_session(measurements.path) and not open_session(measurements.path).session.past


def test_it_is_saved_again_over_itself_but_over_nothing_else(
    session: Session, measurements: MeasurementSet, tmp_path: Path
) -> None:
    folder = save_session(session, measurements, tmp_path / "kept")
    opened = open_session(folder)
    save_session(opened.session.undo(), opened.measurements, folder)
    assert open_session(folder / SESSION_FILE).session.redoes == "offset"
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").write_text("x")
    with pytest.raises(InputError, match="not empty"):
        save_session(session, measurements, tmp_path / "full")
    save_session(session, measurements, tmp_path / "carried", carry=True)
    with zipfile.ZipFile(io.BytesIO(zipped(tmp_path / "carried"))) as archive:
        assert (
            f"carried/{SESSION_FILE}" in archive.namelist()
            and "carried/measurements.toml" in archive.namelist()
        )


def spoil(document: Any, what: str) -> Any:
    present = document["present"]
    if what == "kind":
        present["analysis"] = "Popen"
    elif what == "roles":
        present["analysis"]["roles"] = [["g1", "fit"]]
    elif what == "effect":
        present["analysis"]["fit"]["effects"] = ["no_such"]
    elif what == "observer":
        present["analysis"]["fit"]["observer"] = "no_such"
    elif what == "reference":
        present["analysis"]["identification"] = {"@": 99}
    elif what == "path":
        present["analysis"]["path"] = "/etc"
    elif what == "format":
        document["format"] = 99
    elif what == "lacks":
        del present["label"]
    elif what == "deep":
        present["label"] = json.loads("[" * 60 + "]" * 60)
    elif what == "list":
        return []
    return document


@pytest.mark.parametrize(
    "what",
    [
        "kind",
        "roles",
        "effect",
        "observer",
        "reference",
        "path",
        "format",
        "lacks",
        "deep",
        "list",
        "text",
        "arrays",
    ],
)
def test_a_spoiled_one_says_so(
    session: Session, measurements: MeasurementSet, tmp_path: Path, what: str
) -> None:
    folder = save_session(session, measurements, tmp_path / "kept")
    file = folder / SESSION_FILE
    if what == "text":
        file.write_text("{")
    elif what == "arrays":
        next(folder.glob("results/*.npz")).write_bytes(b"PK nonsense")
    else:
        file.write_text(json.dumps(spoil(json.loads(file.read_text()), what)))
    with pytest.raises(InputError, match=SESSION_FILE.replace(".", r"\.")):
        open_session(folder)


@pytest.mark.slow
def test_everything_a_diagnosis_carries_can_be_kept(tmp_path: Path) -> None:
    from flexviz.analysis.diagnosis import Diagnosis, diagnose
    from flexviz.base.resources import sessions_dir
    from flexviz.content.session.packing import Packer, Unpacker, numbers

    found = diagnose(read_set(sessions_dir() / "planar-2r-demo"), apply=True, guard=True)
    packer = Packer(tmp_path)
    packed = numbers(packer.pack(found))
    again = Unpacker(tmp_path, packer.arrays, packer.shared).unpack(Diagnosis, packed)
    assert again.to_dict() == found.to_dict() and found.maps and found.guard is not None
    assert [m.variable for m in again.maps] == [m.variable for m in found.maps]
    assert [p.name for p in again.guard.parameters] == [p.name for p in found.guard.parameters]
