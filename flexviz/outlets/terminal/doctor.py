"""`flexviz doctor`: whether this machine has what flexviz needs."""

from __future__ import annotations

from flexviz.outlets.terminal import terminal


def doctor() -> int:
    """Check Python, packages, memory, disk, the app's port and WebGL; exit code 1 if something is missing."""
    from flexviz import __version__
    from flexviz.content.results import plain_table
    from flexviz.outlets.doctor import examine

    marks = {"ok": "✓", "warning": "!", "problem": "✗"}
    table = plain_table("", "checked", end=("found",))
    checks = list(examine())
    for check in checks:
        table.add_row(marks[check.state], check.subject, check.text)
    console = terminal.results()
    console.print(f"flexviz {__version__}")
    console.print(table)
    problems = sum(check.state == "problem" for check in checks)
    console.print(f"{problems} problems" if problems else "flexviz can run here")
    return 1 if problems else 0
