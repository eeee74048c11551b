"""The effects in the model, each with a button that takes it out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from flexviz.app.controls import off as switch_off
from flexviz.wording import effect_text_name, escape

if TYPE_CHECKING:
    from flexviz.app.application import Application

MOST = 12


class ModelList:
    """A fixed number of rows that effects appear in; made inside the step's folder."""

    def __init__(self, app: Application, remove: Callable[[str], None]) -> None:
        gui = app.server.gui
        self._effects: tuple[str, ...] = ()
        self._remove = remove
        self._heading = gui.add_html("")
        self._rows = []
        for index in range(MOST):
            text = gui.add_html("", visible=False)
            button = gui.add_button("Remove", color="gray", visible=False)
            app.press(button, f"remove{index}", lambda index=index: self._pressed(index))
            app.row(button, share=0.3)
            self._rows.append((text, button))

    def show(self, own: Sequence[str], added: Sequence[str], why: str) -> None:
        """The set's own effects and the added ones; `why` says why nothing can be taken out now."""
        self._effects = tuple(added)
        names = ", ".join(effect_text_name(name) for name in own)
        parts = [f"the set's own: {names}"] if own else []
        if not own and not added:
            parts.append("stiffness, inertia and viscous friction only")
        more = f" and {len(added) - MOST} more" if len(added) > MOST else ""
        text = escape("; ".join(parts))
        self._heading.content = f'<div class="fv"><b>In the model</b>{": " if text else ""}{text}{more}</div>'
        for index, (text, button) in enumerate(self._rows):
            there = index < len(added)
            text.visible = button.visible = there
            switch_off(button, why, "takes it out, refits, and looks again")
            if there:
                text.content = f'<div class="fv fv-added">+ {escape(effect_text_name(added[index]))}</div>'

    def _pressed(self, index: int) -> None:
        if index < len(self._effects):
            self._remove(self._effects[index])
