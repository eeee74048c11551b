"""The whole application without a browser, in a folder that tests may fill."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from flexviz.app.application import Application
from flexviz.app.server import start_server
from flexviz.app.work import open_set


@contextmanager
def running(root: Path, measurement_set: Path) -> Iterator[Application]:
    """The application on a set, started in `root`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(root)
        server = start_server("127.0.0.1", 0)
        application = Application(server, open_set(measurement_set))
        yield application
        application.close()
        server.stop()
