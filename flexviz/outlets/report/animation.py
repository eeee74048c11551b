"""Measured and identified robot in motion, as one page that needs nothing else.

The page holds the joint angles and the screw axes of the joints; its script draws the links on a canvas. Of
the error of the simulated motor angle, model − measured, a multiple is drawn and named.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
from scipy.spatial.transform import Rotation

from flexviz.base.arrays import Array
from flexviz.base.errors import ConvergenceError, InputError
from flexviz.base.progress import Progress, ProgressCallback, StopCallback, ignore, never
from flexviz.content.charts import COLOURS
from flexviz.content.scene import lean_shape, robot_shape, scene_layout
from flexviz.content.session import Session
from flexviz.content.topics import gather
from flexviz.content.wording import escape, number
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.model.simulation import Run, replay
from flexviz.robot.robot import Robot

POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; base-uri 'none'; "
    "form-action 'none'"
)
FACES = 400  # of a link
RATE = 25.0  # [frames/s]
MOST_FRAMES = 1500  # of the recording; longer ones are drawn with fewer frames a second
SHOWN_ERROR = 0.2  # [rad] or [m] of the largest error as it is drawn at first
FACTORS = (1, 2, 5, 10, 20, 50, 100, 200, 500)


@dataclass(frozen=True, eq=False)
class SimulatedModel:
    """A model's simulated motion along a group.

    Attributes:
        name: on the page's buttons, such as "before" and "after".
        run: the simulation.
    """

    name: str
    run: Run


def animation_page(measurements: MeasurementSet, group: str, models: Sequence[SimulatedModel]) -> str:
    """The page as HTML; of several models the last one is shown first."""
    recorded = measurements.group(group)
    data = json.dumps(_data(measurements, group, models)).replace("<", "\\u003c")  # no tag inside the script
    script = files("flexviz.outlets.report").joinpath("animation.js").read_text(encoding="utf-8")
    style = files("flexviz.outlets.report").joinpath("animation.css").read_text(encoding="utf-8")
    buttons = "".join(
        f'<label><input type="radio" name="model" value="{k}"{" checked" * (k == len(models) - 1)}> '
        f"{escape(one.name)}</label>"
        for k, one in enumerate(models)
    )
    choice = f'<fieldset id="models"><legend>Model</legend>{buttons}</fieldset>' if len(models) > 1 else ""
    simulated = " (simulated data)" if measurements.simulated else ""
    factors = "".join(f"<option>{factor}</option>" for factor in FACTORS)
    title = escape(f"{measurements.name}, {group}: measured and identified robot")
    how = escape(f"The identified robot is simulated: {models[-1].run.note}." if models else "")
    first, last = (number(time, 3) for time in (recorded.segments[0].time[0], recorded.segments[-1].time[-1]))
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<h1>{title}</h1>
<canvas id="scene" role="img" aria-label="measured robot left, identified robot right"></canvas>
<div id="names"><span id="measured">measured{simulated}</span><span id="identified"></span></div>
<div id="bar">
<button id="play" type="button">Pause</button>
<input id="time" type="range" aria-label="time" min="0" value="0" step="1">
<output id="clock"></output>
</div>
<div id="options">
<label>Error × <select id="factor">{factors}</select></label>
{choice}
<label>Speed <select id="speed"><option>0.25</option><option>0.5</option><option selected>1</option>
<option>2</option></select></label>
</div>
<p id="errors"></p>
<p class="quiet">{how} Group {escape(group)}, {first} to {last} s. Space plays and pauses, ← and → step.</p>
<script id="data" type="application/json">{data}</script>
<script>
{script}</script>
</body>
</html>
"""


def session_animation(
    session: Session,
    measurements: MeasurementSet,
    *,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
) -> str:
    """The page of a session: its first and its present model, simulated along the longest held-out group.

    Raises:
        InputError: there is no model of the present settings, or none that can be simulated.
        Cancelled: stopped.
    """
    content = gather(session, measurements)
    group, found = content.shown_group, content.compared
    if group is None or not found:
        raise InputError("nothing to animate: no model is identified or diagnosed with these settings")
    models, why = [], ""
    for number_of, one in enumerate(found):

        def tell(news: Progress, done: int = number_of, name: str = one.name) -> None:
            what = "animation: simulating the model" + (f" {name}" if len(found) > 1 else "")
            progress(Progress(what, (done + (news.share or 0.0)) / len(found)))

        try:
            run = replay(
                measurements.robot, one.model, measurements.group(group), measurements.kp, measurements.kd,
                torque_hold=measurements.torque_hold, progress=tell, should_stop=should_stop,
            )  # fmt: skip
        except ConvergenceError as error:  # a poor model may diverge
            why = str(error)
            continue
        models.append(SimulatedModel(one.name, run))
    if not models:
        raise InputError(f"nothing to animate: {why}")
    return animation_page(measurements, group, models)


