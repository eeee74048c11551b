"""MkDocs hooks: CONTRIBUTING.md, CHANGELOG.md and benchmarks/results are pages of the site, too."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parent.parent
ROOT_PAGES = ("CONTRIBUTING.md", "CHANGELOG.md")
RESULTS = ROOT / "benchmarks" / "results"


def on_files(files: Files, config: Any) -> Files:
    """Add the root's pages, and those of benchmarks/results with their pictures as results/."""
    for name in ROOT_PAGES:
        files.append(File.generated(config, name, abs_src_path=str(ROOT / name)))
    for path in sorted((*RESULTS.rglob("*.md"), *RESULTS.rglob("*.svg"))):
        place = f"results/{path.relative_to(RESULTS).as_posix()}"
        files.append(File.generated(config, place, abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Make links between docs/, results and the root, right in the repository, right in the site."""
    place: str = page.file.src_uri
    if place in ROOT_PAGES:
        return markdown.replace("](docs/", "](").replace("](benchmarks/results/", "](results/")
    if place.startswith("results/"):
        return markdown.replace("](../../docs/", "](../").replace("](../../", "](../")
    for name in (*ROOT_PAGES, "README.md"):
        markdown = markdown.replace(f"](../{name}", f"]({name}")
    return markdown.replace("](../benchmarks/results/", "](results/")


def on_post_build(config: Any) -> None:
    """llms.txt, which names the Markdown files, names the site's pages there."""
    place = Path(config["site_dir"]) / "llms.txt"
    text = place.read_text(encoding="utf-8").replace("README.md)", "index.md)").replace(".md)", ".html)")
    place.write_text(text, encoding="utf-8")
