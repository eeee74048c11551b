"""Texts of the panels, in which terms are explained. The page's script underlines the first of each panel."""

from __future__ import annotations

from typing import Any

from flexviz.content.wording import with_terms


class ExplainedHtml:
    """viser's element for HTML; its terms carry their explanations."""

    def __init__(self, gui: Any, html: str = "", visible: bool = True) -> None:
        """`html` must be safe: texts from outside are escaped by the view."""
        self._html = html
        self._handle = gui.add_html(with_terms(html), visible=visible)

    @property
    def content(self) -> str:
        """The HTML, without explanations."""
        return self._html

    @content.setter
    def content(self, html: str) -> None:
        if html != self._html:
            self._html = html
            self._handle.content = with_terms(html)

    @property
    def visible(self) -> bool:
        """Whether it is shown."""
        return self._handle.visible

    @visible.setter
    def visible(self, on: bool) -> None:
        self._handle.visible = on

    @property
    def order(self) -> float:
        """Its place among its neighbours."""
        return self._handle.order
