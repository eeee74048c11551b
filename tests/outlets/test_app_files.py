"""Save, reopen, download, report, upload and the quiz, without a browser."""

from __future__ import annotations

import io
import json
import shutil
import zipfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from flexviz.base.errors import InputError
from flexviz.base.progress import ignore, never
from flexviz.base.resources import sessions_dir
from flexviz.content.session import SESSION_FILE
from flexviz.data.measurements import read_set
from flexviz.outlets.app import DEMO, workspace
from flexviz.outlets.app.application import Application
from flexviz.outlets.app.input_rules import upload_refusal
from flexviz.outlets.app.steps.another_set import AnotherSet
from flexviz.outlets.app.steps.data import DataStep
from flexviz.outlets.app.workspace import PRESETS, SimulateQuiz, hideable, output_dir
from tests.app_running import BROWSER, command, control, reopen, running, status, until, upload, use, wait
from tests.outlets.test_app_uploads import set_files, zip_of
from tests.robot.test_bad_robots import chain
from tests.small_set import URDF, write_small_set


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Application]:
    root = tmp_path_factory.mktemp("files")
    with running(root, write_small_set(root / "small")) as application:
        yield application


def data(app: Application) -> DataStep:
    return next(step for step in app.dock.steps if isinstance(step, DataStep))


def another(app: Application) -> AnotherSet:
    return data(app).another


def test_save_and_reopen_with_history(app: Application) -> None:
    use(app, "Torque offset", True)
    use(app, "Run")
    wait(app)
    error = app.store.analysis.identification.residual.rms  # type: ignore[union-attr]
    use(app, "Save session")
    until(app, lambda: "session saved in ./sessions/small-" in status(app))
    name = next(name for name in data(app)._sets if name.startswith("small-"))
    assert app.store.folder == output_dir() / name and data(app)._choice.value == name
    use(app, "Measurement set", "small")
    until(app, lambda: app.store.folder is None)
    assert app.store.analysis.identification is None
    use(app, "Measurement set", name)
    until(app, lambda: app.store.folder is not None)
    again = app.store.analysis
    assert again.effects == ("torque_offset",) and again.up_to_date and "fit" in str(again.roles)
    assert again.identification is not None and list(again.identification.residual.rms) == list(error)
    assert "error" in status(app) and not app.dock._undo.disabled
    use(app, "Undo")
    use(app, "Undo")
    assert app.store.analysis.effects == ()
    use(app, "Save session")  # over itself
    until(app, lambda: f"saved in ./sessions/{name}" in status(app))
    assert [folder.name for folder in output_dir().iterdir()] == [name]  # nothing is unsaved either
    use(app, "Redo")


def test_a_save_by_another_program_is_kept(app: Application) -> None:
    use(app, "Save session")
    until(app, lambda: "session saved in" in status(app))
    folder = app.store.folder
    assert folder is not None
    theirs = (folder / SESSION_FILE).read_text() + "\n"
    (folder / SESSION_FILE).write_text(theirs)
    app.store.say("")
    use(app, "Save session")
    until(app, lambda: f"{folder.name} is left as it is" in status(app))
    assert app.store.folder != folder and (folder / SESSION_FILE).read_text() == theirs


def test_data_that_change_are_not_fitted_for_the_old_ones(app: Application, tmp_path: Path) -> None:
    folder = write_small_set(tmp_path / "changing")
    reopen(app, folder)
    use(app, "Run")
    wait(app)
    before = app.store.analysis.identification
    table = folder / "a.csv"
    table.write_text(table.read_text().replace("\n0,", "\n0.0,", 1))
    use(app, "Run")
    wait(app)
    assert "a.csv changed since the set was read" in status(app)
    assert app.store.analysis.identification is before is not None
    command(app, "Read the data again")
    until(app, lambda: app.store.analysis.identification is None)
    use(app, "Run")
    wait(app)
    assert app.store.analysis.identification is not None
    shutil.move(folder, tmp_path / "away")
    use(app, "Save session")
    until(app, lambda: "session saved in" in status(app))
    shutil.move(tmp_path / "away", folder)


