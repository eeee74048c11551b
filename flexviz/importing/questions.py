"""Questions to a person at a terminal, with defaults where nobody is asked."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Protocol

Ask = Callable[[str, str], str]  # question, answer when only Enter is pressed -> answer


class Questions(Protocol):
    """Source of answers to questions."""

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
    """Returns the defaults without asking."""

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
        self._show(question, options)
        self.tell("  0  none of these")
        valid = range(len(options) + 1)
        preset = str(0 if default is None else default + 1)
        wrong = f"is none of 0 … {len(options)}"
        (answer,) = self._ask("number", preset, lambda x: len(x) == 1 and x[0] in valid, wrong)
        return int(answer) - 1 if answer else None

    def numbers(self, question: str, count: int, default: float | None) -> list[float] | None:
        wanted = "one number" + (f", or {count} with commas" if count > 1 else "")
        unknown = "" if default is not None else "; only Enter where it is not known"
        values = self._ask(
            f"{question} ({wanted}{unknown})",
            "" if default is None else f"{default:g}",
            lambda x: len(x) in (0, 1, count) and all(0.0 < value < 1e9 for value in x),
            f"is not {wanted} above 0",
        )
        return (values * count if len(values) == 1 else values) or None

    def several(self, question: str, options: Sequence[str]) -> list[int]:
        self._show(question, options)
        valid = range(1, len(options) + 1)
        wrong = f"holds something that is none of 1 … {len(options)}"
        prompt = "numbers with commas, only Enter for none"
        found = self._ask(prompt, "", lambda x: all(number in valid for number in x), wrong)
        return sorted({int(number) - 1 for number in found})

    def _show(self, question: str, options: Sequence[str]) -> None:
        for line in (question, *(f"  {i + 1}  {option}" for i, option in enumerate(options))):
            self.tell(line)

    def _ask(
        self, prompt: str, default: str, valid: Callable[[list[float]], bool], wrong: str
    ) -> list[float]:
        """Numbers separated by commas or spaces, asked for until they are valid."""
        while True:
            text = self.ask(prompt, default).strip()
            try:
                numbers = [float(word) for word in re.findall(r"[^,\s]+", text)]
                if valid(numbers):
                    return numbers
            except ValueError:
                pass
            self.tell(f'"{text}" {wrong}')
