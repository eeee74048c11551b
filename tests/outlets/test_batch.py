"""Batches of sets: nothing is lost or counted twice, a failing set is a row, the table is read back."""

from __future__ import annotations

import json
import shutil
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as papq
import pytest

from flexviz import FitSettings
from flexviz.base.errors import InputError
from flexviz.outlets.batch import (
    ClusterChoice,
    SetOptions,
    read_batch,
    run_batch,
    set_results,
    tasks,
    working,
)
from flexviz.outlets.batch.cluster import _Spread
from flexviz.outlets.batch.sources import find_sets
from flexviz.outlets.terminal import main
from tests.small_set import write_small_set

HERE = ClusterChoice(workers=1, processes=False)
IDENTIFY = SetOptions(diagnosed=False)


@pytest.fixture
def fleet(tmp_path: Path) -> Path:
    """Four sets, of which one equals another and one cannot be opened, of two robots."""
    folder = tmp_path / "fleet"
    for number, name in enumerate(("a/run1", "a/run2", "b/run10")):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        write_small_set(folder / name)
        edit(folder / name, "format = 1", f"format = 1\ndate = 2026-03-{number + 1:02}")
    shutil.copytree(folder / "a" / "run1", folder / "b" / "run9")
    edit(folder / "b" / "run10", 'robot = "robot.urdf"', 'robot = "lost.urdf"')
    return folder


