"""Tooltips of buttons, drawn by the style sheet, because viser has none for buttons."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

DELAY = 0.5  # [s] as viser's own


class Tooltips:
    """All buttons with tooltips."""

    def __init__(self) -> None:
        self._buttons: list[Any] = []
        self._right: set[str] = set()

    def add(self, button: Any) -> None:
        """Show this button's hint, also while it is disabled."""
        self._buttons.append(button)

    def open_left(self, uuids: Iterable[str]) -> None:
        """Open the hints of these buttons to the left."""
        self._right |= set(uuids)

    def rules(self) -> list[str]:
        """CSS rules for the present hints."""
        shown = [button for button in self._buttons if button.hint and button.visible]
        if not shown:
            return []
        boxes = [f'div:has(> button[id="{button._impl.uuid}"])' for button in shown]
        hovered = ", ".join(f"{box}:hover::after" for box in boxes)
        common = (
            "position: absolute; top: calc(100% - 2px); z-index: 50; width: max-content; max-width: 15rem; "
            "padding: 0.35em 0.6em; border-radius: 4px; background: #212529; color: #fff; font-size: 12px; "
            f"line-height: 1.4; pointer-events: none; animation: fv-appear 0.1s {DELAY}s both;"
        )
        own = [
            f"{box}:hover::after {{ content: {css_text(button.hint)}; "
            f"{'right' if button._impl.uuid in self._right else 'left'}: 6px; }}"
            for box, button in zip(boxes, shown, strict=True)
        ]
        return [
            "@keyframes fv-appear { from { opacity: 0; } to { opacity: 1; } }",
            f"{', '.join(boxes)} {{ position: relative; }}",
            f"{hovered} {{ {common} }}",
            *own,
        ]


def css_text(text: str) -> str:
    """A text as a CSS string that is safe in HTML."""
    escaped = "".join(
        f"\\{ord(character):x} " if character in "\"'\\<>&\n\r" else character for character in text
    )
    return f'"{escaped}"'
