"""Base class of the steps: a folder of controls that follows the store."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

from flexviz.outlets.app.page import Page
from flexviz.outlets.app.state import Changed, Turn
from flexviz.outlets.app.store import Store


class WorkflowStep(ABC):
    """A step of the analysis, which knows the store and its own controls, but no other step.

    `build` declares the controls and commands. Tasks are started with `store.await_task` if the user waits
    for them, otherwise with `store.tasks.start`.

    Attributes:
        title: name in the step line.
        folder: holds the controls.
        next_buttons: name in `view.next_step` -> button.
    """

    title: ClassVar[str]

    def __init__(self, store: Store, page: Page, visible: bool) -> None:
        self.store, self.page = store, page
        self.next_buttons: dict[str, Any] = {}
        self.folder = page.gui.add_folder(None, visible=visible)
        with self.folder:
            self.build()
        store.subscribe(Changed.OPENED | Changed.ANALYSIS | Changed.ACTIVITY, self.refresh, Turn.CONTROLS)

    @abstractmethod
    def build(self) -> None:
        """Create the controls, inside the step's folder."""

    @abstractmethod
    def refresh(self) -> None:
        """Show the current analysis and enable the controls."""
