"""The wheel in empty environments, with the oldest and the newest versions of what it needs.

    python -m benchmarks.installing --work DIR [--python python3.12 …] [--extra core] [--versions highest]

In each, the README's Python runs, `flexviz identify demo` and `flexviz --help`; printed are the size of the
environment and some versions. Needs uv.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SHOWN = ("numpy", "scipy", "pin", "pydantic", "pyarrow", "typer")


def run(*command: str | Path, cwd: Path | None = None) -> str:
    """Standard output of a command; it ends the program with the command's last lines if it fails."""
    elsewhere = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=cwd, capture_output=True, text=True, env=elsewhere)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}:\n{done.stdout[-2000:]}{done.stderr[-3000:]}")
    return done.stdout


def readme_python() -> str:
    """The Python that the README shows."""
    return "\n".join(
        re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.S)
    )


def size(folder: Path) -> int:
    """Of all files in a folder [bytes]."""
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file() and not file.is_symlink())


def tried(wheel: Path, python: str, extra: str, versions: str, work: Path) -> str:
    """Install, run, and say what was installed; the environment is removed."""
    home, versions_file = work / "environment", work / "versions.txt"
    shutil.rmtree(home, ignore_errors=True)
    versions_file.unlink(missing_ok=True)  # uv would keep the versions in it
    run("uv", "venv", "--quiet", "--python", python, home)
    inside = ("--quiet", "--python", home / "bin" / "python")
    extras = ("--extra", extra) if extra != "core" else ()
    options = ("--resolution", versions, "--only-binary", ":all:", "--output-file", versions_file, *extras)
    run("uv", "pip", "compile", *inside, *options, ROOT / "pyproject.toml")
    run("uv", "pip", "install", *inside, "--requirements", versions_file)
    run("uv", "pip", "install", *inside, "--no-deps", wheel)
    listed = run("uv", "pip", "list", "--python", home / "bin" / "python")
    found = dict(line.split()[:2] for line in listed.splitlines() if len(line.split()) > 1)
    script = work / "readme.py"
    script.write_text(readme_python(), encoding="utf-8")
    assert "coulomb_friction" in run(home / "bin" / "python", script, cwd=work)
    assert "stiffness" in run(home / "bin" / "flexviz", "identify", "demo", cwd=work)
    run(home / "bin" / "flexviz", "--help", cwd=work)
    version, megabytes = run(home / "bin" / "python", "--version").strip(), size(home) / 1e6
    shutil.rmtree(home)
    packages = " ".join(f"{name} {found.get(name)}" for name in SHOWN)
    return f"{version}, {extra}, {versions}: {megabytes:.0f} MB, {len(found)} packages: {packages}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--python", nargs="+", default=["python3.11", "python3.12", "python3.13"])
    parser.add_argument("--extra", nargs="+", default=["core", "all"])
    parser.add_argument("--versions", nargs="+", default=["lowest-direct", "highest"])
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    run(
        sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", options.work, cwd=ROOT
    )
    (wheel,) = options.work.glob("flexviz-*.whl")
    for python in options.python:
        for extra in options.extra:
            for versions in options.versions:
                print(tried(wheel.resolve(), python, extra, versions, options.work.resolve()), flush=True)


if __name__ == "__main__":
    main()
