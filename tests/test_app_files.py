"""Save, reopen, download, report, upload and the quiz, without a browser."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from flexviz.app import workspace
from flexviz.app.application import Application
from flexviz.app.gate import upload_refusal
from flexviz.app.workspace import PRESETS, hideable, output_dir, simulate_quiz
from flexviz.errors import InputError
from flexviz.measurements import read_set
from tests.app_running import running
from tests.small_set import URDF, write_small_set
from tests.test_app import act, status, until
from tests.test_app_uploads import set_files, zip_of


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Application]:
    root = tmp_path_factory.mktemp("files")
    with running(root, write_small_set(root / "small")) as application:
        yield application


def test_save_and_reopen_with_history(app: Application) -> None:
    act(app, "effect-torque_offset", True)
    act(app, "run")
    until(app, lambda: not app.running, 90)
    error = app.session.analysis.identification.residual.rms  # type: ignore[union-attr]
    act(app, "save")
    until(app, lambda: "session saved in ./sessions/small-" in status(app))
    name = next(name for name in app.data._sets if name.startswith("small-"))
    assert app.folder == output_dir() / name and app.data._choice.value == name
    act(app, "set", "small")
    until(app, lambda: app.folder is None)
    assert app.session.analysis.identification is None
    act(app, "set", name)
    until(app, lambda: app.folder is not None)
    again = app.session.analysis
    assert again.effects == ("torque_offset",) and again.up_to_date and "fit" in str(again.roles)
    assert again.identification is not None and list(again.identification.residual.rms) == list(error)
    assert "error" in status(app) and not app.dock._undo.disabled
    act(app, "undo")
    act(app, "undo")
    assert app.session.analysis.effects == ()
    act(app, "save")  # over itself
    until(app, lambda: f"saved in ./sessions/{name}" in status(app))
    assert [folder.name for folder in output_dir().iterdir()] == [name]  # nothing is unsaved either
    act(app, "redo")


def test_download_is_a_zip_of_the_session(app: Application, monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[tuple[str, bytes]] = []
    client = SimpleNamespace(
        send_file_download=lambda name, content, **_: sent.append((name, content)),
        add_notification=lambda *_, **__: None,
    )
    monkeypatch.setattr(app.server, "get_clients", lambda: {7: client})
    act(app, "download", 7)
    until(app, lambda: bool(sent))
    name, content = sent[0]
    assert name.endswith("-session.zip")
    monkeypatch.undo()
    act(app, "upload", (name, content))
    until(app, lambda: app.measurements.path.name.endswith("-session"))
    assert app.session.past


def test_upload_file_by_file_and_a_broken_zip(app: Application, tmp_path: Path) -> None:
    files = set_files(write_small_set(tmp_path / "set"))
    before = app.measurements.path
    for name, content in files.items():
        act(app, "upload", (Path(name).name, content))
    until(app, lambda: app.measurements.path != before)
    assert app.measurements.path.name.startswith("uploaded")
    for content in (b"no zip", zip_of({"../x.csv": b"", "measurements.toml": b""})):
        act(app, "upload", ("x.zip", content))
        until(app, lambda: "bad" in status(app))
        act(app, "step", "Data")
        app.say("")
    act(app, "upload", ("measurements.toml", b"format = 1\n[[groups]]\nfile='no.csv'\n"))
    assert "no.csv" in app.data.another.waiting


def test_a_urdf_alone_is_offered_for_simulation_or_completes_a_set(app: Application, tmp_path: Path) -> None:
    files = set_files(write_small_set(tmp_path / "set"))
    app.data.another._inbox._begin()
    act(app, "upload", ("broken.urdf", b"<robot"))
    assert "bad" in status(app) and "broken.urdf" in status(app) and "/tmp" not in status(app)
    act(app, "upload", ("robot.urdf", files.pop("robot.urdf")))
    robot = app.data.another._robot
    assert robot.value == "robot.urdf" and "2 joints" in app.data.another.waiting
    before = app.measurements.path
    act(app, "upload", ("rest.zip", zip_of(files)))  # a new upload: its own robot is missing
    until(app, lambda: "still missing: robot.urdf" in app.data.another.waiting)
    act(app, "upload", ("robot.urdf", URDF.encode()))
    until(app, lambda: app.measurements.path != before)
    assert app.measurements.path.name == "rest" and robot.options == (*PRESETS, "robot.urdf")


def test_a_report_is_sent_once_there_is_something_to_report(
    app: Application, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert app.data.files._report.disabled and "press" in str(app.data.files._report.hint)
    act(app, "run")
    until(app, lambda: not app.running)
    assert not app.data.files._report.disabled
    sent: list[tuple[str, bytes]] = []
    client = SimpleNamespace(
        send_file_download=lambda name, content, **_: sent.append((name, content)),
        add_notification=lambda *_, **__: None,
    )
    monkeypatch.setattr(app.server, "get_clients", lambda: {7: client})
    act(app, "report", 7)
    until(app, lambda: bool(sent))
    name, content = sent[0]
    assert name.endswith("-report.html") and content.lstrip().lower().startswith(b"<!doctype html")


def test_a_quiz_hides_what_it_hides(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert "coulomb_friction" in hideable() and "external_contact" not in hideable()
    asked: list[Any] = []
    monkeypatch.setattr("flexviz.simulation.simulate_preset", lambda *args, **_: asked.append(args))
    folder = simulate_quiz("planar-2r", workspace.SURPRISE, progress=print, should_stop=bool)
    assert folder.name.startswith("quiz-planar-2r-") and asked[0][2][0].partition(":")[0] in hideable()
    simulate_quiz("panda", "coulomb_friction", progress=print, should_stop=bool)
    assert asked[1][2][0].startswith("coulomb_friction:panda_joint")
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(URDF)
    folder = simulate_quiz(urdf, "coulomb_friction", progress=print, should_stop=bool)
    assert folder.name.startswith("quiz-arm-") and asked[2][0] == urdf and asked[2][2][0][-1] in "12"
    simulate_quiz("panda", workspace.NOTHING, progress=print, should_stop=bool)
    assert asked[3][2] == []
    for preset, effect in (("no", "coulomb_friction"), ("panda", "no")):
        with pytest.raises(InputError):
            simulate_quiz(preset, effect, progress=print, should_stop=bool)


@pytest.mark.slow
def test_a_real_quiz_opens_and_keeps_its_secret(app: Application) -> None:
    app.data.another.effect.value = "torque_offset"
    act(app, "quiz")
    until(app, lambda: app.measurements.path.name.startswith("quiz-"), 90)
    assert "offset" not in status(app) and app.truth is not None
    truth = json.loads((app.measurements.path / "truth.json").read_text())
    assert truth["effects"][0]["effect"] == "torque_offset"
    assert read_set(app.measurements.path).effects == ()


def test_nothing_is_written_into_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    import flexviz

    monkeypatch.chdir(Path(flexviz.__file__).parent)
    with pytest.raises(InputError, match="installed package"):
        output_dir()


def test_what_may_be_uploaded(app: Application) -> None:
    button = app.data.another.upload
    good = {"size_bytes": 3000, "part_count": 1, "filename": "a.zip", "transfer_uuid": "t"}

    def refusal(handle: Any = button, running: int = 0, **changes: Any) -> str:
        return upload_refusal(handle, SimpleNamespace(**(good | changes)), running)

    assert refusal() == "" and refusal(size_bytes=0, part_count=0) == ""
    assert refusal(None) and refusal(app.data.another.quiz) and refusal(running=9)
    for changes in (
        {"size_bytes": 2**40}, {"size_bytes": -1}, {"size_bytes": "3"}, {"size_bytes": True},
        {"part_count": 99}, {"filename": ""}, {"filename": "x" * 999}, {"filename": 3}, {"transfer_uuid": 3},
    ):  # fmt: skip
        assert refusal(button, 0, **changes), changes


def test_the_downloaded_zip_is_plain(app: Application) -> None:
    from flexviz.session import zipped

    with zipfile.ZipFile(io.BytesIO(zipped(app.measurements.path))) as archive:
        assert all(not name.startswith("/") and ".." not in name for name in archive.namelist())
