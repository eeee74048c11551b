"""Whether every command gives one model: `python -m benchmarks.one_truth COMMAND STUDY --work DIR`.

    make     simulate the sets of the study that are not in DIR yet
    run      ask each --command NAME=CMD what has no answer yet: DIR/results/NAME
    report   print a line for each set, and what the study was made for as a figure; 1 if one is not reached

    plain_guess    the diagnosis against what a user would try first
    same_model     identify with the effects of the diagnosis
    clean          odd rates, nothing stated: nothing hidden, and play or dry friction
    two_effects    two effects on one joint
    torque_scale   gain, lag and saturation of single torques
    small          what is left is small, but more than noise
    filters        low-passed logs and coarse encoders
    staircase      over all answers in DIR: printed errors against those in Nm
    confidence     over all answers in DIR: how often what is stated with 90 % is right
    all            every one of them

CMD is the command `flexviz` of one version, as in `--command base=/there/.venv/bin/flexviz`; by default that
of this Python. It is told only the set's folder. What was interrupted goes on where it was.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from typer import BadParameter

from benchmarks.command import command
from benchmarks.measuring_stick.__main__ import NONE, named_command
from benchmarks.one_truth.answers import STUDIES, run_all, sets_of
from benchmarks.running import COMMAND, LONGEST, DiagnoseCommand


@command
def main(
    what: Literal["make", "run", "report"],
    study: Annotated[str, "one of those above"],
    *,
    work: Annotated[Path, "folder of simulated sets and results"],
    seed: Annotated[int, "of the sets to make"] = 1,
    command: Annotated[list[str], "NAME=CMD"] = NONE,
    jobs: int = 1,
    only: Annotated[str, "sets with this text in their keys"] = "",
    given: Annotated[Path | None, "folder that has practice, robotlike and real"] = None,
    timeout: Annotated[float, "of one answer [s]"] = LONGEST,
) -> int:
    if study not in (*STUDIES, "all"):
        raise BadParameter(f'there is no study "{study}", only {", ".join(STUDIES)} and all')
    studies, results = STUDIES if study == "all" else (study,), work / "results"
    # `run` imports little: its children's memory starts at its own
    if what == "make":
        from benchmarks.one_truth.plans import make_study

        return max([make_study(one, work, seed, jobs, only) for one in studies])
    named = {name: DiagnoseCommand(words, timeout, True) for name, words in map(named_command, command)}
    sets = {one: sets_of(one, work, given, only) for one in studies}
    if what == "run":
        for one in studies:
            run_all(sets[one], one, named or {"flexviz": DiagnoseCommand(COMMAND, timeout)}, results, jobs)
        return 0
    from benchmarks.one_truth.report import report

    names = list(named) or sorted(path.name for path in results.glob("*"))
    return int(not all([report(one, sets[one], results / name) for one in studies for name in names]))


if __name__ == "__main__":
    sys.exit(main())
