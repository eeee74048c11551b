"""Recordings as files: whole, kept when stopped, damaged, truncated, killed at any moment."""

from __future__ import annotations

import random
import resource
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from flexviz.base.errors import ConvergenceError, FlexvizError, InputError
from flexviz.data.measurements import read_set
from flexviz.model.observers import make_observer
from flexviz.outlets.recording import LiveRecording, Recorded, check_recording, record_set
from flexviz.outlets.recording.files import Target, beside
from tests.recorded import Read, readable_part
from tests.small_set import write_small_set

KILLS = 10
THETA = "/groups/g1/measured/theta/joint1"


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return read_set(write_small_set(tmp_path_factory.mktemp("set") / "small"))


@pytest.fixture(scope="module")
def whole(small: Any, tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    observer = make_observer("butterworth-zero-phase", 30.0)
    return record_set(small, None, tmp_path_factory.mktemp("whole") / "demo.rrd", observer, samples=200)


def test_a_whole_file(whole: Recorded) -> None:
    checked = check_recording(whole.file)
    assert (checked.sha256, checked.chunks, checked.confirmed) == (whole.sha256, whole.chunks, True)
    assert THETA in checked.entities
    beside_it = whole.file.with_name("demo.rrd.sha256")
    assert beside_it.read_text() == f"{whole.sha256}  demo.rrd\n"
    subprocess.run(["sha256sum", "--check", "--quiet", beside_it.name], cwd=whole.file.parent, check=True)
    assert sorted(entry.name for entry in whole.file.parent.iterdir()) == ["demo.rrd", "demo.rrd.sha256"]


def test_damage_is_named(whole: Recorded, tmp_path: Path) -> None:
    raw = whole.file.read_bytes()
    turned = bytearray(raw)
    turned[len(raw) // 2] ^= 1
    (tmp_path / "demo.rrd.sha256").write_text(f"{whole.sha256}  demo.rrd\n")
    for name, data, words in (
        ("demo.rrd", bytes(turned), "damaged|readable"),  # found by its SHA-256 where by nothing else
        ("empty.rrd", b"", "Rerun recording"),
        ("garbage.rrd", b"garbage" * 99, "Rerun recording"),
        ("doubled.rrd", raw + raw, f"footer lists {whole.chunks} chunks, found {2 * whole.chunks}"),
    ):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InputError, match=words) as caught:
            check_recording(tmp_path / name)
        assert name in str(caught.value) and "\n" not in str(caught.value)
        assert "is truncated" not in str(caught.value)
    with pytest.raises(InputError, match="cannot be read"):
        check_recording(tmp_path / "nothing.rrd")


@pytest.mark.parametrize("share", [0.999, 0.9, 0.5])
def test_the_readable_part_of_a_truncated_file(whole: Recorded, tmp_path: Path, share: float) -> None:
    raw = whole.file.read_bytes()
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(raw[: int(share * len(raw))])
    with pytest.raises(InputError, match=r"cut\.rrd: is truncated") as caught:
        check_recording(cut)
    written = readable_part(cut)
    assert f"`python -m rerun rrd optimize {cut} -o {written}`" in str(caught.value)
    before, after = Read(whole.file), Read(written)
    assert set(after.batches) <= set(before.batches) and len(after.batches) > 0.3 * len(before.batches)
    for entity in after.batches:
        if "/measured/theta/" in entity:
            for one, other in zip(before.line(entity), after.line(entity), strict=True):
                assert (one == other).all()


def test_stopping_keeps_what_was_recorded(small: Any, tmp_path: Path) -> None:
    for file, place in (("x.rrd", "x.rrd"), ("old.rrd", "old.unfinished.rrd")):
        (tmp_path / "old.rrd").write_text("what was there")
        asked = iter(range(1000))
        written = record_set(small, None, tmp_path / file, should_stop=lambda asked=asked: next(asked) > 3)
        assert not written.complete and written.file == tmp_path / place
        assert check_recording(written.file).confirmed
        content = Read(written.file)
        assert THETA in content.batches and not any("/observers/" in e for e in content.batches)
    assert (tmp_path / "old.rrd").read_text() == "what was there"


def test_a_new_recording_takes_the_place_of_an_old_one(small: Any, tmp_path: Path) -> None:
    for _ in range(2):
        record_set(replace(small, groups=small.groups[:1]), None, tmp_path / "x.rrd", samples=100)
        assert check_recording(tmp_path / "x.rrd").confirmed
        assert sorted(entry.name for entry in tmp_path.iterdir()) == ["x.rrd", "x.rrd.sha256"]


def test_a_failure_leaves_what_was_there(small: Any, tmp_path: Path, monkeypatch: Any) -> None:
    def fails(*arguments: Any) -> None:
        raise ConvergenceError("no shape")

    monkeypatch.setattr("flexviz.outlets.recording.scene.robot_shape", fails)
    (tmp_path / "old.rrd").write_text("what was there")
    for file in ("old.rrd", "new.rrd"):
        with pytest.raises(ConvergenceError):
            record_set(small, None, tmp_path / file)
    assert [entry.name for entry in tmp_path.iterdir()] == ["old.rrd"]
    assert (tmp_path / "old.rrd").read_text() == "what was there"


def test_a_full_disk_is_one_line(small: Any, tmp_path: Path) -> None:
    """Neither a recording at once nor one that grows waits for a file that cannot be written."""
    limit, told = resource.getrlimit(resource.RLIMIT_FSIZE), list[str]()
    resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, limit[1]))
    try:
        with pytest.raises(InputError, match=r"x\.rrd: cannot be written \(File too large\)"):
            record_set(small, None, tmp_path / "x.rrd")
        live = LiveRecording(small, tmp_path / "y.rrd", on_failure=told.append)
        with pytest.raises(FlexvizError, match="File too large"):
            live.close(timeout=30.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    assert len(told) == 1 and "y.rrd: cannot be written (File too large)" in told[0]
    assert not (tmp_path / "x.rrd").exists() and not list(tmp_path.glob(".*"))
    if (tmp_path / "y.rrd").exists():  # what was flushed before
        assert Read(readable_part(tmp_path / "y.rrd")).batches


@pytest.mark.parametrize("out", ["", "nowhere/x.rrd"])
def test_impossible_targets(small: Any, tmp_path: Path, out: str) -> None:
    with pytest.raises(InputError, match=r"expected a file name|does not exist"):
        record_set(small, None, tmp_path / out)


def test_names_that_are_taken(tmp_path: Path) -> None:
    target = Target(tmp_path / "x.rrd")
    assert target.now.name.startswith(".x.rrd.new.") and not target.file.exists()
    target.file.write_text("somebody else's")
    target.appear()
    assert target.now == tmp_path / "x.unfinished.rrd" and target.file.read_text() == "somebody else's"
    assert beside(tmp_path / "x.rrd", "unfinished").name == "x.unfinished-2.rrd"


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_an_interrupted_program_keeps_what_was_recorded(tmp_path: Path, number: int) -> None:
    folder = write_small_set(tmp_path / "small")
    command = [sys.executable, "-m", "flexviz", "record", str(folder), "--out", str(tmp_path / "x.rrd")]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    for line in process.stderr:
        if "iteration" in line:
            break
    process.send_signal(number)
    process.communicate(timeout=120)
    assert process.returncode == (130 if number == signal.SIGINT else 128 + signal.SIGTERM)
    assert check_recording(tmp_path / "x.rrd").confirmed
    content = Read(tmp_path / "x.rrd")
    assert THETA in content.batches and any(e.startswith("/observers/") for e in content.batches)


RECORDER = """
import os, sys, time
from dataclasses import replace
from pathlib import Path
from tests.small_session import small_session
from flexviz.outlets.recording import LiveRecording

folder, moments = Path(sys.argv[1]), [float(moment) for moment in sys.argv[2:]]
measurements, session = small_session(folder / "small")
measurements = replace(measurements, groups=measurements.groups[:1])
result = session.analysis.identification
for number, moment in enumerate(moments):
    child = os.fork()
    if child == 0:
        recording = LiveRecording(measurements, folder / f"{number}.rrd", samples=50)
        recording.started("killed")
        for count in range(10_000):
            recording.iteration(result.iterations[count % len(result.iterations)])
            if count % 7 == 0:
                recording.flush()
                (folder / f"{number}.flushed").write_text(str(count + 1))
    else:
        begun, flushed = time.monotonic(), folder / f"{number}.flushed"
        ready = (  # it has begun; something is flushed; so is more than that
            (folder / f"{number}.rrd").exists, flushed.exists, lambda: int(flushed.read_text() or 0) > 7,
        )[: 1 + number % 3]
        while not all(look() for look in ready) and time.monotonic() - begun < 120.0:
            time.sleep(0.001)
        time.sleep(moment)
        os.kill(child, 9)
        os.waitpid(child, 0)
"""


@pytest.mark.slow
def test_killed_at_any_moment(tmp_path: Path) -> None:
    """Ten recordings killed with -9, in their beginning and later: none loses what was flushed."""
    chance = random.Random(5)
    moments = [f"{chance.uniform(0.0, 0.2):.4f}" for _ in range(KILLS)]
    subprocess.run([sys.executable, "-c", RECORDER, str(tmp_path), *moments], check=True, timeout=300)
    counts = []
    for number in range(KILLS):
        file, flushed = tmp_path / f"{number}.rrd", tmp_path / f"{number}.flushed"
        expected = int(flushed.read_text() or 0) if flushed.exists() else 0
        with pytest.raises(InputError, match="is truncated"):
            check_recording(file)
        content = Read(readable_part(file))
        assert "/__properties/flexviz" in content.batches
        found = len(content.line("/results/1/optimiser/cost", "iteration")[0]) if expected else 0
        assert found >= expected
        counts.append(expected)
    assert len(counts) == KILLS and sum(count > 0 for count in counts) >= KILLS / 4 and max(counts) > 7
