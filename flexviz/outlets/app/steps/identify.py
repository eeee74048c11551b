"""Step 3, Identify: effects in the model, Check, Run and Stop, the parameter table."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

from flexviz.analysis.identification import Identification
from flexviz.content import view
from flexviz.content.rendering import panel
from flexviz.content.results import at_bounds, hints
from flexviz.content.session import Settings
from flexviz.content.topics import check_blocks, parameter_panel
from flexviz.content.wording import effect_text_name, effect_title, escape, number, plural
from flexviz.model.effects import EFFECTS
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import CTRL, Page, dim, off, warning
from flexviz.outlets.app.state import Changed, FitProgress, Turn
from flexviz.outlets.app.steps.effect_matrix import EffectMatrix
from flexviz.outlets.app.steps.servos import ServoEntries
from flexviz.outlets.app.steps.step import WorkflowStep
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.style import wide_label
from flexviz.outlets.app.tasks import CheckParameters, Identify

JOINT_EFFECTS = (*view.joint_effects(), *view.SERVO_ONLY)
SETTLE = 0.7  # [s] without another change before the next check


class IdentifyStep(WorkflowStep):
    """The solver's controls and its result."""

    title = "Identify"

    def build(self) -> None:
        store, page, gui = self.store, self.page, self.page.gui
        self.effects = EffectList(store, page)
        ServoEntries(store, page)
        hint = "removes the observer's bias in a second stage; without it, the intervals leave this bias out"
        self._refine = page.checkbox(
            "Refine", True, lambda on: store.change("refine", store.analysis.with_fit(refine=on)), hint=hint
        )
        self.check = ParameterCheck(store, page)
        self._run = page.button("Run", self._start, color="blue")
        page.row((self.check.button, self._run))
        self.next_buttons = {"run": self._run}
        self._why = ExplainedHtml(gui)
        self._check = ExplainedHtml(gui)
        hint = "the values the set was simulated with"
        self._truth = page.checkbox(
            "Show truth", False, lambda _: self._draw_table(), visible=False, hint=hint
        )
        self._table = ExplainedHtml(gui)
        self._drawn: tuple[Any, Any] | None = None  # result and truth in the table
        page.command("Run the identification", self._start, "enter", CTRL)
        store.subscribe(Changed.OPENED, self._opened, Turn.CONTROLS)
        store.subscribe(Changed.OPENED | Changed.CHECK, self._show_check, Turn.CONTROLS)

    def _opened(self) -> None:
        self._truth.visible = self.store.opened.truth is not None
        self._truth.value = False
        self._refine.visible = self.store.measurements.drive is None  # servos need no observer

    def _show_check(self) -> None:
        self._check.content = self.store.check

    def refresh(self) -> None:
        self._draw_table()
        self._refine.value = self.store.analysis.fit.refine
        self._why.content = dim(self._state())
        off(self._run, self.store.why_not, "identifies the model with these groups and effects")

    def _state(self) -> str:
        """What Run does, or why it is off."""
        analysis, running = self.store.analysis, self.store.running
        fitted, held_out = analysis.groups_with("fit"), analysis.groups_with("validate")
        if self.store.runs(Identify):
            return "Running; Stop keeps the results so far."
        if running:
            return "A computation is running: Stop ends it."
        if not fitted:
            return "No group is set to Fit in step Data."
        if analysis.identification is not None and not analysis.up_to_date:
            return "The settings have changed since this result: press Run again."
        validation = f"validates on {len(held_out)}" if held_out else "no validation"
        return f"Fits {plural(len(fitted), 'group')}, {validation}."

    def _start(self) -> None:
        store, analysis = self.store, self.store.analysis
        if not store.may_start("Run"):
            return
        store.await_task(
            Identify(analysis.without_result()),
            partial(self._take, analysis.settings),
            begin="running",
            stopped="stopped before a first result",
            share=1.0,  # the number of iterations is unknown
            fit=FitProgress(analysis.effects),
        )

    def _take(self, settings: Settings, result: Identification) -> None:
        if settings.path != self.store.analysis.path:
            return
        self.store.change("identified", self.store.analysis.with_identification(result, settings))
        count = plural(len(result.iterations), "iteration")
        told, held = hints(result.parameters), at_bounds(result.parameters)
        how = "ended at bounds" if held else "converged" if result.converged else "did not converge"
        message = f": {result.message}" if result.message and not result.converged else ""
        how = "stopped" if result.stopped else how
        after = f" after {count}" if result.iterations else ""
        text = ". ".join([f"{how}{after} in {number(result.seconds, 3)} s{message}", *told])
        self.store.say(text.removesuffix("."), "bad" if not result.converged else "warn" if held else "")

    def _draw_table(self) -> None:
        result, truth = self.store.analysis.identification, self.store.opened.truth
        shown = result, truth if self._truth.value else None
        if self._drawn is None or any(a is not b for a, b in zip(self._drawn, shown, strict=True)):
            self._drawn = shown  # drawn once, not at every step of a slider
            self._table.content = panel(
                parameter_panel(*shown, goals=self.store.measurements.drive is not None)
            )


