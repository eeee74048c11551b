"""The application: its parts and the event loop."""

from __future__ import annotations

import sys
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from typing import Any

import viser
from threadpoolctl import threadpool_limits

from flexviz.base.errors import FlexvizError, one_line
from flexviz.base.jobs import LoadModules
from flexviz.content.view import next_step
from flexviz.outlets.app.display import Display
from flexviz.outlets.app.dock import Dock
from flexviz.outlets.app.events import EventQueue, TaskRunner
from flexviz.outlets.app.fall import Fall
from flexviz.outlets.app.idle import IdleWork
from flexviz.outlets.app.legend_panel import LegendPanel
from flexviz.outlets.app.page import Page
from flexviz.outlets.app.playback_panel import PlaybackPanel
from flexviz.outlets.app.plots import PlotPanel
from flexviz.outlets.app.state import Changed, Opened
from flexviz.outlets.app.steps import STEPS
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.tab_turns import TabTurns
from flexviz.outlets.app.tasks import WARM
from flexviz.outlets.app.time_left import TimeLeft
from flexviz.outlets.batch import FleetRow

TICK = 0.1  # [s] update interval of playheads, time slider and live plots
UNWATCHED_TICK = 1.0  # [s] the same while no page is shown; events are processed at once all the same


class Application:
    """Store, page with its panels, and display of the robots, changed by the loop's thread only."""

    def __init__(self, server: viser.ViserServer, opened: Opened, fleet: Sequence[FleetRow] = ()) -> None:
        """`fleet` are the sets of a batch, to choose from."""
        # small matrices: more threads would only wait, for each other and for the browser
        threadpool_limits(1, "blas")
        self.queue = EventQueue()  # of browsers and the worker
        self.page = Page(server, self.queue)
        self.tasks = TaskRunner(self.queue, lambda reason: self.store.fail(reason))
        self.store = Store(opened, first_step(opened), self.tasks, self.page.alert)
        self.fall = Fall(self.store, self.page)
        self.dock = Dock(self.store, self.page, STEPS)
        self.display = Display(self.store, self.page, self.queue)
        self.plots = PlotPanel(self.store, self.page, list(fleet))
        self.turns = TabTurns(self.store, self.page)
        self.legend = LegendPanel(self.store, self.page)
        self.playback_panel = PlaybackPanel(self.store, self.page)
        self.idle = IdleWork(self.store)
        self.time_left = TimeLeft(self.store)
        self._stopped = threading.Event()
        self._ticked = 0.0
        self.store.tell(Changed.OPENED)
        self.store.clock.play()
        self.display.playback.start()
        self.tasks.start(LoadModules(WARM), lambda _: None, failed=lambda _: None)

    def run(self) -> None:
        """Process events until `close`."""
        while not self._stopped.is_set():
            self.once(TICK / 2 if self.display.watched() else UNWATCHED_TICK)

    def once(self, wait: float) -> None:
        """Process one event (waiting up to `wait` [s]), due commands, and the tick."""
        event = self.queue.take(wait)
        if event is not None:
            if event.control:
                self.page.commands.touched(event.born)
            self._act(event.action, event.value)
        for action in self.page.commands.due():
            self._act(action)
        tick = TICK if self.display.watched() else UNWATCHED_TICK
        if time.monotonic() - self._ticked >= tick:
            self._ticked = time.monotonic()
            self._act(self.store.tell, Changed.TICK)

    def close(self) -> None:
        """End the loop, the playback and the worker; keep unsaved work."""
        self._stopped.set()
        self.store.tell(Changed.CLOSED)
        self.tasks.close()

    def _act(self, action: Callable[..., None], *arguments: Any) -> None:
        """Call `action`, whose changes reach the page at once; a failure is shown and ends no loop."""
        try:
            with self.page.server.atomic():  # one wake-up of the thread that sends, not one for every value
                action(*arguments)
        except FlexvizError as error:
            self.store.fail(str(error))
        except Exception as error:
            print("flexviz: an action failed", file=sys.stderr)
            traceback.print_exception(error)
            self.store.fail(one_line(f"{type(error).__name__}: {error}"))


def first_step(opened: Opened) -> str:
    """The step to begin with: of a session its next one."""
    following = next_step(opened.session.analysis, "", False).step if opened.session else ""
    return following or STEPS[0].title
