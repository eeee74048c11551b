"""The cameras: moved back and forth, which a shown page answers, and pointed again at what was asked."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from flexviz.app import cameras
from flexviz.app.cameras import SIZE_INTERVAL, Cameras

STAGE: Any = SimpleNamespace(
    width=1.0,
    camera=lambda layout, aspect=1.0, hidden=(), view="Front", count=2: (np.array(PLACES[view]), np.zeros(3)),
)
PLACES = {"Front": [2.0, 1.0, 1.0], "Oblique": [1.5, 1.5, 2.0], "Above": [0.1, 0.0, 3.0]}


def pages(count: int, position: list[float]) -> dict[int, Any]:
    """Browsers whose cameras are there."""
    return {
        number: SimpleNamespace(
            client_id=number,
            camera=SimpleNamespace(
                position=np.array(position), look_at=np.zeros(3), image_width=800, image_height=600
            ),
            atomic=MagicMock(),
        )
        for number in range(count)
    }


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [100.0]
    monkeypatch.setattr(cameras.time, "monotonic", lambda: now[0])
    return now


def shown(clients: dict[int, Any]) -> Cameras:
    server = MagicMock()
    server.get_clients.return_value = clients
    shown = Cameras(server)
    shown.show(STAGE, "Side by side", "Front", 2, 2)
    return shown


@pytest.mark.parametrize("count", [1, 2, 3])
def test_every_browser_is_moved_each_time(clock: list[float], count: int) -> None:
    clients = pages(count, [0.0, 0.0, 0.0])
    ours = shown(clients)
    for _ in range(4):
        before = [client.camera.position.copy() for client in clients.values()]
        clock[0] += SIZE_INTERVAL
        ours.tick()
        after = [client.camera.position for client in clients.values()]
        assert all(np.any(a != b) for a, b in zip(before, after, strict=True))
        assert all(np.allclose(a, PLACES["Front"], rtol=2e-3) for a in after)


def test_a_late_report_of_the_last_view_is_no_move(clock: list[float]) -> None:
    clients = pages(1, PLACES["Front"])
    ours, camera = shown(clients), clients[0].camera
    ours.show(STAGE, "Side by side", "Oblique", 2, 2)
    ours.show(STAGE, "Side by side", "Above", 2, 2)
    camera.position, camera.look_at = np.array(PLACES["Front"]), np.ones(3)  # sent before it got there
    ours.resized(clients[0])
    clock[0] += SIZE_INTERVAL
    ours.tick()
    assert np.allclose(camera.position, PLACES["Above"], rtol=2e-3) and not camera.look_at.any()
    ours.resized(clients[0])  # now it is there
    camera.position = np.array(PLACES["Front"])  # by hand
    ours.resized(clients[0])
    clock[0] += 2.0 * SIZE_INTERVAL
    ours.tick()
    assert np.allclose(camera.position, PLACES["Front"], rtol=2e-3)