class EffectList:
    """One checkbox per effect."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store, self._page = store, page
        self.boxes: dict[str, Any] = {}
        self._kinds: list[tuple[ExplainedHtml, tuple[str, ...]]] = []  # of more effects: head, names
        gui = page.gui
        with gui.add_folder("Effects in the model"):
            for name in view.COMMON_EFFECTS:
                self._add(name)
            self._note = ExplainedHtml(gui, visible=False)
            with gui.add_folder("More effects", expand_by_default=False):
                for kind, names in (*view.more_effects().items(), (view.SERVO_KIND, view.SERVO_ONLY)):
                    head = ExplainedHtml(gui, f'<div class="fv fv-dim fv-kind">{escape(kind)}</div>')
                    self._kinds.append((head, names))
                    for name in names:
                        self._add(name)
            self.matrix = EffectMatrix(store, page)
        store.subscribe(Changed.OPENED, self._opened, Turn.CONTROLS)
        store.subscribe(Changed.OPENED | Changed.ANALYSIS, self._refresh, Turn.CONTROLS)

    def _add(self, name: str) -> None:
        self.boxes[name] = self._page.checkbox(effect_title(name), False, partial(self._set, name))
        self._page.style(wide_label, self.boxes[name])

    def _opened(self) -> None:
        """Offer what suits the set; lock its own effects, which are always in the model."""
        measurements = self._store.measurements
        goals = measurements.drive is not None
        for head, names in self._kinds:
            head.visible = any(view.suits(name, goals) for name in names)
        payloads = any(group.bodies for group in measurements.groups)
        for name, box in self.boxes.items():
            why = view.why_fixed(name, measurements.effects, payloads)
            box.visible = view.suits(name, goals)
            about = view.effect_hint(EFFECTS[name])
            off(box, f"{why}. {about}" if why else "", about)

    def _refresh(self) -> None:
        own, added = self._store.measurements.effects, self._store.analysis.effects
        joints = self._store.measurements.joints
        chosen = (*own, *added)
        for name, box in self.boxes.items():
            everywhere = name in JOINT_EFFECTS and view.joints_with(name, chosen, joints) == joints
            box.value = name in chosen or everywhere
        hidden = [name for name in self.boxes if name in chosen and name not in view.COMMON_EFFECTS]
        hidden += [
            name for name in chosen if name not in self.boxes and name.partition(":")[0] not in JOINT_EFFECTS
        ]
        text = f"Also in the model: {', '.join(map(effect_text_name, hidden))}." if hidden else ""
        text = f"{text} {view.effects_note(added, own)}".strip()
        self._note.content = dim(escape(text))
        self._note.visible = bool(text)

    def _set(self, name: str, on: bool) -> None:
        analysis = self._store.analysis
        if name in JOINT_EFFECTS:  # on all joints or on none, wherever it was before
            joints = self._store.measurements.joints
            effects = view.with_joints(name, joints if on else (), analysis.effects, joints)
            analysis = analysis.with_fit(effects=effects)
        else:
            analysis = analysis.with_effects([name]) if on else analysis.without_effects([name])
        self._store.change(f"{'with' if on else 'without'} {effect_title(name)}", analysis)


class ParameterCheck:
    """The button and its sentence in the store, from a trial fit whose values are discarded.

    After the first check, or change of a group's role or an effect, the sentence follows the settings.
    """

    def __init__(self, store: Store, page: Page) -> None:
        self._store = store
        self._follows = False
        self._seen: Settings | None = None  # the settings before the latest change
        self._of: Settings | None = None  # the settings of the sentence
        self._asked: Settings | None = None
        self._due: float | None = None
        self.button = page.button("Check", self._run)
        page.command("Check what can be identified", self._run)
        store.subscribe(Changed.OPENED, self._opened, Turn.CONTROLS)
        store.subscribe(Changed.NEW_STATE, self._new_state, Turn.CONTROLS)
        store.subscribe(Changed.OPENED | Changed.ANALYSIS | Changed.ACTIVITY, self._refresh, Turn.CONTROLS)
        store.subscribe(Changed.TICK, self._tick, Turn.CONTROLS)

    def _opened(self) -> None:
        self._follows = False
        self._seen = self._of = self._asked = self._due = None

    def _new_state(self) -> None:
        """Keep the sentence up to date after a change of roles or effects."""
        new, old = self._store.analysis.settings, self._seen
        if old is not None and (new.roles, new.effects) != (old.roles, old.effects):
            self._follows |= not self._store.analysis.up_to_date

    def _refresh(self) -> None:
        analysis = self._store.analysis
        settings = self._seen = analysis.settings
        hint = "which parameters these groups and effects can identify; changes nothing"
        off(self.button, self._store.why_not, hint)
        if not self._follows or settings in (self._of, self._asked):
            return
        if analysis.up_to_date:  # the result holds it
            self._show(settings, panel(check_blocks(analysis.identification)))
        else:
            self._due = time.monotonic() + SETTLE

    def _tick(self) -> None:
        """Check if due and idle."""
        if self._due is not None and time.monotonic() >= self._due and not self._store.running:
            self._run()

    def _run(self) -> None:
        store, analysis = self._store, self._store.analysis
        self._due = None
        if store.why_not:
            return
        settings = self._asked = analysis.settings

        def stopped() -> None:
            if self._asked == settings:
                self._asked = None
                store.set_check("")

        def done(result: Identification) -> None:
            if settings == store.analysis.settings:
                self._show(settings, panel(check_blocks(result)))
            else:
                stopped()

        def failed(reason: str) -> None:
            self._show(settings, warning(f"Check: {reason}"))

        store.set_check(dim("Checking what can be identified."))
        task = CheckParameters(analysis.without_result())
        store.tasks.start(task, done, failed=failed, stopped=stopped)

    def _show(self, settings: Settings, sentence: str) -> None:
        """Show the sentence of these settings."""
        self._follows, self._of, self._asked = True, settings, None
        self._store.set_check(sentence)
