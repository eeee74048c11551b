"""`flexviz doctor`: whether this machine has what flexviz needs."""

from __future__ import annotations

from flexviz.outlets.terminal import terminal


def doctor() -> int:
    """Check Python, packages, memory, disk, the app's port and WebGL; exit code 1 if something is missing."""
    from flexviz import __version__
    from flexviz.content.blocks import Paragraph, table
    from flexviz.outlets.doctor import examine

    marks = {"ok": "✓", "warning": "!", "problem": "✗"}
    checks = list(examine())
    rows = [[marks[check.state], check.subject, check.text] for check in checks]
    problems = sum(check.state == "problem" for check in checks)
    said = f"{problems} problems" if problems else "flexviz can run here"
    found = table(("", "checked", "found"), rows, fold=(2,))
    terminal.show_blocks([Paragraph(f"flexviz {__version__}"), found, Paragraph(said)])
    return 1 if problems else 0
