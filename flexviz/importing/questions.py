"""Questions to a person at a terminal, each with an answer that stands where nobody is asked."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Protocol

Ask = Callable[[str, str], str]  # question, answer when only Enter is pressed -> answer


class Questions(Protocol):
    """Whom to ask."""

    def choose(self, question: str, options: Sequence[str], default: int | None) -> int | None:
        """The index of one of the options, or None for none of them."""
        ...

    def numbers(self, question: str, count: int, default: float | None) -> list[float] | None:
        """`count` positive numbers (one stands for all), or None where they are not known."""
        ...

    def several(self, question: str, options: Sequence[str]) -> list[int]:
        """The indices of some of the options."""
        ...


class Silent:
    """Asks nobody."""

    def choose(self, question: str, options: Sequence[str], default: int | None) -> int | None:
        return default

    def numbers(self, question: str, count: int, default: float | None) -> list[float] | None:
        return None if default is None else [default] * count

    def several(self, question: str, options: Sequence[str]) -> list[int]:
        return []


class Person:
    """Asks a person; `tell` shows a line, `ask` returns what was typed. Nonsense is asked again."""

    def __init__(self, ask: Ask, tell: Callable[[str], None]) -> None:
        self.ask, self.tell = ask, tell

    def choose(self, question: str, options: Sequence[str], default: int | None) -> int | None:
        self.tell(question)
        for i, option in enumerate(options):
            self.tell(f"  {i + 1}  {option}")
        self.tell("  0  none of these")
        while True:
            answer = self.ask("number", str(0 if default is None else default + 1)).strip()
            if answer.isdigit() and 0 <= int(answer) <= len(options):
                return int(answer) - 1 if int(answer) else None
            self.tell(f'"{answer}" is none of 0 … {len(options)}')

    def numbers(self, question: str, count: int, default: float | None) -> list[float] | None:
        wanted = "one number" + (f", or {count} with commas" if count > 1 else "")
        while True:
            unknown = "" if default is not None else "; only Enter where it is not known"
            text = self.ask(
                f"{question} ({wanted}{unknown})", "" if default is None else f"{default:g}"
            ).strip()
            if not text:
                return None
            parts = re.split(r"[,\s]+", text)
            try:
                values = [float(part) for part in parts]
            except ValueError:
                values = []
            if len(values) in (1, count) and all(0.0 < value < 1e9 for value in values):
                return values * count if len(values) == 1 else values
            self.tell(f'"{text}" is not {wanted} above 0')

    def several(self, question: str, options: Sequence[str]) -> list[int]:
        self.tell(question)
        for i, option in enumerate(options):
            self.tell(f"  {i + 1}  {option}")
        while True:
            text = self.ask("numbers with commas, only Enter for none", "").strip()
            parts = [part for part in re.split(r"[,\s]+", text) if part]
            if all(part.isdigit() and 1 <= int(part) <= len(options) for part in parts):
                return sorted({int(part) - 1 for part in parts})
            self.tell(f'"{text}" holds something that is none of 1 … {len(options)}')
