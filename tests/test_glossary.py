"""Terms are explained where a text first uses them, and nowhere else."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from flexviz.content import blocks
from flexviz.content.rendering import html
from flexviz.content.wording import GLOSSARY, with_terms

MARK = re.compile(r'<abbr class="fv-term"( tabindex="0")? title="([^"]*)">(.*?)</abbr>')
DOCS = Path(__file__).resolve().parents[1] / "docs"


def marked(text: str) -> list[str]:
    """The words that carry an explanation."""
    return [found[2] for found in MARK.findall(with_terms(text))]


def test_the_first_appearance_is_explained_once() -> None:
    text = "<b>Residual</b> 6.5 % of the torque, noise 0.1 %; residual of joint2 12 % of its torque"
    assert marked(text) == ["Residual", "% of the torque", "noise"]
    out = with_terms(text)
    assert MARK.sub(r"\3", out) == text
    assert "sensors&#x27; noise alone" in out and out.index("<abbr") < out.index("6.5")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("K joint1, B joint2, f_lv joint1", ["K", "B", "f_lv"]),
        ("f_lv+f_mv ± 95 %", ["f_lv+f_mv", "± 95 %"]),
        ("the unstructured residual, a structured residual", ["residual", "structured residual"]),
        ("an error on held-out groups (ESO)", ["held-out", "ESO"]),
        ("flag, blag, KUKA, Bad, B2, joint_B, nm/K, normalised:B", []),
        ("stiffness:K of eso.K", []),
    ],
)
def test_only_whole_words_are_terms(text: str, words: list[str]) -> None:
    assert marked(text) == words


def test_what_is_pressed_copied_or_drawn_stays_as_it_is() -> None:
    for text in (
        "<button>residual</button>",
        "<summary>residual</summary>",
        '<svg><text>residual</text></svg><p title="residual">none</p>',
        "<pre>K = 3</pre>",
        "<h2>Residual</h2>",
        "<s>validation</s>",
    ):
        assert with_terms(text) == text
    assert marked("<s>old</s> residual <svg><g/></svg> rms<br>K") == ["residual", "rms", "K"]


def test_text_from_outside_stays_text() -> None:
    evil = "&lt;img src=x onerror=alert(1)&gt; residual &quot;"
    out = with_terms(f"<b>{evil}</b>")
    assert "<img" not in out and MARK.sub(r"\3", out) == f"<b>{evil}</b>"


def test_terms_that_are_known_are_not_explained_again() -> None:
    known = {"residual"}
    assert MARK.findall(with_terms("residual, rms", known=known))[0][2] == "rms"
    assert known == {"residual", "rms"}


def test_every_term_is_found_by_its_name_and_reads_as_a_sentence() -> None:
    for term in GLOSSARY:
        found = MARK.findall(with_terms(f"the {term.name} of it"))
        assert len(found) == 1 and found[0][2] == term.name, term
        assert term.text.endswith(".") and term.text[0].isupper() and len(term.text) < 160, term
    assert len({term.name for term in GLOSSARY}) == len(GLOSSARY)


def test_the_documentation_has_the_same_list() -> None:
    text = re.sub(r"\n  ", " ", (DOCS / "glossary.md").read_text(encoding="utf-8"))
    written = re.findall(r"^- \*\*(.+?)\*\*: (.+)$", text, re.MULTILINE)
    terms = sorted(GLOSSARY, key=lambda term: term.name.lower())
    assert written == [(term.name, term.text) for term in terms]


def test_a_report_explains_terms_once_per_section_without_scripts() -> None:
    part = blocks.section("Residual", blocks.Paragraph("The residual. The residual again."))
    page = html(blocks.ReportDocument("t", "", (), (part, part), ""))
    assert page.count("<abbr") == 2 and page.count('<abbr class="fv-term" tabindex="0"') == 2
    assert "abbr:focus::after" in page and "<script" not in page
    assert "<h2>Residual</h2>" in page
