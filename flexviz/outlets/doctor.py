"""What an installation needs: Python, packages, memory, disk, a port and a browser with WebGL."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Literal
from urllib.parse import quote

from packaging.requirements import Requirement

from flexviz.base.files import temporary_folder

State = Literal["ok", "warning", "problem"]

OLDEST_PYTHON = (3, 11)
APP_PORT = 8080  # or the next free one
LEAST_MEMORY = 3e9  # bytes: a diagnosis of ten minutes of seven joints at 1 kHz
LEAST_DISK = 1e9  # bytes: sessions, recordings and uploads
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
BROWSER_SECONDS = 30.0
BINARIES = ("pinocchio", "pyarrow", "rerun", "viser")  # whose libraries may not fit the machine
WEBGL_PAGE = """<body><script>
const gl = document.createElement("canvas").getContext("webgl2");
const info = gl && gl.getExtension("WEBGL_debug_renderer_info");
document.body.textContent = "renderer=" + (gl ? gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER) : "none") + ";";
</script></body>"""  # noqa: E501


@dataclass(frozen=True)
class Check:
    """One line of the doctor's report.

    Attributes:
        subject: what was checked.
        state: "problem" keeps flexviz from working, "warning" keeps a part of it.
        text: what was found and, unless it is in order, what to do.
    """

    subject: str
    state: State
    text: str


def examine() -> Iterator[Check]:
    """Check everything."""
    yield check_python()
    yield from check_packages(metadata.requires("flexviz") or [])
    yield from map(check_binary, filter(importlib.util.find_spec, BINARIES))
    yield check_memory(available_memory(), os.cpu_count() or 1)
    yield check_disk(Path(tempfile.gettempdir()))
    yield check_port(APP_PORT)
    yield check_webgl(
        os.environ.get("FLEXVIZ_CHROMIUM") or next(filter(None, map(shutil.which, BROWSERS)), None)
    )


def check_python() -> Check:
    """The interpreter's version."""
    text = f"{sys.version.split()[0]} on {sys.platform}"
    if sys.version_info < OLDEST_PYTHON:
        return Check("Python", "problem", f"{text}; flexviz needs Python 3.11 or newer")
    return Check("Python", "ok", text)


def check_packages(wanted: list[str]) -> Iterator[Check]:
    """Packages that are missing or of another version than those that were tried, then how many fit."""
    fitting = count = 0
    for requirement in map(Requirement, wanted):
        extra = re.search(r"extra == .(\w+)", str(requirement.marker))
        optional = extra is not None
        if requirement.name == "flexviz":  # all extras
            continue
        if requirement.marker is not None and not optional and not requirement.marker.evaluate():
            continue
        count += not optional
        pinned = f"{requirement.name}{requirement.specifier}"
        try:
            version = metadata.version(requirement.name)
        except metadata.PackageNotFoundError:
            state: State = "warning" if optional else "problem"
            use = "is missing" if extra is None else f"is left out, with all of flexviz[{extra[1]}]"
            yield Check("package", state, f'{requirement.name} {use}: pip install "{pinned}"')
            continue
        if requirement.specifier.contains(version, prereleases=True):
            fitting += not optional
        else:
            text = f'{requirement.name} {version} was not tried: pip install "{pinned}"'
            yield Check("package", "warning", text)
    yield Check(
        "packages", "ok" if fitting == count else "warning", f"{fitting} of {count} as they were tried"
    )


def check_binary(name: str) -> Check:
    """Whether a package with compiled parts can be imported."""
    try:
        importlib.import_module(name)
    except Exception as error:
        return Check(name, "problem", f"cannot be imported ({error}): reinstall it")
    return Check(name, "ok", "imports")


def available_memory() -> float:
    """Memory that can be used [bytes]; infinite if the system does not say."""
    try:
        rows = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        free = next(1024.0 * float(row.split()[1]) for row in rows if row.startswith("MemAvailable"))
    except (OSError, StopIteration, ValueError, IndexError):
        return float("inf")
    for name in ("memory.max", "memory/memory.limit_in_bytes"):  # of a container
        try:
            free = min(free, float(Path("/sys/fs/cgroup", name).read_text(encoding="ascii")))
        except (OSError, ValueError):
            continue  # "max": without limit
    return free


def check_memory(free: float, cores: int) -> Check:
    """Whether memory [bytes] suffices for long recordings."""
    text = f"{free / 1e9:.1f} GB available, {cores} cores" if free < float("inf") else f"{cores} cores"
    if free < LEAST_MEMORY:
        return Check("memory", "warning", f"{text}; ten minutes of seven joints at 1 kHz take 3 GB")
    return Check("memory", "ok", text)


def check_disk(folder: Path) -> Check:
    """Whether temporary files can be written, and for how much there is room."""
    try:
        with tempfile.NamedTemporaryFile(dir=folder):
            free = shutil.disk_usage(folder).free
    except OSError as error:
        return Check(
            "disk", "problem", f"{folder} cannot be written ({error.strerror}): set TMPDIR to another folder"
        )
    text = f"{free / 1e9:.1f} GB free in {folder}"
    if free < LEAST_DISK:
        return Check("disk", "warning", f"{text}; recordings and uploads need about 1 GB: set TMPDIR")
    return Check("disk", "ok", text)


def check_port(port: int) -> Check:
    """Whether the app's usual port is free on this machine."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind(("127.0.0.1", port))
        except OSError:
            text = f"{port} is taken: flexviz serve uses the next free one, or give --port"
            return Check("port", "warning", text)
    return Check("port", "ok", f"127.0.0.1:{port} is free")


def check_webgl(browser: str | None) -> Check:
    """Whether a Chromium on this machine draws with WebGL, tried without a window."""
    if browser is None:
        return Check(
            "WebGL", "warning", "no Chromium or Chrome found to try; any browser with WebGL 2 shows the app"
        )
    with temporary_folder("doctor") as profile:
        flags = ["--headless", "--disable-background-networking", "--no-first-run"]
        flags.append(f"--user-data-dir={profile}")
        flags += ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
        page = f"data:text/html,{quote(WEBGL_PAGE)}"
        try:
            done = subprocess.run(
                [browser, *flags, "--dump-dom", page], capture_output=True, text=True, timeout=BROWSER_SECONDS
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            return Check("WebGL", "warning", f"{browser} did not answer ({type(error).__name__})")
    return judge_renderer(browser, done.stdout)


def judge_renderer(browser: str, page: str) -> Check:
    """What a page that names its WebGL renderer says."""
    _, found, rest = page.partition("renderer=")
    renderer = rest.partition(";")[0]
    if not found:
        return Check(
            "WebGL", "warning", f"{browser} showed nothing; open the app and see whether robots appear"
        )
    if renderer == "none":
        return Check(
            "WebGL", "problem", f"{browser} has no WebGL 2: turn hardware acceleration on in its settings"
        )
    if any(name in renderer.lower() for name in ("swiftshader", "llvmpipe", "software")):
        return Check("WebGL", "warning", f"{renderer} without a graphics card: the app runs, but slowly")
    return Check("WebGL", "ok", renderer)
