"""The documentation as a small static site: `make docs`, or `python docs/build_site.py [OUT]`.

Every Markdown page of the project becomes one HTML page; nothing is fetched, when it is built or when it is
read. The build fails where a link leads nowhere: to a file, a page or a heading that does not exist.
"""

from __future__ import annotations

import html
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path, PurePosixPath

from markdown_it import MarkdownIt
from markdown_it.token import Token
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import get_lexer_by_name
from pygments.util import ClassNotFound

ROOT = Path(__file__).resolve().parent.parent
CONTENTS = "docs/README.md"  # its list is the side bar
PAGES = ("*.md", "docs/*.md", "docs/effects/*.md", "sessions/*.md")
STYLE_FILE = "flexviz-docs.css"
OUTSIDE = re.compile(r"^[a-z][a-z0-9+.-]*:", re.IGNORECASE)
LIGHT, DARK = HtmlFormatter(style="default"), HtmlFormatter(style="github-dark")
STYLE = """
:root { --ink: #1c2733; --dim: #5d6b78; --paper: #fff; --side: #f4f6f8; --line: #d8dee4; --link: #0072b2;
  color-scheme: light dark; }
@media (prefers-color-scheme: dark) { :root { --ink: #dfe6ec; --dim: #93a1ad; --paper: #14181d;
  --side: #1b2127; --line: #313a43; --link: #56b4e9; } }
* { box-sizing: border-box; }
body { margin: 0; display: flex; color: var(--ink); background: var(--paper);
  font: 16px/1.55 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; }
nav { flex: 0 0 17rem; padding: 1.5rem 1rem; background: var(--side); border-right: 1px solid var(--line);
  height: 100vh; position: sticky; top: 0; overflow-y: auto; font-size: 0.9rem; }
nav b { display: block; margin: 1rem 0 0.2rem; color: var(--dim); font-weight: 600; }
nav a { display: block; padding: 0.15rem 0; text-decoration: none; }
nav a[aria-current] { font-weight: 700; color: var(--ink); }
main { flex: 1 1 auto; min-width: 0; max-width: 54rem; padding: 1.5rem 2.5rem 4rem; }
a { color: var(--link); }
h1, h2, h3 { line-height: 1.25; margin: 2em 0 0.6em; } h1 { margin-top: 0; }
pre { padding: 0.8rem 1rem; overflow-x: auto; background: var(--side); border: 1px solid var(--line);
  border-radius: 4px; font-size: 0.85rem; line-height: 1.45; }
code { font-family: ui-monospace, "DejaVu Sans Mono", monospace; font-size: 0.88em; }
:not(pre) > code { background: var(--side); padding: 0.1em 0.3em; border-radius: 3px; }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-size: 0.9rem; }
th, td { border: 1px solid var(--line); padding: 0.3rem 0.6rem; text-align: left; vertical-align: top; }
img { max-width: 100%; height: auto; }
@media (max-width: 60rem) { body { display: block; } nav { height: auto; position: static; }
  main { padding: 1rem; } }
@media print { nav { display: none; } main { max-width: none; } }
"""


class Refused(Exception):
    """Why there is no site: one line a link that leads nowhere."""


@dataclass
class Page:
    """One Markdown file.

    Attributes
    ----------
    source: its path in the project, "docs/app.md".
    title: its first heading.
    tokens: it, parsed.
    headings: the anchors of its headings.
    """

    source: str
    title: str
    tokens: list[Token]
    headings: set[str] = field(default_factory=set)

    @property
    def target(self) -> str:
        """Its path in the site: the project's README is the start, a folder's README its index."""
        path = PurePosixPath(self.source)
        parts = path.parts[1:] if path.parts[0] == "docs" else path.parts
        if self.source == CONTENTS:
            return "contents.html"
        name = "index" if path.stem == "README" else path.stem
        return str(PurePosixPath(*parts[:-1], f"{name}.html"))


def markdown() -> MarkdownIt:
    """The dialect: CommonMark with tables; code is coloured."""
    return MarkdownIt("commonmark", {"highlight": coloured}).enable("table")


def coloured(code: str, language: str, attributes: str) -> str:
    """Code as HTML; markdown-it escapes it where this returns nothing."""
    try:
        lexer = get_lexer_by_name(language)
    except ClassNotFound:
        return ""
    return highlight(code, lexer, HtmlFormatter(nowrap=True))


def slug(text: str, taken: set[str]) -> str:
    """A heading's anchor, as code hosts make it."""
    plain = re.sub(r"[^\w\- ]", "", text.strip().lower()).replace(" ", "-")
    anchor, count = plain, 0
    while anchor in taken:
        count += 1
        anchor = f"{plain}-{count}"
    return anchor


