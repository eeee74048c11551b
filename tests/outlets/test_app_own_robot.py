"""One's own robot in step Data, without a browser: what is refused, kept, asked for and remedied."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from flexviz.content.rendering import panel
from flexviz.content.topics import set_blocks
from flexviz.data.measurements import read_set
from flexviz.outlets.app.application import Application
from flexviz.outlets.app.steps.own_robot import OwnRobot
from flexviz.robot.robot import Robot
from tests.app_running import act, command, control, running, send, status, until, upload, use, wait
from tests.import_data import truth, write_robot
from tests.small_set import URDF, write_small_set


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Application]:
    folder = tmp_path_factory.mktemp("own")
    with running(folder, write_small_set(folder / "small")) as application:
        yield application


def own(app: Application) -> OwnRobot:
    return app.dock.steps[0].own  # type: ignore[attr-defined]


def log(seed: int, header: str = "t,q1,q2,tau1,tau2", factor: float = 1.0) -> bytes:
    """A CSV of the small arm; `factor` multiplies the torques."""
    run = truth(seed)
    rows = np.column_stack((run.time, run.theta, factor * run.tau))
    lines = [";".join(header.split(",")), *(";".join(f"{value:.7g}" for value in row) for row in rows)]
    return "\n".join(lines).encode()


def begin(app: Application, **files: bytes) -> None:
    """Drop these files (`_` for the last point of their names) and wait for the form."""
    own(app).close()
    add(app, **files)


def small_robot() -> Robot:
    """The small arm, upright."""
    with TemporaryDirectory() as folder:
        return Robot.load(write_robot(Path(folder)))


def add(app: Application, **files: bytes) -> None:
    app.queue.call(app.page._announced, f'{{"files": {len(files)}, "skipped": []}}')
    for name, content in files.items():
        upload(app, ".".join(name.rsplit("_", 1)), content)
    until(app, lambda: not app.store.running)


def table(app: Application) -> str:
    return own(app)._table.content


def test_what_names_and_data_tell_needs_nothing_more(app: Application) -> None:
    begin(app, arm_urdf=URDF.encode(), run1_csv=log(0), run2_csv=log(1))
    form = own(app)
    assert "Checked:" in form._state.content and "contradict these columns" in form._state.content
    assert (
        form._run_table.content.count("validate") == 1
        and "Nothing leaves this machine." in form._files.content
    )
    use(app, "Set name", "../../my <arm>")
    use(app, "Open")
    until(app, lambda: app.store.measurements.path.name == "my _arm")
    measurements = app.store.measurements
    assert measurements.path.parent == Path.cwd() / "sessions" and not form.folder.visible
    assert [group.validation for group in read_set(measurements.path).groups] == [False, True]
    assert np.abs(measurements.groups[0].segments[0].theta - truth(0).theta).max() < 1e-6


def test_a_doubt_has_its_remedy_as_a_button(app: Application) -> None:
    begin(app, arm_urdf=URDF.encode(), run_csv=log(0))
    use(app, "Correct", "τ of joint2")
    use(app, "Sign", "− (reversed)")
    assert "sign reversed" in table(app) and "Changed since the last check" in own(app)._state.content
    before = app.store.measurements.path
    use(app, "Open")
    wait(app)
    assert "contradict 1 entry" in own(app)._state.content and "Wrong: tau of joint2" in table(app)
    assert app.store.measurements.path == before and not list(Path("sessions").glob("arm*"))
    (remedy,) = [button for button in own(app)._remedies if button.visible]
    assert remedy.label == "τ of joint2: sign +"
    send(app, remedy)
    wait(app)
    assert "Wrong" not in table(app) and "sign reversed" not in table(app)
    assert "Checked" in own(app)._state.content and not remedy.visible


def test_a_robot_under_a_ceiling_is_opened_as_it_hangs(app: Application) -> None:
    run = truth(0)
    still = np.zeros_like(run.q)
    weight = small_robot().cad_torques((), run.q, still, still)
    rows = np.column_stack((run.time, run.theta, run.tau - 2.0 * weight))
    hanging = "\n".join(["t,q1,q2,tau1,tau2", *(",".join(f"{x:.7g}" for x in row) for row in rows)])
    begin(app, ceiling_urdf=URDF.encode(), run_csv=hanging.encode())
    use(app, "Gravity along", "+z: under a ceiling")
    for joint in ("joint1", "joint2"):  # whatever was concluded of an upright robot
        use(app, "Correct", f"τ of {joint}")
        use(app, "Sign", "+")
    use(app, "Open")
    until(app, lambda: app.store.measurements.path.name == "ceiling")
    robot = app.store.measurements.robot
    assert robot.gravity == (0.0, 0.0, 9.81)
    turned = robot.link_poses(np.array([0.5, 0.0]))["link2"][:3, 3]
    upright = small_robot().link_poses(np.array([0.5, 0.0]))["link2"][:3, 3]
    np.testing.assert_allclose(turned, upright * [1.0, -1.0, -1.0], atol=1e-12)
    assert "under a ceiling, gravity = [0, 0, 9.81] m/s²" in panel(set_blocks(app.store.measurements))
    command(app, "Read the data again")


def test_files_that_cannot_be_used_are_refused_by_name(app: Application) -> None:
    own(app).close()
    app.queue.call(app.page._announced, '{"files": 5, "skipped": [["big.bag", 900000000], ["void.csv", 0]]}')
    files = {
        "arm.urdf": URDF.encode(),
        "run.csv": log(0),
        "short.csv": b"t,q1\n0,1\n",
        "virus.exe": b"",
        "old.urdf.xacro": b"<robot/>",
    }
    for name, content in files.items():
        upload(app, name, content)
    until(app, lambda: not app.store.running)
    said = own(app)._files.content
    assert "Logs: run.csv." in said
    for name, why in (
        ("big.bag", "858 MB; at most 512 MB"),
        ("void.csv", "is empty"),
        ("short.csv", "no rows of numbers were found"),
        ("virus.exe", "a URDF, meshes, logs (.csv"),
        ("old.urdf.xacro", "expected a URDF"),
    ):
        assert f"Not used: <b>{name}</b>: {why}" in said, said
    assert "/tmp" not in said
    for rubbish in (
        "",
        "[]",
        '{"files": "x"}',
        '{"files": Infinity, "skipped": []}',
        '{"files": 5, "skipped": 3}',
    ):
        app.queue.call(app.page._announced, rubbish)
        act(app)
    assert own(app).folder.visible


def test_nothing_is_lost_on_the_way(app: Application) -> None:
    begin(app, arm_urdf=URDF.encode(), run1_csv=log(0, factor=20.0, header="t,q1,q2,current1,current2"))
    assert "torque constants in Nm/A: τ of joint1, joint2 is a current" in own(app)._state.content
    assert control(app, "Open").disabled and "torque constants" in str(control(app, "Open").hint)
    use(app, "Torque constants", "0.05")
    use(app, "Mass [kg]", "two")
    use(app, "Add payload")
    assert "Mass [kg]: found &#x27;two&#x27;, expected a number" in status(app)
    use(app, "Mass [kg]", "0.5")
    use(app, "Centre [m]", "0.1, 0, 0")
    use(app, "Add payload")
    assert "0.5 kg" in own(app)._run_table.content
    add(app, broken_csv=b"no numbers\n")
    assert "Not used: <b>broken.csv</b>" in own(app)._files.content
    add(app, run2_csv=log(1, factor=20.0, header="t,q1,q2,current1,current2"))
    assert "0.05 Nm/A" in table(app) and control(app, "Torque constants").value == "0.05"
    runs = own(app)._run_table.content
    assert runs.count("0.5 kg") == 1 and runs.count("validate") == 1
    use(app, "Torque constants", "-1")
    assert "above 0" in own(app)._typed.content and "0.05 Nm/A" in table(app)
    use(app, "Check data")
    app.store.stop()
    until(app, lambda: not app.store.running)
    assert "0.05 Nm/A" in table(app) and own(app).folder.visible


def test_columns_that_no_name_tells(app: Application) -> None:
    begin(app, arm_urdf=URDF.encode(), run_csv=log(0, header="clock,a,b,c,d"))
    assert "the column of θ" in own(app)._state.content and "no column" in table(app)
    use(app, "Correct", "θ of joint1")
    use(app, "Column", "a")
    use(app, "Correct", "τ of joint1")
    use(app, "Column", "c")
    assert "no column" not in table(app) and all(f"<b>{name}</b>" in table(app) for name in "abcd")
    use(app, "Unit", "a number")
    use(app, "Size of unit", "2.5e-3")
    assert "× 0.0025 Nm" in table(app)
    use(app, "Size of unit", "0")
    assert "× 0.0025 Nm" in table(app)
    use(app, "Unit", "Nm")
    assert control(app, "Time column").value == "clock"
    use(app, "Check data")
    wait(app)
    assert "Checked" in own(app)._state.content


def test_files_wait_for_what_is_running(app: Application) -> None:
    own(app).close()
    use(app, "Run")
    assert app.store.running
    app.queue.call(app.page._announced, '{"files": 2, "skipped": []}')
    upload(app, "arm.urdf", URDF.encode())
    upload(app, "run.csv", log(0))
    assert "read when the running computation ends" in own(app)._files.content
    until(app, lambda: own(app)._own is not None and not app.store.running)
    assert app.store.analysis.identification is not None
    use(app, "Discard")
    assert not own(app).folder.visible
    command(app, "Read the data again")
