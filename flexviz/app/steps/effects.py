"""The effects in step 3: the common ones in sight, the others by kind in a folder that is closed at first."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flexviz.app.controls import watch
from flexviz.app.style import wide_label
from flexviz.effects import EFFECTS
from flexviz.view import COMMON_EFFECTS, addable_effects, effect_hint, effects_note, more_effects, why_fixed
from flexviz.wording import escape

if TYPE_CHECKING:
    from flexviz.app.application import Application


class EffectList:
    """One checkbox an effect; made inside the step's folder."""

    def __init__(self, app: Application) -> None:
        self._app = app
        self.boxes: dict[str, Any] = {}
        gui = app.server.gui
        with gui.add_folder("Effects in the model"):
            for name in COMMON_EFFECTS:
                self._add(name)
            self._note = gui.add_html("", visible=False)
            with gui.add_folder("More effects", expand_by_default=False):
                for kind, names in more_effects().items():
                    gui.add_html(f'<div class="fv fv-dim fv-kind">{escape(kind)}</div>')
                    for name in names:
                        self._add(name)

    def opened(self) -> None:
        """A new set is shown: its own effects are in the model and stay there."""
        measurements = self._app.measurements
        payloads = any(group.bodies for group in measurements.groups)
        for name, box in self.boxes.items():
            why = why_fixed(name, measurements.effects, payloads)
            box.disabled = bool(why)
            box.hint = effect_hint(EFFECTS[name]) + (f" [{why}]" if why else "")

    def refresh(self) -> None:
        """Show which are in the model."""
        own, added = self._app.measurements.effects, self._app.session.analysis.effects
        chosen = (*own, *added)
        for name, box in self.boxes.items():
            box.value = name in chosen
        hidden = [name for name in addable_effects() if name in chosen and name not in COMMON_EFFECTS]
        hidden += [name for name in chosen if name not in self.boxes]
        text = f"Also in the model: {', '.join(hidden)}." if hidden else ""
        text = f"{text} {effects_note(added, own)}".strip()
        self._note.content = f'<div class="fv fv-dim">{escape(text)}</div>'
        self._note.visible = bool(text)

    def _add(self, name: str) -> None:
        app = self._app
        box = app.server.gui.add_checkbox(name, False, hint=effect_hint(EFFECTS[name]))
        watch(box, app.queue, f"effect-{name}")
        app.on(f"effect-{name}", lambda on: self._set(name, on))
        app.add_style(wide_label(box._impl.uuid))
        self.boxes[name] = box

    def _set(self, name: str, on: bool) -> None:
        analysis = self._app.session.analysis.with_effect(name, on)
        self._app.change(f"{'with' if on else 'without'} {name}", analysis)
        self._app.identify.check.changed()
