"""The documents: their Python runs, their links lead somewhere, and they become a site."""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md"))]
WITH_PYTHON = [page for page in PAGES if "```python" in page.read_text(encoding="utf-8")]


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_PYTHON, ids=lambda page: page.name)
def test_python_in_documents_runs(page: Path, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "sessions" / "planar-2r-demo", tmp_path / "demo")
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "page.py").write_text("\n".join(blocks), encoding="utf-8")
    run = subprocess.run([sys.executable, "page.py"], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr


# -- the site ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def builder() -> Any:
    spec = importlib.util.spec_from_file_location("build_site", ROOT / "docs" / "build_site.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["build_site"] = module  # its dataclasses look themselves up
    spec.loader.exec_module(module)
    return module


class Reader(HTMLParser):
    """What a page of the site names and asks for."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {name: value or "" for name, value in attrs}
        if "id" in found:
            self.ids.add(found["id"])
        if tag == "a":
            self.links.append(found["href"])
        elif tag in ("img", "script", "link", "iframe"):
            self.fetched.append(found.get("src") or found.get("href", ""))


def test_the_site_holds_together(builder: Any, tmp_path: Path) -> None:
    count = builder.build(ROOT, tmp_path / "site")
    pages = {file: Reader(file.read_text(encoding="utf-8")) for file in (tmp_path / "site").rglob("*.html")}
    assert len(pages) == count >= len(PAGES) + 20
    for file, page in pages.items():
        for address in page.fetched:
            assert "://" not in address and (file.parent / address).is_file(), (file, address)
        for address in page.links:
            if address.startswith(("http://", "https://")):
                continue
            path, _, anchor = address.partition("#")
            target = (file.parent / path).resolve() if path else file
            assert target.is_file(), (file, address)
            assert not anchor or anchor in pages[target].ids, (file, address)
    side_bar = pages[tmp_path / "site" / "effects" / "backlash.html"].links
    assert {"../tutorial.html", "../reading-a-verdict.html", "../index.html"} <= set(side_bar)
    tutorial = (tmp_path / "site" / "tutorial.html").read_text(encoding="utf-8")
    assert "<title>Tutorial" in tutorial and 'aria-current="page">Tutorial<' in tutorial
    assert builder.build(ROOT, tmp_path / "site") == count  # again, over itself
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["site"]


def test_every_document_is_in_the_contents() -> None:
    listed = re.findall(r"\]\(([^)]+)\)", (ROOT / "docs" / "README.md").read_text(encoding="utf-8"))
    assert not {page.name for page in (ROOT / "docs").glob("*.md")} - {"README.md", *listed}


def test_broken_links_are_named(builder: Any, tmp_path: Path) -> None:
    project = tmp_path / "project"
    (project / "docs").mkdir(parents=True)
    (project / "README.md").write_text("# One\n\n[a](docs/README.md#two) [b](https://example.org)\n")
    (project / "docs" / "README.md").write_text("# Contents\n\n## Two\n\n[back](../README.md#one)\n")
    assert builder.build(project, tmp_path / "site") == 2
    (project / "docs" / "bad.md").write_text(
        "# Bad\n\n[x](nothing.md)\n\n![y](no.png)\n\n[z](README.md#three) [u](../../up.md) [v](#bad)\n"
    )
    with pytest.raises(builder.Refused) as caught:
        builder.build(project, tmp_path / "site")
    lines = str(caught.value).splitlines()
    assert lines == [
        "docs/bad.md:3: nothing.md leads nowhere",
        "docs/bad.md:5: no.png leads nowhere",
        "docs/bad.md:7: README.md#three: there is no such heading",
        "docs/bad.md:7: ../../up.md leads nowhere",
    ]
    assert (tmp_path / "site" / "contents.html").is_file()  # the old one is still there
    with pytest.raises(builder.Refused, match="something else in it"):
        builder.build(ROOT, project)
    assert (project / "README.md").is_file()


def test_the_command(builder: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert builder.main([str(tmp_path / "site")]) == 0
    assert "index.html" in capsys.readouterr().out
