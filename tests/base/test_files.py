"""Leftovers of killed processes are removed later; files of living ones, and of users, are not."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import pytest

from flexviz.base import files
from flexviz.base.files import PART, remove_leftovers, whole_folder, write_whole
from flexviz.content.session import open_session, save_session
from flexviz.outlets.app.uploads import UploadFolder
from tests.small_session import small_session

LONG_AGO = time.time() - 2 * files.ABANDONED


def aged(path: Path) -> Path:
    os.utime(path, (LONG_AGO, LONG_AGO))
    return path


def test_leftovers_are_removed_by_age_and_lock(tmp_path: Path) -> None:
    left, locked, young = (tmp_path / f".{name}.json.abcd1234{PART}" for name in ("left", "locked", "young"))
    somebodys = [tmp_path / ".data.backup.part", tmp_path / "notes.txt"]
    for file in (left, locked, young, *somebodys):
        file.write_text("half")
        aged(file)
    os.utime(young)
    link = tmp_path / f"link{PART}"
    link.symlink_to(somebodys[1])
    with locked.open("r+b") as held:
        assert files.lock(held.fileno())
        remove_leftovers(tmp_path)
    assert not left.exists() and link.is_symlink()
    assert all(file.read_text() == "half" for file in (locked, young, *somebodys))


def test_a_folder_that_was_about_to_be_replaced_is_put_back(tmp_path: Path) -> None:
    """Killed between the two renamings of `whole_folder`."""
    hidden = tmp_path / f".set.v2.abcd1234{PART}"
    for name in (files.OLD, files.NEW):
        (hidden / name).mkdir(parents=True)
        (hidden / name / "x").write_text(name)
    aged(hidden)
    write_whole(tmp_path / "other.json", b"{}")  # the next write there
    assert (tmp_path / "set.v2" / "x").read_text() == files.OLD
    assert sorted(file.name for file in tmp_path.iterdir()) == ["other.json", "set.v2"]


def test_uploads_of_a_killed_server_go_and_those_of_a_running_one_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(files, "_looked_through", set())
    (tmp_path / f"flexviz-upload-abcd1234{PART}").mkdir()
    aged(tmp_path / f"flexviz-upload-abcd1234{PART}")
    running = UploadFolder()
    running.put("a.csv", b"1")
    (own,) = tmp_path.iterdir()
    aged(own)
    files._looked_through.clear()
    UploadFolder().close()
    assert (running.folder / "a.csv").read_bytes() == b"1"
    running.close()
    assert not list(tmp_path.iterdir())


def test_a_write_in_progress_is_locked(tmp_path: Path) -> None:
    with whole_folder(tmp_path / "set") as new:
        remove_leftovers(tmp_path, age=0.0)
        assert new.is_dir()
    assert [entry.name for entry in tmp_path.iterdir()] == ["set"]


def test_a_session_is_saved_by_one_program_at_a_time(tmp_path: Path) -> None:
    measurements, session = small_session(tmp_path / "small")
    folder = save_session(session, measurements, tmp_path / "kept")
    program = f"import filelock, sys\nwith filelock.FileLock({str(folder / files.LOCK)!r}):\n"
    program += "    print('held', flush=True)\n    sys.stdin.read()"
    command = [sys.executable, "-c", program]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None and other.stdout.readline() == "held\n"
        thread = threading.Thread(target=save_session, args=(session.with_note("x"), measurements, folder))
        thread.start()
        thread.join(0.3)
        assert thread.is_alive()
        other.communicate("")
        thread.join(10)
    assert [note.text for note in open_session(folder).session.notes][-1] == "x"
