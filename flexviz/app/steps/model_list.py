"""The effects in the model, each with a button that removes it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from flexviz.app.page import Page, off
from flexviz.wording import effect_text_name, escape

MAX_EFFECTS = 12


class ModelList:
    """A fixed number of rows for effects."""

    def __init__(self, page: Page, remove: Callable[[str], None]) -> None:
        self._effects: tuple[str, ...] = ()
        self._remove = remove
        self._heading = page.gui.add_html("")
        self._rows = []
        for index in range(MAX_EFFECTS):
            text = page.gui.add_html("", visible=False)
            button = page.button("Remove", partial(self._pressed, index), visible=False)
            page.row((button,), share=0.3)
            self._rows.append((text, button))

    def show(self, own: Sequence[str], added: Sequence[str], why: str) -> None:
        """Show the set's own and the added effects; `why`: the reason that none can be removed now."""
        self._effects = tuple(added)
        names = ", ".join(effect_text_name(name) for name in own)
        text = f"the set's own: {names}" if own else ""
        if not own and not added:
            text = "stiffness, inertia and viscous friction only"
        more = f" and {len(added) - MAX_EFFECTS} more" if len(added) > MAX_EFFECTS else ""
        self._heading.content = (
            f'<div class="fv"><b>In the model</b>{": " if text else ""}{escape(text)}{more}</div>'
        )
        for index, (text, button) in enumerate(self._rows):
            text.visible = button.visible = index < len(added)
            off(button, why, "removes it, refits and diagnoses again")
            if index < len(added):
                text.content = f'<div class="fv fv-added">+ {escape(effect_text_name(added[index]))}</div>'

    def _pressed(self, index: int) -> None:
        if index < len(self._effects):
            self._remove(self._effects[index])
