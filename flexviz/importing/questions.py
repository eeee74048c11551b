"""Questions to a person at a terminal, with defaults where nobody is asked."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

T = TypeVar("T")
Ask = Callable[[str, str], str]  # question, answer when only Enter is pressed -> answer


class Questions(Protocol):
    """Somebody who can be asked."""

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
    """Asks a person; `tell` shows a line, `ask` returns what was typed. Invalid answers are asked again."""

    def __init__(self, ask: Ask, tell: Callable[[str], None]) -> None:
        self.ask, self.tell = ask, tell

    def choose(self, question: str, options: Sequence[str], default: int | None) -> int | None:
        self._list([question, *options])
        self.tell("  0  none of these")

        def parse(text: str) -> int | None:
            return int(text) if text.isdigit() and int(text) <= len(options) else None

        expected = f"is none of 0 … {len(options)}"
        answer = self._until_valid("number", str(0 if default is None else default + 1), parse, expected)
        return answer - 1 if answer else None

    def numbers(self, question: str, count: int, default: float | None) -> list[float] | None:
        wanted = "one number" + (f", or {count} with commas" if count > 1 else "")
        unknown = "" if default is not None else "; only Enter where it is not known"

        def parse(text: str) -> list[float] | None:
            try:
                values = [float(part) for part in parts_of(text)]
            except ValueError:
                return None
            if len(values) not in (0, 1, count) or not all(0.0 < value < 1e9 for value in values):
                return None
            return values * count if len(values) == 1 else values

        shown = "" if default is None else f"{default:g}"
        expected = f"is not {wanted} above 0"
        return self._until_valid(f"{question} ({wanted}{unknown})", shown, parse, expected) or None

    def several(self, question: str, options: Sequence[str]) -> list[int]:
        self._list([question, *options])

        def parse(text: str) -> list[int] | None:
            parts = parts_of(text)
            valid = all(part.isdigit() and 1 <= int(part) <= len(options) for part in parts)
            return sorted({int(part) - 1 for part in parts}) if valid else None

        expected = f"holds something that is none of 1 … {len(options)}"
        return self._until_valid("numbers with commas, only Enter for none", "", parse, expected)

    def _list(self, lines: Sequence[str]) -> None:
        self.tell(lines[0])
        for i, option in enumerate(lines[1:]):
            self.tell(f"  {i + 1}  {option}")

    def _until_valid(self, question: str, default: str, parse: Callable[[str], T | None], wrong: str) -> T:
        while True:
            text = self.ask(question, default).strip()
            answer = parse(text)
            if answer is not None:
                return answer
            self.tell(f'"{text}" {wrong}')


def parts_of(text: str) -> list[str]:
    """The words of an answer, separated by commas or spaces."""
    return re.findall(r"[^,\s]+", text)
