"""Questions that an inspection asks, with defaults where nobody is there to answer."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

Ask = Callable[[str, str], str]  # question, answer when only Enter is pressed -> answer


class Questions:
    """Answers to questions: the defaults, without asking anybody."""

    def choose(self, question: str, options: Sequence[str], default: int | None) -> int | None:
        """The index of one of the options, or None for none of them."""
        return default

    def numbers(self, question: str, count: int) -> list[float] | None:
        """`count` positive numbers (one stands for all), or None where they are not known."""
        return None

    def several(self, question: str, options: Sequence[str]) -> list[int]:
        """The indices of some of the options."""
        return []


class Person(Questions):
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

    def numbers(self, question: str, count: int) -> list[float] | None:
        wanted = "one number" + (f", or {count} with commas" if count > 1 else "")
        values = self._ask(
            f"{question} ({wanted}; only Enter where it is not known)",
            "",
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
