"""What a study does: its plan, its single runs as tasks, and what became of each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from flexviz.analysis.identification import FitSettings
from flexviz.base.errors import InputError, choose_from
from flexviz.base.files import sha256_of
from flexviz.data.measurements import overview
from flexviz.model.simulation import PRESETS
from flexviz.outlets.batch.tasks import BatchTask, Json, TaskResult

KINDS = ("monte-carlo", "bootstrap", "bandwidth", "detection")
ON_DATA = ("bootstrap", "bandwidth")  # the others simulate


@dataclass(frozen=True)
class StudyPlan:
    """What a study does.

    Attributes:
        kind: "monte-carlo" (noise seeds of a simulation), "bootstrap" (blocks of a set drawn with
            replacement), "bandwidth" (a set at several bandwidths) or "detection" (an effect of several
            sizes, simulated and looked for).
        source: a preset of `simulate`, a URDF, or the folder of a set.
        runs: seeds; of "detection" for each size.
        hidden: effects in the simulated robot; of "detection" one, whose size is varied.
        parameter: of that effect.
        settings: bandwidths [rad/s], or sizes; size 0 hides nothing and gives the false alarms.
        fit: how each run is identified; of "bandwidth" without refinement.
        diagnosed: also diagnose each run of "monte-carlo".
        start: how a simulated motion starts: "rest" or "moving".
        block: length of the blocks of "bootstrap" [s].
    """

    kind: str
    source: str
    runs: int = 100
    hidden: tuple[str, ...] = ()
    parameter: str = ""
    settings: tuple[float, ...] = ()
    fit: FitSettings = field(default_factory=FitSettings)
    diagnosed: bool = False
    start: str = "rest"
    block: float = 2.0

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f'study "{self.kind}" does not exist; {choose_from(self.kind, KINDS)}')
        if self.kind in ("bandwidth", "detection") and not self.settings:
            what = "bandwidths" if self.kind == "bandwidth" else "sizes"
            raise InputError(f"a study of kind {self.kind} needs {what}: --at W --at W …")
        if any(not math.isfinite(s) or s < 0 or (s == 0 and self.kind == "bandwidth") for s in self.settings):
            raise InputError("--at: expected positive numbers")
        if self.kind == "detection" and (
            len(self.hidden) != 1 or not self.parameter or "=" in self.hidden[0]
        ):
            message = "a study of kind detection needs one effect and the parameter that is varied"
            raise InputError(f"{message}: --hide coulomb_friction:joint2 --parameter coulomb")
        if self.runs < 1 or self.block <= 0:
            raise InputError("expected at least one run and a block of positive length")


@dataclass(frozen=True)
class StudyRun:
    """One run of a study; `result` is None if it failed or was not done."""

    number: int
    setting: float | None
    seed: int
    key: str
    error: str
    result: Json | None

    @property
    def parameters(self) -> dict[str, tuple[float, float | None, str, str]]:
        """ "stiffness:joint1" -> value, standard error, unit, grade."""
        return {name: tuple(entry) for name, entry in (self.result or {}).get("parameters", {}).items()}

    @property
    def truth(self) -> dict[str, float]:
        return (self.result or {}).get("truth", {})

    @property
    def found(self) -> tuple[str, ...]:
        return tuple((self.result or {}).get("found", ()))


def study_tasks(plan: StudyPlan) -> Iterator[BatchTask]:
    """The runs of a study."""
    common: Json = {"fit": asdict(plan.fit)}
    where: Json = {}
    if plan.kind in ON_DATA or plan.source not in PRESETS:
        source = Path(plan.source)
        if plan.kind not in ON_DATA and source.suffix == ".urdf":
            if not source.is_file():
                raise InputError("does not exist", file=source)
            common["preset"] = sha256_of(source)
        else:
            if plan.kind not in ON_DATA and not source.exists():
                valid = choose_from(plan.source, PRESETS)
                raise InputError(f'"{plan.source}" is neither a preset nor a measurement set; {valid}')
            common["sha256"] = overview(source).files.sha256
        where["path"] = str(source.resolve())
    else:
        common["preset"] = plan.source
    if plan.kind == "bandwidth":
        for setting in plan.settings:
            common["fit"] = asdict(replace(plan.fit, bandwidth=setting, refine=False))
            yield BatchTask(plan.kind, f"{setting:g} rad/s", common.copy(), where)
        return
    for setting in plan.settings if plan.kind == "detection" else (None,):
        for seed in range(plan.runs):
            what = {**common, "seed": seed}
            if plan.kind == "bootstrap":
                what["block"] = plan.block
            else:
                what |= {"hidden": list(_hidden(plan, setting)), "start": plan.start}
                what["diagnosed"] = plan.diagnosed or plan.kind == "detection"
            size = "" if setting is None else f"{plan.parameter} = {setting:g}, "
            yield BatchTask(plan.kind, f"{size}seed {seed}", what, where)


def _hidden(plan: StudyPlan, size: float | None) -> Sequence[str]:
    if plan.kind != "detection":
        return plan.hidden or ("none",)
    return [f"{plan.hidden[0]}:{plan.parameter}={size!r}"] if size else ["none"]


def run_of(number: int, task: BatchTask, result: TaskResult | None) -> StudyRun:
    setting = task.what["fit"]["bandwidth"] if task.kind == "bandwidth" else None
    if task.kind == "detection":
        text = task.what["hidden"][0]
        setting = float(text.partition("=")[2]) if "=" in text else 0.0
    error = "not done" if result is None else result.error
    content = None if result is None or result.error else result.result
    return StudyRun(number, setting, int(task.what.get("seed", 0)), task.key, error, content)


def is_right(plan: StudyPlan, run: StudyRun) -> bool | None:
    """Whether a diagnosis found exactly the hidden effects; None if there was none."""
    if run.result is None or "found" not in run.result:
        return None
    hidden = () if run.setting == 0 else plan.hidden
    named = {":".join(part for part in one.split(":") if "=" not in part) for one in hidden if one != "none"}
    return set(run.found) == named