def read_pages(root: Path) -> dict[str, Page]:
    """Source path -> page, of all pages of the project."""
    parser = markdown()
    pages: dict[str, Page] = {}
    for file in sorted(file for pattern in PAGES for file in root.glob(pattern)):
        tokens = parser.parse(file.read_text(encoding="utf-8"))
        page = Page(str(file.relative_to(root).as_posix()), file.stem, tokens)
        for opening, inline in pairwise(tokens):
            if opening.type == "heading_open":
                words = "".join(t.content for t in inline.children or [] if t.type in ("text", "code_inline"))
                if not page.headings:
                    page.title = words
                anchor = slug(words, page.headings)
                page.headings.add(anchor)
                opening.attrSet("id", anchor)
        pages[page.source] = page
    return pages


def links(page: Page) -> Iterator[tuple[Token, str, int]]:
    """Every link and picture of a page: its token, which attribute holds the address, the line."""
    for token in page.tokens:
        line = token.map[0] + 1 if token.map else 0
        for child in token.children or []:
            if child.type in ("link_open", "image"):
                yield child, "href" if child.type == "link_open" else "src", line


def resolve(pages: dict[str, Page], root: Path) -> dict[str, Path]:
    """Point every link into the site; returns what has to be copied: path in the site -> file.

    Raises
    ------
    Refused: all links that lead nowhere, with file and line.
    """
    copies: dict[str, Path] = {}
    broken: list[str] = []
    for page in pages.values():
        for token, name, line in links(page):
            address = str(token.attrGet(name) or "")
            if OUTSIDE.match(address):
                continue
            path, _, anchor = address.partition("#")
            wanted = page.source
            if path:
                file = (root / page.source).parent / path
                try:
                    wanted = file.resolve().relative_to(root.resolve()).as_posix()
                except ValueError:
                    wanted = ""
            other = pages.get(wanted)
            if other is None and (not wanted or not (root / wanted).is_file()):
                broken.append(f"{page.source}:{line}: {address} leads nowhere")
                continue
            if anchor and (other is None or anchor not in other.headings):
                broken.append(f"{page.source}:{line}: {address}: there is no such heading")
                continue
            if other is not None:
                target = other.target
            else:
                target = wanted.removeprefix("docs/")
                copies[target] = root / wanted
            token.attrSet(name, _from(page.target, target) + (f"#{anchor}" if anchor else ""))
    if broken:
        raise Refused("\n".join(broken))
    return copies


def _from(page: str, target: str) -> str:
    """The address of `target` as seen from `page`, both paths in the site."""
    return "../" * (len(PurePosixPath(page).parts) - 1) + target


def side_bar(pages: dict[str, Page], page: Page) -> str:
    """The contents' list: sections and pages, the present one marked."""
    out = [f'<a href="{_from(page.target, "index.html")}">flexviz</a>']
    by_target = {_from(pages[CONTENTS].target, other.target): other for other in pages.values()}
    for token in pages[CONTENTS].tokens:
        children = token.children or []
        hrefs = [(i, str(t.attrGet("href"))) for i, t in enumerate(children) if t.type == "link_open"]
        if token.type == "inline" and not hrefs and token.level == 1 and token.content != "Documentation":
            out.append(f"<b>{html.escape(token.content)}</b>")
        for place, href in hrefs:
            other = by_target.get(href)
            if other is not None:
                here = ' aria-current="page"' if other is page else ""
                words = html.escape(children[place + 1].content)
                out.append(f'<a href="{_from(page.target, other.target)}"{here}>{words}</a>')
    return "\n".join(out)


def render(pages: dict[str, Page], page: Page) -> str:
    """One page of the site."""
    parser = markdown()
    body = parser.renderer.render(page.tokens, parser.options, {})
    body = body.replace("<table>", '<div class="wide"><table>').replace("</table>", "</table></div>")
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(page.title)} · flexviz</title>\n"
        f'<link rel="stylesheet" href="{_from(page.target, STYLE_FILE)}"></head>\n'
        f"<body><nav>{side_bar(pages, page)}</nav>\n<main>{body}</main></body></html>\n"
    )


def build(root: Path, out: Path) -> int:
    """Build the site in the folder `out`, which is replaced when all is well; the number of pages."""
    if out.exists() and any(out.iterdir()) and not (out / STYLE_FILE).is_file():
        raise Refused(f"{out}: is a folder with something else in it; a new or empty one would be right")
    pages = read_pages(root)
    copies = resolve(pages, root)
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".docs-", dir=out.parent) as temporary:
        site = Path(temporary) / "site"
        site.mkdir()
        dark = f"@media (prefers-color-scheme: dark) {{ {DARK.get_style_defs('pre')} }}"
        (site / STYLE_FILE).write_text(f"{LIGHT.get_style_defs('pre')}\n{dark}\n{STYLE}", encoding="utf-8")
        for page in pages.values():
            file = site / page.target
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(render(pages, page), encoding="utf-8")
        for target, source in copies.items():
            (site / target).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, site / target)
        if out.exists():
            shutil.rmtree(out)
        site.rename(out)
    return len(pages)


def main(arguments: list[str]) -> int:
    out = Path(arguments[0]) if arguments else ROOT / "build" / "docs"
    try:
        count = build(ROOT, out)
    except Refused as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{count} pages in {out}; start: {out / 'index.html'}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
