"""What the documents show is what the program prints: names, blocks of output, values with intervals."""

from __future__ import annotations

import re
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

from flexviz.analysis.diagnosis import Diagnosis
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS
from flexviz.outlets.terminal import main
from flexviz.outlets.terminal.terminal import show
from tests.shown_commands import PAGES, ROOT, outputs

DOCUMENTS = [page for page in PAGES if page.name == "README.md" or page.parent.name == "docs"]
PRINTING = ("tutorial.md", "reading-a-verdict.md")  # pages with output for the example data
ROBOT = "planar_2r_"  # exported functions start with the name of the robot
FOREIGN = ("importing.md",)  # names of columns of others' logs
WORD = re.compile(r"`([a-z]+(?:_[a-z0-9]+)+)(:[a-z]\w*)?`")
VALUE = re.compile(r"([\d.]*\d) ± ([\d.]*\d)")


@pytest.fixture(scope="module")
def printed(demo: MeasurementSet, diagnosed_demo: Diagnosis) -> str:
    """What `identify` and `diagnose --apply` print of the example data, collapsed."""
    out = StringIO()
    with redirect_stdout(out):
        for options in (["--quick"], ["--effect", "coulomb_friction:joint2"]):
            assert main(["identify", str(demo.path), *options]) == 0
        show(diagnosed_demo.document())
    return collapsed(out.getvalue())


def collapsed(text: str) -> str:
    """Words with single spaces, without the rules of tables."""
    return " ".join(re.sub(r"─+", " ", text).split())


@pytest.mark.parametrize(
    "page", [page for page in DOCUMENTS if page.name in PRINTING], ids=lambda page: page.stem
)
def test_blocks_of_output_are_what_is_printed(page: Path, printed: str) -> None:
    shown = list(outputs(page))
    assert shown
    wrong = [line for block in shown for line in block.splitlines() if collapsed(line) not in printed]
    assert not wrong, printed


def test_values_of_the_tutorial_are_what_is_printed(printed: str) -> None:
    values = VALUE.findall((ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8"))
    assert len(values) > 5
    assert not [
        pair for pair in values if not any(f"{pair[0]}{sep}{pair[1]} " in printed for sep in (" ", " ± "))
    ]


@pytest.mark.parametrize("page", DOCUMENTS, ids=lambda page: page.stem)
def test_names_in_backticks_exist(page: Path, sources: str) -> None:
    """Effects, parameters, keys and functions; what stands before a joint is an effect or a parameter."""
    found = WORD.findall(page.read_text(encoding="utf-8"))
    unknown = {
        name
        for name, _ in found
        if page.name not in FOREIGN and not re.search(rf"\b{name.removeprefix(ROBOT)}\b", sources)
    }
    assert not unknown
    assert not {name for name, place in found if place.startswith(":joint") and name not in EFFECTS}


@pytest.fixture(scope="module")
def sources() -> str:
    """All code."""
    return "\n".join(file.read_text(encoding="utf-8") for file in (ROOT / "flexviz").rglob("*.py"))
