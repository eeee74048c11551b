"""The left dock: step line, status, undo, redo, stop, and the selected joint and group."""

from __future__ import annotations

from collections.abc import Sequence

from flexviz.content.session import standing
from flexviz.content.view import next_step, stated_error, status_html, step_line_html, steps_done
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import CTRL, SHIFT, Page, off
from flexviz.outlets.app.state import Changed, Turn
from flexviz.outlets.app.steps.step import WorkflowStep
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.style import next_button, next_option, no_label, pressed, style
from flexviz.outlets.app.viser_private import id_of

LEFT_WIDTH = 330  # [pixels]


class Dock:
    """The dock, with the current step's controls below."""

    def __init__(self, store: Store, page: Page, kinds: Sequence[type[WorkflowStep]]) -> None:
        self._store, self._page = store, page
        self._titles = tuple(kind.title for kind in kinds)
        gui = page.gui
        page.set_dark(False)
        gui.main_panel.dock_left()
        gui.main_panel.set_width(LEFT_WIDTH)
        self._style = gui.add_html("")
        self._line = gui.add_html("")
        self._status = ExplainedHtml(gui)
        self._next = gui.add_html("")
        self._buttons = page.choose(gui.add_button_group("", self._titles), store.go)
        self._undo = page.button("Undo", store.undo, disabled=True)
        self._redo = page.button("Redo", store.redo, disabled=True)
        self._stop = page.button("Stop", store.stop, color="red", disabled=True)
        self._bar = gui.add_progress_bar(0.0, visible=False, animated=True)
        self._joint = page.dropdown(
            "Joint", ("–",), lambda name: store.select(joint=store.measurements.joint_index(name))
        )
        self._group = page.dropdown("Group", ("–",), lambda name: store.select(group=name))
        page.add_drop_target()
        gui.add_divider()
        page.row((self._undo, self._redo, self._stop))
        page.style(no_label, self._buttons)
        page.command("Stop what is running", store.stop, "escape")
        page.command("Undo the last change", store.undo, "Z", CTRL)
        page.command("Redo the undone change", store.redo, "Z", SHIFT)
        for number, title in enumerate(self._titles, start=1):
            page.command(f"Go to step {title}", lambda title=title: store.go(title), str(number), shared=True)
        page.command("Choose the next joint", self._next_joint)
        page.command("Choose the next group", self._next_group)
        self.steps = tuple(kind(store, page, visible=kind.title == store.step) for kind in kinds)
        shown = Changed.OPENED | Changed.ANALYSIS | Changed.ACTIVITY
        store.subscribe(Changed.OPENED, self._opened, Turn.STATUS)
        store.subscribe(Changed.STEP, self._show_step, Turn.STATUS)
        store.subscribe(shown | Changed.JOINT | Changed.GROUP, self._refresh, Turn.STATUS)
        store.subscribe(Changed.ACTIVITY | Changed.PROGRESS, self._progress, Turn.STATUS)
        store.subscribe(shown | Changed.STEP | Changed.MESSAGE | Changed.DERIVED, self._say, Turn.STATUS)
        store.subscribe(shown | Changed.STEP | Changed.TICK, self._draw_line, Turn.STATUS)

    def _opened(self) -> None:
        measurements = self._store.measurements
        self._joint.options = measurements.joints
        self._group.options = tuple(group.name for group in measurements.groups)

    def _refresh(self) -> None:
        store = self._store
        self._joint.value, self._group.value = store.joint_name, store.group.name
        undo, redo = store.session.undoes, store.session.redoes
        off(self._undo, "" if undo else "nothing to do", f"undoes: {undo}")
        off(self._redo, "" if redo else "nothing to do", f"redoes: {redo}")
        why = "" if store.running else "nothing is running"
        off(self._stop, why, "stops the running task and keeps its results; again: at once, without them")

    def _progress(self) -> None:
        """Show the progress; an unknown share is drawn as full."""
        activity = self._store.activity
        self._bar.visible = activity is not None
        if activity is not None:
            self._bar.value = 100.0 * min(max(activity.share, 0.0), 1.0)

    def _say(self) -> None:
        store, message = self._store, self._store.message
        now, failed = standing(store.analysis), "errors" in store.derived.failed
        earlier = now.fit == "earlier"
        error, hover = stated_error(store.analysis.identification, store.errors, failed, earlier)
        stale = earlier or (now.bounds and now.errors == "fit")
        self._status.content = status_html(
            store.step, message.text, error, message.tone or ("warn" if stale else ""), hover
        )

    def _show_step(self) -> None:
        for step in self.steps:
            step.folder.visible = step.title == self._store.step

    def _draw_line(self) -> None:
        """Draw the step line with the recommended next action, and the style sheet."""
        store, uuid, titles = self._store, id_of(self._buttons), self._titles
        rules = [*self._page.rules, pressed(uuid, titles.index(store.step))]
        following = next_step(store.analysis, store.step, store.running)
        buttons = {name: handle for step in self.steps for name, handle in step.next_buttons.items()}
        if following.step in titles and following.step != store.step:
            rules.append(next_option(uuid, titles.index(following.step)))
        elif following.button in buttons:
            rules.append(next_button(id_of(buttons[following.button])))
        self._line.content = step_line_html(titles, store.step, steps_done(store.analysis))
        self._next.content = f'<div class="fv fv-next">{following.text}</div>' if following.text else ""
        self._style.content = style(*rules, *self._page.tooltips.rules())

    def _next_joint(self) -> None:
        self._store.select(joint=(self._store.joint + 1) % self._store.measurements.n)

    def _next_group(self) -> None:
        names = [group.name for group in self._store.measurements.groups]
        self._store.select(group=names[(names.index(self._store.group.name) + 1) % len(names)])
