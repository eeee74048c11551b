"""The camera of every browser, and whether its page is shown."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import viser

from flexviz.scene import FIELD_OF_VIEW, SceneLayout

MOVED_CAMERA = 0.02  # share of the stage's width; users move the camera farther
PLAYBACK_HEIGHT, LEGEND_HEIGHT, ROW_HEIGHT = 215.0, 140.0, 18.5  # [pixels] of what covers the canvas
USUAL_HEIGHT = 850.0  # [pixels] of the canvas; browsers tell theirs in device pixels
SAME_ASPECT = 0.02  # tolerance of width ÷ height; the number of pixels varies in slow browsers
SIZE_INTERVAL = 2.0  # [s] between requests of the canvas size
HIDDEN_AFTER = 8.0  # [s] without an answer: the page is hidden, its browser draws nothing
RESTING = 1.0  # [s] a camera has not moved: nobody is turning it


@dataclass
class View:
    """Where a browser's camera was pointed, and until it is there, where it was pointed before."""

    position: np.ndarray
    look_at: np.ndarray
    before: tuple[np.ndarray, ...]


class Cameras:
    """The camera of every browser, pointed at both robots until its user moves it."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._aimed: dict[int, float] = {}  # browser -> width ÷ height of its canvas
        self._views: dict[int, View] = {}
        self._answered: dict[int, float] = {}  # browser -> its last answer [s, monotonic]
        self._nudged = 1e-4  # relative camera motion that triggers an update
        self._asked = 0.0  # last request of the canvas size [s, monotonic]
        server.scene.set_up_direction("+z")
        server.scene.configure_default_lights(cast_shadow=False)

    def show(self, stage: SceneLayout, layout: str, view: str, robots: int, joints: int) -> None:
        """Point all cameras at the robots placed by `layout`, from the side that `view` names.

        The legend has a row for each of the `joints`.
        """
        self._stage, self._layout, self._view, self._robots = stage, layout, view, robots
        legend = LEGEND_HEIGHT + ROW_HEIGHT * joints
        self._hidden = (legend / USUAL_HEIGHT, PLAYBACK_HEIGHT / USUAL_HEIGHT)
        self._begin, look = stage.camera(layout, hidden=self._hidden, view=view, count=robots)
        self._server.initial_camera.position = tuple(self._begin)  # type: ignore[assignment]
        self._server.initial_camera.look_at = tuple(look)  # type: ignore[assignment]
        self._server.initial_camera.fov = FIELD_OF_VIEW
        for client in self._server.get_clients().values():
            self.aim(client)

    def aim(self, client: viser.ClientHandle) -> None:
        """Point one browser's camera at both robots, as close as its window allows."""
        self._aimed[client.client_id] = aspect = _aspect(client)
        self._answered.setdefault(client.client_id, time.monotonic())
        camera, look = self._stage.camera(self._layout, aspect, self._hidden, self._view, self._robots)
        last = self._views.get(client.client_id)
        before = () if last is None else (*last.before, last.position)
        self._views[client.client_id] = view = View(camera, look, before)
        self._point(client, view)

    def _point(self, client: viser.ClientHandle, view: View) -> None:
        with client.atomic():
            client.camera.position = view.position * (1.0 + self._nudged)
            client.camera.look_at = view.look_at

    def gone(self, client: viser.ClientHandle) -> None:
        self._aimed.pop(client.client_id, None)
        self._views.pop(client.client_id, None)
        self._answered.pop(client.client_id, None)

    def watched(self) -> bool:
        """Whether a page is shown: a hidden one does not answer, because its browser does not draw it."""
        return any(time.monotonic() - seen < HIDDEN_AFTER for seen in list(self._answered.values()))

    def resized(self, client: viser.ClientHandle) -> None:
        """Aim again if the canvas size has changed and the user has not moved the camera."""
        if client.client_id in self._aimed:
            self._answered[client.client_id] = time.monotonic()
        view = self._views.get(client.client_id)
        if view is not None and self._near(client, view.position):
            view.before = ()
        now = _aspect(client)
        changed = abs(self._aimed.get(client.client_id, now) / now - 1.0) >= SAME_ASPECT
        if changed and self._unmoved(client.client_id, client):
            self.aim(client)

    def _unmoved(self, number: int, client: viser.ClientHandle) -> bool:
        """Whether the user has not moved this browser's camera."""
        view = self._views.get(number)
        if view is None:
            return False
        # a browser may apply the initial camera after it was aimed, and report an earlier view late
        return any(self._near(client, ours) for ours in (view.position, self._begin, *view.before))

    def _near(self, client: viser.ClientHandle, place: np.ndarray) -> bool:
        away = float(np.linalg.norm(client.camera.position - place))
        return away < MOVED_CAMERA * self._stage.width

    def tick(self) -> None:
        """Ask every browser for its canvas size, which it sends only when its camera moves."""
        if time.monotonic() - self._asked < SIZE_INTERVAL:
            return
        self._asked = time.monotonic()
        self._nudged = -self._nudged  # once for all: where it was before, a camera does not move
        for number, client in self._server.get_clients().items():
            if self._unmoved(number, client):
                self._point(client, self._views[number])
            elif time.monotonic() - self._answered.get(number, 0.0) > RESTING:
                client.camera.position = client.camera.position * (1.0 + self._nudged)


def _aspect(client: viser.ClientHandle) -> float:
    return max(client.camera.image_width, 1) / max(client.camera.image_height, 1)
