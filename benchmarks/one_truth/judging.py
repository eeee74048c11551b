"""What one set shows. Held-out errors are measured by one code, whatever command made the model."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cached_property
from pathlib import Path

import numpy as np

from benchmarks.diagnosis_study.judging import COMPLETE, Judgement, effect_text, judge
from benchmarks.diagnosis_study.oracle import final_model
from benchmarks.measuring_stick.sets import StickSet
from benchmarks.one_truth.answers import FOUND, GUESSES, SAME, added_effects, answer_file
from benchmarks.running import Json, read, write
from flexviz.analysis.diagnosis import prediction_errors
from flexviz.data.measurements import read_set

WORSE, LONGEST_CPU = 1.02, 60.0  # held-out error over that of the best guess; [s] of a recorded robot
ALIKE, SAME_VALUE = 0.02, 0.2  # two fits of one model: errors, and values in standard errors
LIMIT_ERROR, ROUNDED = 0.02, 0.01  # of a torque's limit; of printed errors
DELAY, FRICTION = "torque_delay", "coulomb_friction"
LIMIT = f"saturation named, limit within {100 * LIMIT_ERROR:g} %"
MANY = ("robotlike", "plain_guess")  # their sets hide many effects
PLACE = ("name", "joint", "group", "payload")  # of a parameter
Checks = dict[str, bool]


class Answers:
    """What one command said of one set, its hidden effects, and those of them that a study asks for."""

    def __init__(self, one: StickSet, results: Path) -> None:
        self.one, self.results = one, results
        self.truth: Json | None = read(one.truth) if one.truth else None
        self.hidden: list[Json] = (self.truth or {}).get("effects", [])
        self.wanted: list[str] = (self.truth or {}).get("wanted", [])

    def file(self, part: str) -> Path:
        """Where an answer is kept."""
        return answer_file(self.results, self.one.key, part)

    @cached_property
    def found(self) -> Json:
        """The document of the diagnosis; empty without one."""
        return read(self.file(FOUND)).get(FOUND, {})

    @cached_property
    def judged(self) -> Judgement:
        """The diagnosis against the truth."""
        return judge(self.truth, read(self.file(FOUND)), self.one.kind in MANY)

    @property
    def added(self) -> list[str]:
        """Names of the effects in the final model, without places."""
        return [a.effect for a in self.judged.additions]

    @property
    def named(self) -> bool:
        """Whether every effect that is asked for is in the final model."""
        return all(e.found for e in self.judged.hidden if e.effect in self.wanted)

    def error(self, part: str) -> float:
        """Held-out rms over the torque's spread, mean of the joints with a torque; kept with the answer."""
        result = read(self.file(part))
        if FOUND not in result:
            return float("nan")
        if "share" not in result:
            measurements = read_set(self.one.folder)
            model = final_model(result[FOUND], measurements.joints)
            rms = prediction_errors(measurements, model, [e.text for e in model.effects]).stated
            spread = measurements.torque_spread
            result["share"] = [r / s for r, s in zip(rms, spread, strict=True) if s > 0]
            write(self.file(part), result)
        return float(np.mean(result["share"]))


def figures(study: str, of: Answers) -> dict[str, float]:
    """Numbers of which the worst counts."""
    if study == "plain_guess":
        best = float(np.nanmin([of.error(part) for part in GUESSES]))
        return {"error over that of the best guess": of.error(FOUND) / best, "best guess [%]": 100 * best}
    if study != "same_model":
        return {}
    again = read(of.file(SAME)).get(FOUND, {"parameters": []})
    values = {tuple(p.get(k) for k in PLACE): p["value"] for p in again["parameters"]}
    differences = [float("nan")] if not values else [
        abs(p["value"] - values[place]) / p["std"]
        for p in of.found.get("model", {}).get("parameters", [])
        if (place := tuple(p.get(k) for k in PLACE)) in values and p["std"] and p["identifiable"] == "yes"
    ]  # fmt: skip
    ratio = of.error(SAME) / of.error(FOUND)
    return {"ratio of errors": ratio, "difference in standard errors": max(differences, default=0.0)}


def _plain_guess(of: Answers) -> Checks:
    ratio = next(iter(figures("plain_guess", of).values()))
    out = {f"no worse than {WORSE:g} × the best guess": ratio <= WORSE}
    if of.one.kind == "real":
        out[f"CPU ≤ {LONGEST_CPU:g} s on a recorded robot"] = of.judged.cpu <= LONGEST_CPU
    return out