def _data(measurements: MeasurementSet, group: str, models: Sequence[SimulatedModel]) -> dict[str, object]:
    """What the script reads; lengths in metres, angles in radians."""
    robot, recorded = measurements.robot, measurements.group(group)
    time, theta = frames(recorded)
    moved = [_columns(time, one.run.time, one.run.theta) for one in models]
    shape = lean_shape(robot_shape(robot), FACES)
    layout = scene_layout(robot, shape, theta)
    rest, chains = screws(robot)
    bodies = [
        {
            "chain": chains[body.link],
            "vertices": np.round(
                body.vertices @ rest[body.link][:3, :3].T + rest[body.link][:3, 3], 4
            ).tolist(),
            "faces": body.faces.tolist(),
        }
        for body in shape.bodies
    ]
    largest = max((float(np.abs(one - theta).max(initial=0.0)) for one in moved), default=0.0)
    nice = max((f for f in FACTORS if f * largest <= SHOWN_ERROR), default=1)
    return {
        "joints": list(measurements.joints),
        "time": np.round(time - time[0], 4).tolist(),
        "start": float(time[0]),
        "measured": np.round(theta, 5).tolist(),
        "models": [
            {"name": one.name, "theta": np.round(theta, 5).tolist()}
            for one, theta in zip(models, moved, strict=True)
        ],
        "unit": "mrad or mm" if robot.prismatic.any() else "mrad",
        "screws": joint_screws(robot).tolist(),
        "bodies": bodies,
        "view": np.round(layout.axes, 5).tolist(),
        "centre": np.round(layout.centre, 4).tolist(),
        "extent": [round(layout.width, 4), round(layout.size, 4)],
        "factor": nice,
        "colours": {"measured": COLOURS.measured, "model": COLOURS.model},
    }


def frames(group: Group) -> tuple[Array, Array]:
    """Times (M,) [s] and measured motor angles (M, n) [rad] of the frames."""
    recorded = group.joined("time")
    count = int(np.clip((recorded[-1] - recorded[0]) * RATE + 1, 2, MOST_FRAMES))
    time = np.linspace(recorded[0], recorded[-1], count)
    return time, _columns(time, recorded, group.joined("theta"))


def _columns(time: Array, known: Array, values: Array) -> Array:
    return np.stack([np.interp(time, known, column) for column in values.T], axis=1)


def screws(robot: Robot) -> tuple[dict[str, Array], dict[str, list[int]]]:
    """Pose (4, 4) of every link at zero, and the joints that move it, from the base on."""
    rest = robot.link_poses(np.zeros(robot.n))
    moved = {
        joint: {
            link
            for link, pose in robot.link_poses(np.eye(robot.n)[joint]).items()
            if not np.allclose(pose, rest[link], atol=1e-12)
        }
        for joint in range(robot.n)
    }
    order = sorted(range(robot.n), key=lambda joint: -len(moved[joint]))
    return rest, {link: [joint for joint in order if link in moved[joint]] for link in rest}


def joint_screws(robot: Robot) -> Array:
    """Screw axis of every joint in the base frame at zero, shape (n, 6): rotation ω, translation v.

    A joint at q moves what it carries by exp(q [ω, v]) (Lynch and Park, Modern Robotics, chapter 3).
    """
    rest = robot.link_poses(np.zeros(robot.n))
    out = np.zeros((robot.n, 6))
    for joint in range(robot.n):
        there = robot.link_poses(np.eye(robot.n)[joint])
        link = next((name for name in rest if robot.joint_of_link(name) == joint), None)
        if link is not None:
            moved = there[link] @ np.linalg.inv(rest[link])
            turn = Rotation.from_matrix(moved[:3, :3]).as_rotvec()
            out[joint] = *turn, *np.linalg.solve(_translation(turn), moved[:3, 3])
    return np.round(out, 7)


def _translation(turn: Array) -> Array:
    """G (3, 3) with t = G v for the translation t of exp([ω, v]); ω (3,) of length 1 or 0."""
    x, y, z = turn
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + (1 - np.cos(1.0)) * cross + (1 - np.sin(1.0)) * cross @ cross
