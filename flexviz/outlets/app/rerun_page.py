"""Rerun's viewer on this machine, as `flexviz review` serves it; it ends with the app."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path


class RerunPage:
    """The viewer's page with one recording; another recording replaces it."""

    def __init__(self) -> None:
        self._served = ExitStack()

    def show(self, file: Path) -> str:
        """Serve the viewer with a recording and return the page's address; takes a second."""
        from flexviz.outlets.recording import web_viewer  # heavy

        self.close()
        return self._served.enter_context(web_viewer([file]))

    def close(self) -> None:
        """Stop serving."""
        self._served.close()
