"""The page's scripts: clicks into plots and lists, zooms, names under the pointer, pictures of plots, layout.

viser reports none of them, so `page.js` and `layout.js` write them into controls; they come with an element
of the page. `terms.js` explains the terms in its texts.
"""

from __future__ import annotations

import base64
import json
from pathlib import Path

from flexviz.content.charts import TIME
from flexviz.content.view import BEFORE, RESIDUAL
from flexviz.content.wording import escape
from flexviz.outlets.app import layout
from flexviz.outlets.app.uploads import LARGEST_UPLOAD

TRANSPORT_LABEL, SCREEN_LABEL, PICTURE_LABEL = "Playback command", "Canvas", "Plot to save"  # hidden texts
POLE_LABEL = "Pole moved"
DROP_LABEL, COMING_LABEL = "Dropped files", "Files on the way"  # of the controls for files
NUMBER_LABEL, OPEN_LABEL = "Set no.", "Open set"  # of the list of a batch's sets
ROW_LABEL = "Row"  # of the table of one's own robot
PICTURE_SCALE = 3  # pixels of a PNG per pixel of its SVG
SAVE = """
const c = document.createElement('canvas'), x = c.getContext('2d');
c.width = SCALE * this.naturalWidth; c.height = SCALE * (this.naturalHeight + 24);
x.fillStyle = '#fff'; x.fillRect(0, 0, c.width, c.height); x.scale(SCALE, SCALE);
x.drawImage(this, 0, 24); x.fillStyle = '#222'; x.font = '14px sans-serif'; x.fillText(TITLE, 74, 18);
c.toBlob(b => {
  const a = document.createElement('a');
  a.href = window.URL.createObjectURL(b); a.download = NAME; a.click();
  setTimeout(() => window.URL.revokeObjectURL(a.href), 10000);
}, 'image/png');
"""


def page_script() -> str:
    """The scripts as an element (HTML)."""
    folder = Path(__file__).parent
    text = "".join(
        (folder / name).read_text(encoding="utf-8")
        for name in ("viser_private.js", "page.js", "layout.js", "fall.js", "terms.js")
    )
    for name in ("WITH_BAR", "LOW", "WITH_TABS", "ONE_COLUMN"):
        text = text.replace(f" {name}", f" {getattr(layout, name)}")
    for name, value in (
        ("TRANSPORT", TRANSPORT_LABEL),
        ("SCREEN", SCREEN_LABEL),
        ("AXIS", TIME.text),
        ("PICTURE", PICTURE_LABEL),
        ("POLE", POLE_LABEL),
        ("NUMBER", NUMBER_LABEL),
        ("OPEN", OPEN_LABEL),
        ("BEFORE", BEFORE),
        ("RESIDUAL", RESIDUAL),
        ("DROP", DROP_LABEL),
        ("COMING", COMING_LABEL),
        ("ROW", ROW_LABEL),
    ):
        text = text.replace(f"'{name}'", f"'{value}'")
    text = text.replace("LARGEST_UPLOAD", str(LARGEST_UPLOAD))
    return f'<img src="data:," alt="" style="display: none" onerror="{escape(text)}">'


def new_tab(address: str) -> str:
    """An element (HTML) that opens this address in a tab of its own."""
    text = f"window.open({json.dumps(address)}, '_blank', 'noopener')"
    return f'<img src="data:," alt="" style="display: none" onerror="{escape(text)}">'


def picture(svg: str, title: str, file: str) -> str:
    """An SVG as an element (HTML) that the browser draws under its title and saves as PNG `file`."""
    data = base64.b64encode(svg.encode()).decode()
    text = SAVE.replace("SCALE", str(PICTURE_SCALE)).replace("NAME", json.dumps(file))
    text = text.replace("TITLE", json.dumps(title))
    return (
        f'<img src="data:image/svg+xml;base64,{data}" alt="" style="display: none" onload="{escape(text)}">'
    )
