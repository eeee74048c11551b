"""The camera of every browser, and whether its page is shown."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
import viser

from flexviz.base.errors import InputError
from flexviz.base.schemas import shown
from flexviz.content.scene import FIELD_OF_VIEW, Box, SceneLayout, Screen

HIDDEN_AFTER = 8.0  # [s] without news: the page is hidden, its browser draws nothing and reports nothing
SMALLEST = 40.0  # [pixels] width and height of a canvas that shows something
LARGEST = 20_000.0  # [pixels]
MOST_PANELS = 4
THERE = 1e-3  # of the distance by which a camera may be away from where it was pointed


@dataclass
class Browser:
    """One browser: its canvas, and where its camera was pointed."""

    screen: Screen
    moves: int = 0  # by which its user has moved the camera
    aimed_after: int = 0  # of these, the last before the camera was pointed by the view's name
    position: np.ndarray | None = None
    look_at: np.ndarray | None = None
    heard: float = 0.0  # [s, monotonic]


class Cameras:
    """Every browser's camera shows all robots: after each change of its canvas, and until its user moves it.

    One that was moved keeps its direction, and is fitted anew only when the window changes its size. The
    page's script reports the canvas in CSS pixels, the panels over it, and the user's moves.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._browsers: dict[int, Browser] = {}
        server.scene.set_up_direction("+z")
        server.scene.configure_default_lights(cast_shadow=False)

    def show(self, stage: SceneLayout, layout: str, view: str, robots: int) -> None:
        """Point all cameras at the robots placed by `layout`, from the side that `view` names."""
        self._stage, self._layout, self._view, self._robots = stage, layout, view, robots
        position, look = stage.camera(layout, stage.direction(view), robots)
        self._server.initial_camera.position = tuple(position)  # type: ignore[assignment]
        self._server.initial_camera.look_at = tuple(look)  # type: ignore[assignment]
        self._server.initial_camera.fov = FIELD_OF_VIEW
        for number, browser in self._browsers.items():
            browser.aimed_after = browser.moves
            self._aim(number)

    def joined(self, client: viser.ClientHandle) -> None:
        """Point the camera of a new browser; its first message has the size of its canvas."""
        camera = client.camera
        screen = Screen(max(camera.image_width, 1), max(camera.image_height, 1))
        self._browsers[client.client_id] = Browser(screen, heard=time.monotonic())
        self._aim(client.client_id)

    def gone(self, client: viser.ClientHandle) -> None:
        self._browsers.pop(client.client_id, None)

    def heard(self, number: int) -> None:
        """Take note that a browser draws."""
        if number in self._browsers:
            self._browsers[number].heard = time.monotonic()

    def watched(self) -> bool:
        """Whether a page is shown."""
        return any(time.monotonic() - one.heard < HIDDEN_AFTER for one in list(self._browsers.values()))

    def reported(self, told: tuple[int, str]) -> None:
        """Take a browser's number and its report (`read_report`); a hidden canvas changes nothing."""
        number, (screen, moves) = told[0], read_report(told[1])
        browser = self._browsers.get(number)
        if browser is None:
            return
        self.heard(number)
        browser.moves = moves
        if min(screen.width, screen.height) < SMALLEST:
            return
        before, browser.screen = browser.screen, screen
        if moves > browser.aimed_after:
            if (before.width, before.height) != (screen.width, screen.height):
                self._aim(number)
        elif screen != before or not self._there(number):  # a late initial camera of viser's may override
            self._aim(number)

    def _aim(self, number: int) -> None:
        """Fit all robots into one browser's canvas."""
        browser, client = self._browsers[number], self._server.get_clients().get(number)
        if client is None or min(browser.screen.width, browser.screen.height) < SMALLEST:
            return
        towards = self._stage.direction(self._view)
        if browser.moves > browser.aimed_after:
            towards = client.camera.position - client.camera.look_at
        position, look = self._stage.camera(self._layout, towards, self._robots, browser.screen)
        browser.position, browser.look_at = position, look
        with client.atomic():
            client.camera.position = position
            client.camera.look_at = look

    def _there(self, number: int) -> bool:
        """Whether a browser's camera is where it was pointed."""
        browser, client = self._browsers[number], self._server.get_clients().get(number)
        if client is None or browser.position is None or browser.look_at is None:
            return client is None
        near = THERE * float(np.linalg.norm(browser.position - browser.look_at))
        pairs = ((client.camera.position, browser.position), (client.camera.look_at, browser.look_at))
        return all(bool(np.linalg.norm(now - ours) < near) for now, ours in pairs)


def read_report(text: str) -> tuple[Screen, int]:
    """Canvas and the user's moves of the camera, from "ID WIDTH HEIGHT MOVES L,T,R,B …" [pixels]."""
    words = text.split()
    try:
        if not 4 <= len(words) <= 4 + MOST_PANELS:
            raise ValueError
        width, height, moves = float(words[1]), float(words[2]), int(words[3])
        boxes = tuple(Box(*map(float, word.split(","))) for word in words[4:])
    except (ValueError, TypeError):
        raise InputError(f"{shown(text)} is no report of a canvas") from None
    numbers = [width, height, *(number for box in boxes for number in box)]
    if not all(math.isfinite(number) and 0 <= number <= LARGEST for number in numbers) or moves < 0:
        raise InputError(
            f"{shown(text)} is no report of a canvas: numbers from 0 to {LARGEST:g} are expected"
        )
    return Screen(width, height, boxes), moves
