"""The effects in step 3: common ones first, the others by kind in a closed folder."""

from __future__ import annotations

from functools import partial
from typing import Any

from flexviz.app.change import Changed, Turn
from flexviz.app.page import Page, dim
from flexviz.app.store import Store
from flexviz.app.style import wide_label
from flexviz.effects import EFFECTS
from flexviz.view import COMMON_EFFECTS, addable_effects, effect_hint, effects_note, more_effects, why_fixed
from flexviz.wording import escape


class EffectList:
    """One checkbox per effect."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store, self._page = store, page
        self.boxes: dict[str, Any] = {}
        gui = page.gui
        with gui.add_folder("Effects in the model"):
            for name in COMMON_EFFECTS:
                self._add(name)
            self._note = gui.add_html("", visible=False)
            with gui.add_folder("More effects", expand_by_default=False):
                for kind, names in more_effects().items():
                    gui.add_html(f'<div class="fv fv-dim fv-kind">{escape(kind)}</div>')
                    for name in names:
                        self._add(name)
        store.subscribe(Changed.OPENED, self._opened, Turn.CONTROLS)
        store.subscribe(Changed.OPENED | Changed.ANALYSIS, self._refresh, Turn.CONTROLS)

    def _add(self, name: str) -> None:
        box = self._page.gui.add_checkbox(name, False, hint=effect_hint(EFFECTS[name]))
        self.boxes[name] = self._page.watch(box, partial(self._set, name))
        self._page.style(wide_label, box)

    def _opened(self) -> None:
        """Lock the set's own effects, which are always in the model."""
        measurements = self._store.measurements
        payloads = any(group.bodies for group in measurements.groups)
        for name, box in self.boxes.items():
            why = why_fixed(name, measurements.effects, payloads)
            box.disabled = bool(why)
            box.hint = effect_hint(EFFECTS[name]) + (f" [{why}]" if why else "")

    def _refresh(self) -> None:
        """Show the effects of the model."""
        own, added = self._store.measurements.effects, self._store.analysis.effects
        chosen = (*own, *added)
        for name, box in self.boxes.items():
            box.value = name in chosen
        hidden = [name for name in addable_effects() if name in chosen and name not in COMMON_EFFECTS]
        hidden += [name for name in chosen if name not in self.boxes]
        text = f"Also in the model: {', '.join(hidden)}." if hidden else ""
        text = f"{text} {effects_note(added, own)}".strip()
        self._note.content = dim(escape(text))
        self._note.visible = bool(text)

    def _set(self, name: str, on: bool) -> None:
        analysis = self._store.analysis.with_effect(name, on)
        self._store.change(f"{'with' if on else 'without'} {name}", analysis)
