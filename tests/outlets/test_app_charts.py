"""A chart on the page: whatever part of its messages a page has, its series and data belong together."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from typing import Any

import numpy as np
import pytest

from flexviz.content.charts import Chart, ChartSeries
from flexviz.outlets.app.server import start_server
from flexviz.outlets.app.uplot import UplotChart, columns

TIME = np.linspace(0.0, 1.0, 5)


@pytest.fixture(scope="module")
def server() -> Iterator[Any]:
    server = start_server("127.0.0.1", 0)
    yield server
    server.stop()


def chart(count: int, **more: Any) -> Chart:
    """A chart with this many lines over time."""
    lines = tuple(ChartSeries(f"line {i}", "#123456", TIME, np.sin(TIME + i)) for i in range(count))
    return Chart("key", f"{count} lines", series=lines, playhead=True, **more)


def test_series_and_data_belong_together_after_every_message(
    server: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[Any] = []
    buffer = server._websock_server._broadcast_buffer
    push = buffer.push
    monkeypatch.setattr(buffer, "push", lambda message: (sent.append(deepcopy(message)), push(message)))
    shown = UplotChart(server, chart(2), 0.0)
    shown.move(0.5)
    for drawn in (chart(5), chart(1, marker=0.4), chart(3, highlights=((0.2, 0.6),)), chart(3)):
        shown.show(drawn, columns(drawn))
        shown.move(0.25)
    uuid = shown._handle._impl.uuid
    late = list(buffer.message_from_id.values())  # what a page gets that comes later
    for messages in (sent, late):
        state: dict[str, Any] = {}
        for message in messages:
            if getattr(message, "uuid", None) != uuid:
                continue
            state |= vars(message.props) if hasattr(message, "props") else message.updates
            assert len(state["series"]) == len(state["data"]), message
            assert {one.get("scale", "x") for one in state["series"]} <= state["scales"].keys()
        assert state["title"] == "3 lines" and len(state["data"]) == 5


def test_only_what_changes_is_sent(server: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = UplotChart(server, chart(2), 0.0)
    sent: list[Any] = []
    monkeypatch.setattr(server._websock_server._broadcast_buffer, "push", sent.append)
    shown.show(chart(2), columns(chart(2)))
    assert [set(message.updates) for message in sent] == [{"data"}]  # else the page would build it anew
