"""The documents: their links resolve, and they build into a site that loads nothing."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

import flexviz
from benchmarks import licences

ROOT = Path(__file__).resolve().parent.parent
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md"))]
EFFECTS = sorted((ROOT / "docs" / "effects").glob("*.md"))
RESULTS = ROOT / "benchmarks" / "results"


def test_every_picture_that_a_document_shows_is_there_and_the_other_way_round() -> None:
    shown = set()
    for page in [*PAGES, *EFFECTS, *RESULTS.glob("*.md")]:
        for alt, place in re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", page.read_text(encoding="utf-8")):
            assert len(alt) > 15, (page.name, place)
            shown.add((page.parent / place).resolve())
    folders = (ROOT / "docs", RESULTS)
    drawn = {picture for one in folders for picture in one.rglob("images/**/*") if picture.is_file()}
    assert shown == drawn | {picture for picture in (ROOT / "docs" / "effects").glob("*.svg")}


def test_llms_txt_names_every_page_by_its_title_and_nothing_else() -> None:
    docs = ROOT / "docs"
    text = (docs / "llms.txt").read_text(encoding="utf-8")
    named = {
        place: (title, about) for title, place, about in re.findall(r"^- \[(.+)\]\((.+)\): (.+)$", text, re.M)
    }
    pages = [*docs.glob("*.md"), *(docs / "reference").glob("*.md"), docs / "effects" / "README.md"]
    assert set(named) == {page.relative_to(docs).as_posix() for page in pages}
    for page in docs.glob("*.md"):
        title = page.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
        assert page.name == "README.md" or named[page.name][0] == title, page.name


def test_the_licence_of_every_package_is_listed() -> None:
    lines = re.findall(r"^- \*\*.+\*\*: (.+)$", licences.PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    listed = {name for line in lines for name in line.split(", ")}
    assert len(licences.packages()) > 50 and not set(licences.packages()) - listed


# -- the site ----------------------------------------------------------------------------------------


def build(config: Path, out: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", str(config), "-d", str(out)],
        cwd=config.parent, capture_output=True, text=True, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
    )  # fmt: skip


class Page(HTMLParser):
    """What a page of the site loads, and its text's anchors."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.loaded: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {name: value or "" for name, value in attrs}
        self.ids.add(found.get("id", ""))
        if tag in ("img", "script", "iframe") or (tag == "link" and found.get("rel") != "canonical"):
            self.loaded.append(found.get("src") or found.get("href", ""))


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("site")
    built = build(ROOT / "mkdocs.yml", out)
    assert built.returncode == 0, built.stderr  # strict: a broken link or a page without a place fails
    return out


def test_the_site_loads_nothing_from_elsewhere(site: Path) -> None:
    pages = {file: Page(file.read_text(encoding="utf-8")) for file in site.rglob("*.html")}
    assert len(pages) > 45
    for file, page in pages.items():
        for address in filter(None, page.loaded):
            assert "://" not in address, (file, address)
            if file.name != "404.html":
                assert (file.parent / address.partition("?")[0]).exists(), (file, address)


def test_the_site_has_llms_txt_with_its_own_pages(site: Path) -> None:
    places = re.findall(r"\]\((.+?)\)", (site / "llms.txt").read_text(encoding="utf-8"))
    assert len(places) > 30 and all((site / place).is_file() for place in places)


def test_every_public_name_is_in_the_reference(site: Path) -> None:
    documented = set()
    for file in (site / "reference").glob("*.html"):
        documented |= {name.rsplit(".", 1)[-1] for name in Page(file.read_text(encoding="utf-8")).ids}
    missing = set(flexviz.__all__) - documented - {"__version__"}
    assert not missing, sorted(missing)


def test_a_broken_link_fails_the_build(tmp_path: Path) -> None:
    project = tmp_path / "project"
    shutil.copytree(
        ROOT / "docs", project / "docs", ignore=shutil.ignore_patterns("reference", "images", "*.svg")
    )
    for name in ("mkdocs.yml", "CONTRIBUTING.md", "CHANGELOG.md"):
        shutil.copy(ROOT / name, project / name)
    page = project / "docs" / "tutorial.md"
    page.write_text(page.read_text(encoding="utf-8") + "\n[x](nothing.md) [y](app.md#no-such-heading)\n")
    built = build(project / "mkdocs.yml", tmp_path / "site")
    assert built.returncode == 1
    assert "nothing.md" in built.stderr and "no-such-heading" in built.stderr