def test_download_is_a_zip_of_the_session(app: Application, monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[tuple[str, bytes]] = []
    client = SimpleNamespace(
        send_file_download=lambda name, content, **_: sent.append((name, content)),
        add_notification=lambda *_, **__: None,
    )
    monkeypatch.setattr(app.page.server, "get_clients", lambda: {BROWSER: client})
    use(app, "Download session")
    until(app, lambda: bool(sent))
    name, content = sent[0]
    assert name.endswith("-session.zip")
    monkeypatch.undo()
    upload(app, name, content)
    until(app, lambda: app.store.measurements.path.name.endswith("-session"))
    assert app.store.session.past


def test_upload_file_by_file_and_a_broken_zip(app: Application, tmp_path: Path) -> None:
    files = set_files(write_small_set(tmp_path / "set"))
    before = app.store.measurements.path
    for name, content in files.items():
        upload(app, Path(name).name, content)
    until(app, lambda: app.store.measurements.path != before)
    assert app.store.measurements.path.name.startswith("uploaded")
    for content in (b"no zip", zip_of({"../x.csv": b"", "measurements.toml": b""})):
        upload(app, "x.zip", content)
        until(app, lambda: "bad" in status(app))
        app.store.say("")
    upload(app, "measurements.toml", b"format = 1\n[[groups]]\nfile='no.csv'\n")
    assert "no.csv" in another(app)._waiting.content


def test_a_urdf_alone_is_offered_for_simulation_or_completes_a_set(app: Application, tmp_path: Path) -> None:
    files = set_files(write_small_set(tmp_path / "set"))
    another(app)._uploads.begin()
    for content, why in ((b"<robot", "not valid XML"), (chain(5000).encode(), "5001 links")):
        upload(app, "broken.urdf", content)
        until(app, lambda: "bad" in status(app))
        assert why in status(app) and "broken.urdf" in status(app) and "/tmp" not in status(app)
        app.store.say("")
    upload(app, "robot.urdf", files.pop("robot.urdf"))
    robot = another(app)._robot
    until(app, lambda: "robot.urdf uploaded" in status(app))
    assert robot.value == "robot.urdf" and "2 joints" in another(app)._waiting.content
    before = app.store.measurements.path
    upload(app, "rest.zip", zip_of(files))  # a new upload: its own robot is missing
    until(app, lambda: "still missing: robot.urdf" in another(app)._waiting.content)
    upload(app, "robot.urdf", URDF.encode())
    until(app, lambda: app.store.measurements.path != before)
    assert app.store.measurements.path.name == "rest" and robot.options == (*PRESETS, "robot.urdf")


@pytest.mark.slow
def test_pages_are_sent_once_there_is_something_to_show(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pages = "Report", "Animation"
    with running(tmp_path, sessions_dir() / DEMO) as app:
        assert all(control(app, page).disabled and "press" in str(control(app, page).hint) for page in pages)
        use(app, "Run")
        wait(app)
        assert not any(control(app, page).disabled for page in pages)
        sent: dict[str, bytes] = {}
        client = SimpleNamespace(
            send_file_download=lambda name, content, **_: sent.update({name: content}),
            add_notification=lambda *_, **__: None,
        )
        monkeypatch.setattr(app.page.server, "get_clients", lambda: {BROWSER: client})
        for count, page in enumerate(pages, start=1):
            use(app, page)
            until(app, lambda count=count: len(sent) == count)
            name, content = [*sent.items()][-1]
            assert name.endswith(f"-{page.lower()}.html") and content.lstrip().lower().startswith(
                b"<!doctype html"
            )
    both = [*sent.values()]
    assert b"requestAnimationFrame" in both[1] and b"requestAnimationFrame" not in both[0]


def test_a_quiz_hides_what_it_hides(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert "coulomb_friction" in hideable() and "external_contact" not in hideable()
    asked: list[Any] = []
    monkeypatch.setattr(workspace, "simulate_preset", lambda *args, **_: asked.append(args))
    folder = SimulateQuiz("planar-2r", workspace.SURPRISE).run(ignore, never)
    assert folder.name.startswith("quiz-planar-2r-") and asked[0][2][0].partition(":")[0] in hideable()
    SimulateQuiz("panda", "coulomb_friction").run(ignore, never)
    assert asked[1][2][0].startswith("coulomb_friction:panda_joint")
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(URDF)
    folder = SimulateQuiz(urdf, "coulomb_friction").run(ignore, never)
    assert folder.name.startswith("quiz-arm-") and asked[2][0] == urdf and asked[2][2][0][-1] in "12"
    SimulateQuiz("panda", workspace.NOTHING).run(ignore, never)
    assert asked[3][2] == []
    for preset, effect in (("no", "coulomb_friction"), ("panda", "no")):
        with pytest.raises(InputError):
            SimulateQuiz(preset, effect).run(ignore, never)


def test_a_real_quiz_opens_and_keeps_its_secret(app: Application) -> None:
    use(app, "Hide", "Torque offset")
    use(app, "Quiz me")
    until(app, lambda: app.store.measurements.path.name.startswith("quiz-"))
    assert "offset" not in status(app) and app.store.opened.truth is not None
    truth = json.loads((app.store.measurements.path / "truth.json").read_text())
    assert truth["effects"][0]["effect"] == "torque_offset"
    assert read_set(app.store.measurements.path).effects == ()


def test_nothing_is_written_into_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    import flexviz

    monkeypatch.chdir(Path(flexviz.__file__).parent)
    with pytest.raises(InputError, match="installed package"):
        output_dir()


def test_what_may_be_uploaded(app: Application) -> None:
    button = another(app).upload
    good = {"size_bytes": 3000, "part_count": 1, "filename": "a.zip", "transfer_uuid": "t"}

    def refusal(handle: Any = button, running: int = 0, **changes: Any) -> str:
        return upload_refusal(handle, SimpleNamespace(**(good | changes)), running)

    assert refusal() == "" and refusal(size_bytes=0, part_count=0) == ""
    assert refusal(None) and refusal(another(app).quiz) and refusal(running=9)
    for changes in (
        {"size_bytes": 2**40}, {"size_bytes": -1}, {"size_bytes": "3"}, {"size_bytes": True},
        {"part_count": 99}, {"filename": ""}, {"filename": "x" * 999}, {"filename": 3}, {"transfer_uuid": 3},
    ):  # fmt: skip
        assert refusal(button, 0, **changes), changes


def test_the_downloaded_zip_is_plain(app: Application) -> None:
    from flexviz.content.session import zipped

    with zipfile.ZipFile(io.BytesIO(zipped(app.store.measurements.path))) as archive:
        assert all(not name.startswith("/") and ".." not in name for name in archive.namelist())
