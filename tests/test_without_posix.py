"""On a system without POSIX's calls everything can be imported, files are locked, and one core works."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import flexviz

# asyncio and psutil choose their parts by the name of the system, which stays that of this one
WITHOUT = """
import asyncio, os, psutil, signal, sys
sys.modules.update(dict.fromkeys(["fcntl", "resource", "pwd", "grp", "termios", "tty", "pty"]))
for name in ("fork", "forkpty", "sched_getaffinity", "geteuid", "getuid", "nice", "O_NOFOLLOW", "O_CLOEXEC",
             "O_NONBLOCK", "O_DIRECTORY", "getpgid", "killpg", "setsid", "wait4", "mkfifo", "statvfs"):
    delattr(os, name)
for name in ("SIGHUP", "SIGKILL", "SIGUSR1", "SIGUSR2", "SIGCHLD", "SIGALRM", "SIGQUIT", "SIGPIPE", "alarm"):
    delattr(signal, name)
"""
IMPORT_ALL = """
import importlib, pkgutil, flexviz
for found in pkgutil.walk_packages(flexviz.__path__, "flexviz."):
    if found.name != "flexviz.__main__":
        importlib.import_module(found.name)
"""
WORK = """
import flexviz
from pathlib import Path
from flexviz.base.jobs import LoadModules, Worker
from queue import SimpleQueue
flexviz.export  # what is loaded when it is first used
measurements = flexviz.read_set("demo")
with flexviz.on_cores(4):
    found = flexviz.diagnose(measurements, should_stop=lambda: True)
result = flexviz.identify(measurements)
folder = Path(sys.argv[1])
session = flexviz.Session.open("demo")
session.save(folder / "session")
session.save(folder / "session")  # locked while it is renewed
told, worker = SimpleQueue(), Worker()
worker.submit(LoadModules(("flexviz.robot.urdf_checks",)), told.put)
print(told.get(timeout=60).kind, result.converged, found.stopped)
worker.close()
"""


def run(program: str, *arguments: str | Path) -> str:
    command = [sys.executable, "-W", "ignore", "-c", WITHOUT + program, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_every_module_can_be_imported() -> None:
    run(IMPORT_ALL)


def test_sets_are_identified_and_sessions_saved(tmp_path: Path) -> None:
    assert run(WORK, tmp_path) == "done True True\n"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["session"]
    assert flexviz.Session.open(tmp_path / "session").folder == tmp_path / "session"


@pytest.mark.parametrize("name", ["fcntl", "resource", "pwd", "termios"])
def test_no_module_names_a_posix_library(name: str) -> None:
    for file in Path(flexviz.__file__).parent.rglob("*.py"):
        assert f"import {name}\n" not in file.read_text(encoding="utf-8"), file
