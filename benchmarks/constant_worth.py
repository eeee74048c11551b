"""Which sets are answered otherwise when a constant of the diagnosis is halved or doubled."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Sequence
from pathlib import Path

from benchmarks.running import say, write

FACTORS = (0.5, 2.0)
SCRIPT = Path(__file__).with_name("changed_constant.py")
Said = dict[str, dict[str, object]]  # set → what was said of it


def measure(python: Sequence[str], sets: Sequence[Path], work: Path, only: str = "") -> str:
    """Halve and double each constant in turn; what is kept in `work` is not computed again.

    Args:
        python: the interpreter that has the version to try.
        sets: measurement sets.
        work: folder of the results; of one version.
        only: text in the names of the constants.
    """
    folders = [str(folder.absolute()) for folder in sets]
    usual = _answers(python, work, "", 1.0, folders)
    lines, idle, places = [], [], [place for place in _places(python, work) if only in place]
    for count, place in enumerate(places, 1):
        told = []
        for factor in FACTORS:
            said = _answers(python, work, place, factor, folders)
            told += [f"× {factor:g} {line}" for line in differences(usual, said)]
        lines += [f"{place}: {line}" for line in told]
        idle += [] if told else [place]
        say(f"{count}/{len(places)} {place}: {len(told)} changes")
    lines.append(f"{len(idle)} of {len(places)} change no set: {', '.join(idle)}")
    return "\n".join(lines)


def differences(usual: Said, said: Said) -> list[str]:
    """Sets that are answered otherwise, in words."""
    return [f"{Path(one).name}: {words(usual[one], said[one])}" for one in usual if said[one] != usual[one]]


def words(usual: dict[str, object], said: dict[str, object]) -> str:
    """What changed: effects that came and went, and verdicts."""
    if "error" in said or "error" in usual:
        return str(said.get("error", "answered"))
    before, after = (
        set(effects) if isinstance(effects := one.get("effects"), list) else set() for one in (usual, said)
    )
    out = [f"+ {e}" for e in sorted(after - before)] + [f"− {e}" for e in sorted(before - after)]
    out += [f"{key} {usual[key]} → {said[key]}" for key in ("verdict", "last") if usual[key] != said[key]]
    return ", ".join(out)


def _answers(python: Sequence[str], work: Path, place: str, factor: float, folders: list[str]) -> Said:
    """What is said of each set; a process for those that are not kept."""
    file = work / "worth" / f"{place.replace(':', '.') or 'usual'} x {factor:g}.json"
    kept: Said = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    missing = [folder for folder in folders if folder not in kept]
    if missing:
        for line in _run(python, work, place, f"{factor:g}", *missing).splitlines():
            said = json.loads(line)
            kept[said.pop("set")] = said
        write(file, dict(kept))
    lost: dict[str, object] = {"error": "no answer"}
    return {folder: kept.get(folder, lost) for folder in folders}


def _places(python: Sequence[str], work: Path) -> list[str]:
    return [line.split(" ", 1)[0] for line in _run(python, work, "list").splitlines()]


def _run(python: Sequence[str], work: Path, *arguments: str) -> str:
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | {"OPENBLAS_NUM_THREADS": "1"}
    command = [*python, "-c", SCRIPT.read_text(encoding="utf-8"), *arguments]
    work.mkdir(parents=True, exist_ok=True)
    done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=work, check=False)
    if done.returncode and not done.stdout:
        raise RuntimeError(done.stderr.strip()[-400:])
    return done.stdout
