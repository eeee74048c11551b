"""The fall of the error when an effect is added, which `fall.js` shows on every page."""

from __future__ import annotations

from flexviz.content.session import effect_added
from flexviz.outlets.app.page import Page
from flexviz.outlets.app.state import Changed
from flexviz.outlets.app.store import Store

LENGTH = 0.9  # [s] from the model before to the present one
STYLE = (
    f":root {{ --fv-fall: {LENGTH}s; }}\n"
    "@media (prefers-reduced-motion: reduce) { :root { --fv-fall: 0s; } }"
)


def fall_html(count: int) -> str:
    """What the page's script reads: a number that grows with every fall."""
    return f'<i data-fv-fall="{count}" style="display: none"></i>'


class Fall:
    """Tells the pages of an added effect, before they get its model."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store, self._count = store, 0
        page.rules.append(STYLE)
        self._shown = page.gui.add_html(fall_html(0))
        store.subscribe(Changed.NEW_STATE, self._tell)

    def _tell(self) -> None:
        if effect_added(self._store.session):
            self._count += 1
            self._shown.content = fall_html(self._count)
