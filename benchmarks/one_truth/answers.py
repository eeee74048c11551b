"""Which sets a study has, and what commands say of them: DIR/results/NAME/SET/PART.json, for all studies."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from benchmarks import running
from benchmarks.measuring_stick.sets import StickSet, find_sets
from benchmarks.running import DiagnoseCommand, Json, as_done

FOUND, SAME = "diagnosis", "same"
GUESSES = {
    "a": ["coulomb_friction"],
    "b": ["coulomb_friction", "torque_offset"],
    "c": ["coulomb_friction", "torque_offset", "load_dependent_friction"],
}
"""What a user would try first, on all joints."""
MADE = ("plain_guess", "clean", "two_effects", "torque_scale", "small", "filters")
STUDIES = (*MADE, "same_model", "staircase", "confidence")
GIVEN = {"plain_guess": ("real", "robotlike"), "same_model": ("practice", "robotlike", "real")}
PARTS = {"plain_guess": (FOUND, *GUESSES), "same_model": (FOUND, SAME), "staircase": (), "confidence": ()}
"""What a study asks of each set; the diagnosis, if it is not here."""


def sets_of(study: str, work: Path, given: Path | None, only: str = "") -> list[StickSet]:
    """The sets of a study that are there; of a study that asks nothing itself, every set."""
    asks = bool(PARTS.get(study, (FOUND,)))
    classes = GIVEN.get(study, ()) if asks else GIVEN["same_model"]
    out = find_sets(work, given, None, classes) if classes and given else []
    for one in (study, *(("plain_guess",) if study == "same_model" else ())) if asks else MADE:
        for name in running.made_cases(work / one):
            folder, truth = running.case_folder(work / one, name), running.truth_file(work / one, name)
            out.append(StickSet(f"{one}/{name}", one, folder, truth))
    return [one for one in out if only in one.key]


def answer_file(results: Path, key: str, part: str) -> Path:
    """What was said of a set."""
    return running.result_file(results, f"{key}/{part}")


def added_effects(case: Path, effects: Sequence[str | Json]) -> list[str]:
    """Effects that the set's own model has not, as `--effect` takes them."""
    text = (case / "measurements.toml").read_text(encoding="utf-8")
    own, out = tomllib.loads(text).get("model", {}).get("effects", []), []
    for e in ({"effect": one} if isinstance(one, str) else one for one in effects):
        place, group = e.get("joint") or e.get("payload"), e.get("group")
        if e["effect"] not in own:
            out.append(e["effect"] + (f":{place}" if place else "") + (f"@{group}" if group else ""))
    return out


def _ask(command: DiagnoseCommand, one: StickSet, part: str, results: Path) -> Json:
    if part == FOUND:
        return command.answer(one.folder)
    effects: Sequence[str | Json] = GUESSES.get(part, ())
    if part == SAME:
        found = running.read(answer_file(results, one.key, FOUND))
        if FOUND not in found:
            return found
        effects = found[FOUND]["model"]["effects"]
    options = [word for effect in added_effects(one.folder, effects) for word in ("--effect", effect)]
    return command.ask(one.folder, FOUND, "identify", *options)


def run_all(
    sets: Sequence[StickSet], study: str, commands: Mapping[str, DiagnoseCommand], results: Path, jobs: int
) -> None:
    """Ask each command what it has not been asked yet."""
    asked = {
        (name, one.key, part): answer_file(results / name, one.key, part)
        for one in sets
        for name in commands
        for part in PARTS.get(study, (FOUND,))
    }
    missing = {where: file for where, file in asked.items() if not file.is_file()}

    def ask(one: StickSet) -> str:
        said = []
        for (name, key, part), file in missing.items():
            if key == one.key:
                result = _ask(commands[name], one, part, results / name)
                running.write(file, {"case": key} | result)
                said.append(f"{name} {part} {result['cpu']:.1f} s CPU{', no answer' * ('error' in result)}")
        return "; ".join(said)

    waiting = {one.key: (one,) for one in sets if any(key == one.key for _, key, _ in missing)}
    try:
        for _ in as_done(ThreadPoolExecutor(jobs), ask, waiting):
            pass
    except BaseException:
        for command in commands.values():
            command.stop()
        raise
