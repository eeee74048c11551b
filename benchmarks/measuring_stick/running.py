"""Every set is diagnosed by each command, one after the other: both meet the machine in the same state."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from benchmarks.diagnose_command import DiagnoseCommand, Json
from benchmarks.kept_results import say, write
from benchmarks.measuring_stick.sets import StickSet

LONGEST = 1800.0  # [s] after that a diagnosis is stopped


def result_file(work: Path, name: str, key: str) -> Path:
    """What the command of that name said of a set."""
    return work / "results" / name / f"{key}.json"


def command_names(work: Path) -> list[str]:
    """Commands with results."""
    return sorted(path.name for path in (work / "results").glob("*") if path.is_dir())


def read_result(work: Path, name: str, key: str) -> Json | None:
    """A kept result, if there is one."""
    path = result_file(work, name, key)
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None


def run(
    work: Path,
    sets: Sequence[StickSet],
    commands: Mapping[str, tuple[str, ...]],
    jobs: int,
    timeout: float,
    retry: bool = False,
) -> None:
    """Diagnose what has no result yet; with each set, another command begins.

    Args:
        work: folder of the results.
        commands: name → words before `diagnose`.
        jobs: sets at a time.
        timeout: [s] of one diagnosis.
        retry: also those that gave no answer.
    """
    made = {name: DiagnoseCommand(words, timeout, apart=True) for name, words in commands.items()}
    waiting = [
        (one, missing)
        for k, one in enumerate(sets)
        if (missing := [name for name in _turned(list(made), k) if not _done(work, name, one.key, retry)])
    ]

    def each(one: StickSet, missing: list[str]) -> str:
        return "; ".join(f"{name} {_kept(work, name, one, made[name])}" for name in missing)

    with ThreadPoolExecutor(jobs) as pool:
        try:
            futures = {pool.submit(each, *given): given[0].key for given in waiting}
            for count, future in enumerate(as_completed(futures), 1):
                say(f"{count}/{len(waiting)} {futures[future]}: {future.result()}")
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for command in made.values():
                command.stop()
            raise


def _turned(names: list[str], k: int) -> list[str]:
    return names[k % len(names) :] + names[: k % len(names)]


def _done(work: Path, name: str, key: str, retry: bool) -> bool:
    result = read_result(work, name, key)
    return result is not None and not (retry and "error" in result)


def _kept(work: Path, name: str, one: StickSet, command: DiagnoseCommand) -> str:
    """Diagnose, keep the result, and what it says in a line."""
    result = command.answer(one.folder)
    write(result_file(work, name, one.key), {"set": one.key} | result)
    cost = f"{result['cpu']:.1f} s CPU, {result['peak_mb']:.0f} MB"
    if "error" in result:
        return f"{result['error'].splitlines()[-1]}, {cost}"
    got = result["diagnosis"]
    return f"{got['verdict']}, {len(got['model']['effects'])} effects, {cost}"
