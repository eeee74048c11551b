"""One renderer per medium: terminal, HTML page, panel of the app, Markdown (also Rerun's texts)."""

from flexviz.content.rendering.html import html, html_fragment
from flexviz.content.rendering.markdown import markdown, markdown_fragment
from flexviz.content.rendering.panel import panel
from flexviz.content.rendering.terminal import WIDE, in_ascii, show, text