def _same_model(of: Answers) -> Checks:
    ratio, difference = figures("same_model", of).values()
    return {
        f"errors within {100 * ALIKE:g} %": abs(ratio - 1.0) <= ALIKE,
        f"determined values within {SAME_VALUE:g} standard errors": difference <= SAME_VALUE,
    }


def _clean(of: Answers) -> Checks:
    if of.wanted:
        return {"hidden effect named first": of.judged.first_right}
    return {"clean: no effect but a delay": set(of.added) <= {DELAY}}


def _two_effects(of: Answers) -> Checks:
    return {"worn: both found" if "/worn-" in of.one.key else "both found": of.named}


def _torque_scale(of: Answers) -> Checks:
    if of.wanted == ["torque_gain"]:
        return {"gain named": of.named}
    if of.wanted == [DELAY]:
        late = {effect_text(e) for e in of.hidden}
        return {"late torque named": late <= {a.name for a in of.judged.additions}}
    (limit,) = of.hidden
    said = (
        *of.found["model"]["effects"],
        *of.found["candidates"],
    )  # a limit that the record shows is no effect
    found = [e["parameters"]["limit"]["value"] for e in said if effect_text(e) == effect_text(limit)]
    return {LIMIT: any(abs(x / limit["parameters"]["limit"] - 1.0) <= LIMIT_ERROR for x in found)}


def _small(of: Answers) -> Checks:
    accepted: set[str] = set()
    for move in of.found.get("trace", []):
        if move.get("accepted") and move.get("resolution") == "coarse":
            accepted = (accepted - set(move["removed"])) | set(move["added"])
    last = added_effects(of.one.folder, of.found.get("model", {}).get("effects", []))
    return {"named": of.named, "what the coarse stage accepted is kept": accepted <= set(last)}


def _filters(of: Answers) -> Checks:
    friction = any(e.found for e in of.judged.hidden if e.effect == FRICTION)
    complete = of.judged.last == COMPLETE and (FRICTION in of.wanted or set(of.added) <= {DELAY})
    if "bit-" in of.one.key:
        return {"encoders: right verdict": complete and friction == (FRICTION in of.wanted)}
    lag = {"lag of the torque named": DELAY in of.added} if DELAY in of.wanted else {}
    clean = {"clean: nothing is missing": complete}
    return lag | ({"Coulomb friction named": friction} if FRICTION in of.wanted else clean)


def _staircase(of: Answers) -> Checks:
    """No row whose printed error rises on a joint where the held-out error in Nm falls."""
    steps = [s["rms_validation"] or s["rms"] for s in of.found.get("steps", [])]
    rows = printed_errors(read(of.file(FOUND)).get("printed", ""), len(steps[0]) if steps else 0)
    ends = np.cumsum([added for added, _ in rows])
    if not rows or ends[-1] != len(steps) - 1:
        return {"a staircase is printed": False} if len(steps) > 1 else {}
    printed, errors = np.array([numbers for _, numbers in rows]), np.array(steps)[ends]
    rises, falls = printed[1:] > (1 + ROUNDED) * printed[:-1], errors[1:] < (1 - ROUNDED) * errors[:-1]
    return {"no printed error rises where that in Nm falls": not np.any(rises & falls)}


def printed_errors(text: str, joints: int) -> list[tuple[int, list[float]]]:
    """How many effects each row of the printed table of held-out errors adds, and its joints' numbers."""
    out: list[tuple[int, list[float]]] = []
    for line in text.partition("error of the held-out groups")[2].splitlines()[1:]:
        row = re.match(r"\s*(present model|[+−] .*?)\s{2,}(.*)", line)
        if row:
            numbers = re.findall(r"(?<!\S)[\d.]+(?:e[+-]?\d+)?(?!\S)", row[2])[:joints]
            together = re.split(", | and ", row[1].partition(" on joints ")[2])
            out.append((len(together) * (row[1] != "present model"), [float(x) for x in numbers]))
        elif out:
            break
    return [row for row in out if len(row[1]) == joints]


_ALL = _plain_guess, _same_model, _clean, _two_effects, _torque_scale, _small, _filters, _staircase
CHECKS: dict[str, Callable[[Answers], Checks]] = {one.__name__[1:]: one for one in _ALL}
"""Study → what it asks of a set, and whether that holds."""
