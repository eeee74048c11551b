"""The commands that the documents show, found in their Markdown."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

from markdown_it import MarkdownIt

ROOT = Path(__file__).resolve().parent.parent
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
PROGRAMS = ("flexviz", "make", "python", "pytest", "rerun", "sha256sum")
COMMENT = re.compile(r"\s{2,}#.*|\s#\s.*")


@dataclass(frozen=True)
class Shown:
    """One command: the page's path in the project, its line, its words without .venv/bin/."""

    page: str
    line: int
    words: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.page}:{self.line}: {' '.join(self.words)}"


def blocks(page: Path) -> list[Shown]:
    """Commands that stand in a block of their own: to be typed as they are."""
    found = []
    for token in MarkdownIt("commonmark").parse(page.read_text(encoding="utf-8")):
        if token.type != "code_block" and (token.type, token.info) not in (("fence", ""), ("fence", "sh")):
            continue
        assert token.map is not None
        for offset, text in enumerate(token.content.splitlines()):
            line = token.map[0] + 1 + offset + (token.type == "fence")
            for part in COMMENT.sub("", text).split(" && "):
                if words := command(part):
                    found.append(Shown(str(page.relative_to(ROOT)), line, words))
    return found


def mentions(page: Path) -> list[Shown]:
    """Commands of flexviz that are named within a text."""
    found = []
    for token in MarkdownIt("commonmark").enable("table").parse(page.read_text(encoding="utf-8")):
        for child in token.children or []:
            if child.type == "code_inline" and child.content.startswith("flexviz "):
                line = token.map[0] + 1 if token.map else 0
                words = tuple(child.content.replace("\\|", "|").split())
                found.append(Shown(str(page.relative_to(ROOT)), line, words))
    return found


def command(text: str) -> tuple[str, ...]:
    """The words of a command, or nothing where the line is output or something else."""
    text = text.strip().removeprefix(".venv/bin/")
    if text.partition(" ")[0] not in PROGRAMS:
        return ()
    return tuple(shlex.split(text))


def outputs(page: Path) -> list[str]:
    """Blocks of output: code without a language in which no line is a command, with at least two numbers."""
    found = []
    for token in MarkdownIt("commonmark").parse(page.read_text(encoding="utf-8")):
        if token.type == "code_block" or (token.type, token.info) == ("fence", ""):
            lines = token.content.splitlines()
            if not any(map(command, lines)) and len(re.findall(r"\d", token.content)) > 1:
                found.append(token.content)
    return found