def edit(folder: Path, old: str, new: str) -> None:
    file = folder / "measurements.toml"
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The paths of all sets that were really worked on."""
    done: list[str] = []
    analyse = working.KINDS["set"]

    def counted(what: Any, where: Any) -> Any:
        done.append(where["path"])
        return analyse(what, where)

    monkeypatch.setitem(working.KINDS, "set", counted)
    return done


def states(rows: Any) -> dict[str, str]:
    return {row.set: row.state for row in rows}


def test_a_run_goes_on_where_it_was_stopped_and_counts_nothing_twice(
    fleet: Path, tmp_path: Path, calls: list[str]
) -> None:
    out = tmp_path / "out"
    heard: list[str] = []
    first = run_batch(
        fleet, out, IDENTIFY, HERE,
        progress=lambda news: heard.append(news.text), should_stop=lambda: "1 of 2" in heard[-1],
    )  # fmt: skip
    assert (first.count.done, first.count.left, first.complete) == (1, 1, False)
    begun = len(calls)  # the second may have begun
    assert sorted(states(read_batch(out)).values()) == ["done", "done", "failed", "not done"]
    second = run_batch(fleet, out, IDENTIFY, HERE)
    assert second.complete and (second.count.kept, second.count.done) == (1, 1)
    third = run_batch(fleet, out, IDENTIFY, HERE)
    assert (third.count.kept, third.count.done) == (2, 0)
    assert repr(third.rows) == repr(second.rows)  # NaN, where an error is not known, equals nothing
    assert len(calls) == begun + 1 <= 3  # neither the first nor the copy of a set is computed again
    rows = {row.set: row for row in third.rows}
    assert repr(rows["a/run1"].parameters) == repr(rows["b/run9"].parameters)
    assert list(rows) == ["a/run1", "a/run2", "b/run9", "b/run10"]  # 9 before 10
    assert {row.robot for row in third.rows} == {"a", "b"}
    failed = rows["b/run10"]
    assert failed.state == "failed" and "lost.urdf" in failed.error and failed.parameters == {}
    other = run_batch(fleet, out, SetOptions(FitSettings(refine=False), diagnosed=False), HERE)
    assert other.count.done == 2  # other options are other tasks


def test_another_program_gives_other_results(
    fleet: Path, tmp_path: Path, calls: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def analysed(what: Any, where: Any) -> Any:
        calls.append(where["path"])
        return {}

    monkeypatch.setitem(working.KINDS, "set", analysed)
    run_batch(fleet, tmp_path / "out", IDENTIFY, HERE)
    monkeypatch.setattr(tasks, "code_sha256", lambda: "changed")
    monkeypatch.setattr(working, "code_sha256", lambda: "changed")
    assert run_batch(fleet, tmp_path / "out", IDENTIFY, HERE).count.done == 2 and len(calls) == 4
    monkeypatch.setattr(working, "code_sha256", lambda: "not installed here")
    rows = run_batch(fleet, tmp_path / "out", SetOptions(), HERE).rows
    assert "other files of flexviz" in rows[0].error and len(calls) == 4


def test_the_table_is_read_back_and_names_its_units(fleet: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    rows = run_batch(fleet, out, IDENTIFY, HERE).rows
    assert repr(read_batch(out)) == repr(list(rows))
    table = papq.read_table(out / "results.parquet")
    k = table.schema.field("stiffness:joint1")
    assert json.loads((k.metadata or {})[b"flexviz"])["unit"] == "Nm/rad"
    document = set_results(out, rows[0])["identification"]
    found = document["stiffness", "joint1"]
    assert table["stiffness:joint1"][0].as_py() == found.value == rows[0].parameters["stiffness:joint1"].value
    assert table["date"].to_pylist()[:2] == ["2026-03-01", "2026-03-02"]
    page = (out / "summary.html").read_text(encoding="utf-8")
    assert "lost.urdf" in page and "b/run10" in page and "<script" not in page
    (out / "results.parquet").write_bytes(b"PAR1 not a table")
    with pytest.raises(InputError, match=r"results\.parquet"):
        read_batch(out)


@pytest.mark.parametrize("lasting", [True, False])
def test_a_failing_set_is_tried_again_if_that_may_help(
    fleet: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lasting: bool
) -> None:
    tried = []

    def fail(what: Any, where: Any) -> Any:
        tried.append(where["path"])
        raise InputError("bad data") if lasting else MemoryError("no room")

    monkeypatch.setitem(working.KINDS, "set", fail)
    out = tmp_path / "out"
    for _ in range(2):
        rows = run_batch(fleet, out, IDENTIFY, HERE).rows
        assert set(states(rows).values()) == {"failed"}
        assert {row.error for row in rows if "lost" not in row.error} == {
            "bad data" if lasting else "MemoryError: no room"
        }
    assert len(tried) == (2 if lasting else 4)
    assert run_batch(fleet, out, IDENTIFY, HERE, retry=True).count.done == 2


def test_a_set_that_changes_meanwhile_is_no_result(fleet: Path, tmp_path: Path) -> None:
    def change(news: Any) -> None:
        if "to do" in news.text:
            edit(fleet / "a" / "run2", "torque_hold = 0.001", "torque_hold = 0.002")

    rows = run_batch(fleet, tmp_path / "out", IDENTIFY, HERE, progress=change).rows
    (changed,) = [row for row in rows if row.set == "a/run2"]
    assert changed.state == "failed" and "has changed since the batch began" in changed.error
    assert states(run_batch(fleet, tmp_path / "out", IDENTIFY, HERE).rows)["a/run2"] == "done"


def test_lists_name_sets_robots_and_dates(fleet: Path) -> None:
    (fleet / "list.txt").write_text("# two sets\na/run1\n\n../fleet/a/run2\n")
    assert [one.robot for one in find_sets(fleet / "list.txt")] == ["a", "../fleet/a"]
    (fleet / "list.csv").write_text("set,robot,date\na/run1,arm 7,2025-01-02\nnowhere,arm 8,\n")
    first, second = find_sets(fleet / "list.csv")
    assert (first.robot, first.date, first.date_from) == ("arm 7", "2025-01-02", "list")
    assert "nowhere" in second.error and not second.sha256
    edit(fleet / "a" / "run1", "date = 2026-03-01\n", "")
    assert find_sets(fleet / "a" / "run1")[0].date_from == "file"
    (fleet / "list.csv").write_text("set,date\na/run1,yesterday\n")
    with pytest.raises(InputError, match=r"row 2, column date.*yesterday"):
        find_sets(fleet / "list.csv")
    (fleet / "list.txt").write_text("{}\nhello\n")
    with pytest.raises(InputError, match=r'list\.txt: none of its lines names a folder, the first is "\{\}"'):
        find_sets(fleet / "list.txt")
    (fleet / "empty").mkdir()
    with pytest.raises(InputError, match="contains no measurement set"):
        find_sets(fleet / "empty")


class LosesOnce:
    """A client whose scheduler is lost with the first task that is handed in."""

    status = "running"

    def __init__(self) -> None:
        self.submitted: list[str] = []

    def submit(self, work: Callable[[str], str], text: str, *, key: str, pure: bool) -> Any:
        self.submitted.append(text)
        future = Done(key, "cancelled" if len(self.submitted) == 1 else "finished", work(text))
        return future

    def cancel(self, futures: Any) -> None:
        assert not futures


class Done:
    """A future that has ended."""

    def __init__(self, key: str, status: str, value: str) -> None:
        self.key, self.status, self._value = key, status, value

    def add_done_callback(self, call: Callable[[Any], None]) -> None:
        call(self)

    def result(self, timeout: float) -> str:
        return self._value


def test_what_is_lost_with_a_scheduler_is_handed_in_again() -> None:
    client: Any = LosesOnce()
    tasks = deque((str(i), f"text {i}") for i in range(5))
    answers = list(_Spread(client, str.upper, tasks, HERE, print).answers(lambda: False))
    assert sorted(answer.text for answer in answers) == [f"TEXT {i}" for i in range(5)]
    assert len(client.submitted) == 6


def test_bad_arguments_end_with_one_line(fleet: Path, tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("mine")
    for arguments, said in (
        ([str(fleet), "--out", str(tmp_path / "full")], "has no batch.json"),
        ([str(tmp_path / "none"), "--out", str(tmp_path / "o")], "does not exist"),
        ([str(fleet), "--out", str(tmp_path / "o"), "--scheduler", "localhost"], "tcp://HOST:PORT"),
        ([str(fleet), "--out", str(tmp_path / "o"), "--observer", "eye"], "eye"),
        ([str(fleet), "--out", str(tmp_path / "o"), "--effect", "magic:joint1"], '"magic" does not exist'),
        ([str(fleet), "--out", str(tmp_path / "o"), "--observer", "eso", "--gains", "1,2"], "--gains"),
    ):
        assert main(["batch", *arguments]) == 2
        assert said in capsys.readouterr().err
    assert [f.name for f in (tmp_path / "full").iterdir()] == ["thesis.txt"] and not (tmp_path / "o").exists()
