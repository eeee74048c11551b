"""Whether a page is shown: every browser's camera is moved back and forth, and a shown one answers."""

from __future__ import annotations

from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

from flexviz.app import cameras
from flexviz.app.cameras import SIZE_INTERVAL, Cameras


@pytest.mark.parametrize("count", [1, 2, 3])
def test_every_browser_is_moved_each_time(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    now = [100.0]
    monkeypatch.setattr(cameras.time, "monotonic", lambda: now[0])
    server = MagicMock()
    clients = {
        number: SimpleNamespace(
            client_id=number,
            camera=SimpleNamespace(position=np.zeros(3), image_width=800, image_height=600),
            atomic=MagicMock(),
        )
        for number in range(count)
    }
    server.get_clients.return_value = clients
    place = np.array([2.0, 1.0, 1.0])
    stage = SimpleNamespace(width=1.0, camera=lambda *_, **__: (place.copy(), np.zeros(3)))
    shown = Cameras(server)
    shown.show(stage, "Side by side", "Iso", 2, 2)  # type: ignore[arg-type]
    for _ in range(4):
        before = [client.camera.position.copy() for client in clients.values()]
        now[0] += SIZE_INTERVAL
        shown.tick()
        after = [client.camera.position for client in clients.values()]
        assert all(np.any(a != b) for a, b in zip(before, after, strict=True))
        assert all(np.allclose(a, place, rtol=2e-3) for a in after)
