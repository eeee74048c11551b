"""What a step is: a folder of controls that follows the store."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

from flexviz.app.change import Changed, Turn
from flexviz.app.page import Page
from flexviz.app.store import Store


class WorkflowStep(ABC):
    """A step of the analysis. It knows the store and its own controls, and no other step.

    `build` declares its controls and commands, and what they do to the store. Tasks are started with
    `store.await_task`, where the user waits for them, or `store.tasks.start`.

    Attributes:
        title: its name in the step line.
        folder: holds its controls.
        next_buttons: what `view.next_step` calls its buttons -> the button.
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
        """Make the controls; the step's folder is open."""

    @abstractmethod
    def refresh(self) -> None:
        """Show the present analysis, and what may be pressed."""
