"""Rerun's own window, where there is a display."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from flexviz.recording.web import HOST, rerun_program

QUIET = {"CI": "1"}  # with it set the viewer sends no statistics


def has_display() -> bool:
    """Whether a window can be opened here."""
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def show_in_window(recordings: Sequence[Path]) -> str:
    """Open the recordings in Rerun's window and wait until it is closed; why it failed, or ""."""
    command = [str(rerun_program()), *(str(file) for file in recordings), "--new", "--bind", HOST]
    viewer = subprocess.Popen(
        command, env=os.environ | QUIET, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    try:
        _, said = viewer.communicate()
    except BaseException:
        viewer.terminate()
        viewer.wait()
        raise
    if viewer.returncode == 0:
        return ""
    lines = [line for line in said.splitlines() if line.strip()]
    return lines[-1] if lines else f"it ended with code {viewer.returncode}"
