"""Recordings of earlier versions still open: tests/fixtures keeps one from before charts were pictures."""

from __future__ import annotations

import hashlib
import lzma
from pathlib import Path

import pytest

from flexviz.content.comparing import compare
from flexviz.outlets.recording import check_recording, read_recording
from tests.recorded import Read

KEPT = Path(__file__).parents[1] / "fixtures" / "recording_format_1.rrd.xz"


@pytest.fixture(scope="module")
def old(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("old") / "old.rrd"
    file.write_bytes(lzma.decompress(KEPT.read_bytes()))
    return file


def test_an_old_recording_is_read(old: Path) -> None:
    assert KEPT.stat().st_size < 200_000
    checked = check_recording(old)
    assert checked.complete and checked.sha256 == hashlib.sha256(old.read_bytes()).hexdigest()
    found = read_recording(old)
    assert (found.joints, found.groups) == (("joint1", "joint2"), ("g1",))
    assert found.result["effects"] == ["coulomb_friction:joint1", "coulomb_friction:joint2"]
    stiffness = next(p for p in found.result["parameters"] if p["name"] == "stiffness")
    assert stiffness["value"] > 0 and found.diagnoses[-1]["verdict"] == "missing"
    assert len(Read(old).line("/groups/g1/measured/theta/joint1")[1]) >= 20


def test_an_old_recording_is_compared(old: Path) -> None:
    one = read_recording(old)
    found = compare([one.known, one.known])
    assert not any(row.differs for row in found.rows) and len(found.rows) > 8
    assert "/diagnoses/1/staircase/all/words" in Read(old).batches
