"""benchmarks/results/diagnosis-study.md: fixed text and the tables that the command writes into it."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.diagnosis_study import tables
from benchmarks.diagnosis_study.report import calibration_rows, value_rows
from benchmarks.diagnosis_study.tables import Outcome
from benchmarks.tables import Table, markdown, plain

PAGE = Path(__file__).resolve().parents[1] / "results" / "diagnosis-study.md"
HEAD, TAIL = "<!-- begin table -->", "<!-- end table -->"

FRAME = f"""\
# What the diagnosis finds, and what not

`python -m benchmarks.diagnosis_study all --work DIR --write` simulates robots with something hidden in
them, diagnoses every one, and writes everything below. It can be interrupted and resumes where it stopped;
`make`, `run` and `table` do one part each, `--only TEXT` takes the cases with TEXT in their names, `--seed`
draws others. The truth lies in a folder of its own that the diagnosis does not read.

## The cases

A planar arm with two joints, a Panda, a UR5, from the project's simulator: random bodies, stiffness, motor
inertia and friction; a CAD model whose masses, centres of mass and inertias are up to 35 % wrong, stiffness
and motor inertia known within 45 %; one quarter of the planar arms move in an inclined plane. Each set has
two or three groups to fit, with a motion and a payload of their own, and a held-out one that combines
them differently; 10 or 12 s at 1 kHz. Noise 1 is 2e-5 rad and 2 mNm for the planar arm, 1e-5 rad and
10 mNm for the others; half of it and three times as much as well.

- *single*: one effect of the library, on a random joint; its size is log-uniform from about the detection
  limit to large.
- *limit*: the same with sizes from 0.4 to 3 times the detection limit.
- *pair*: two effects, on the same joint or on two.
- *clean*: nothing hidden; half of the models have effects that the set's model knows of.
- *unknown*: a law that is not in the library (`benchmarks/diagnosis_study/laws.py`).

A finding is right when it names a hidden effect on its joint or payload, or its twin (motor and link
Coulomb friction, delay and joint damping, offset and tilt) where that is reported as tied. Something is
*named* when the verdict is "missing". A case is *decidable* when a fit that knows the truth, with the same
estimator and started from the truth, gains at least 300 in χ² over the best base model, for two effects
over the best model with one of them; for laws that are not in the library, over the base model's fit of the
same set simulated without that law. For a joint below its noise, the noise is used.

{HEAD}
{TAIL}
"""


def parts(outcomes: Sequence[Outcome]) -> list[str | Table]:
    """The tables with their titles and words; a title begins with "#"."""
    seeds = ", ".join(sorted({str(o.truth["seed"]) for o in outcomes}))
    additions = [o.said.additions for o in outcomes]
    named = [o for o in outcomes if o.of(("single", "limit")) and o.decidable and o.said.first_right]
    values = [value for o in named for value in o.said.values if "." in value.name]
    motor_side = [value for o in outcomes for value in o.said.values if "." not in value.name]
    return [
        f"## What was to be shown: {len(outcomes)} cases, seed {seeds}",
        tables.figures(outcomes)[0],
        "## By robot and kind",
        "Shares are those of the decidable cases; of all, for clean ones.",
        tables.by_kind(outcomes),
        "One effect, by what the fit gains that is given it:",
        tables.by_gain(outcomes),
        "## True effect and first named",
        "One effect hidden, decidable cases. Rows: what is hidden; columns: what is named first. "
        "✗: on a wrong joint or payload.",
        tables.confusion(outcomes),
        "## Not in the library",
        tables.extra_laws(outcomes),
        "## Smallest size found",
        "The smallest size from which on nine in ten are named right, decidable or not, among the number "
        "of cases in brackets; then the same relative to the joint's rms torque, or to a natural size (what "
        "`flexviz simulate --effect` hides without being told a size). Last: the relative size at which the "
        "fit that is given the effect would gain 300.",
        "### 2-DOF",
        tables.sizes(outcomes, tables.PLANAR),
        "### Panda and UR5",
        tables.sizes(outcomes, tables.ARMS),
        "## Errors of the parameters",
        "Of the effects that were named right, relative to the truth, in the final model. A phase and a "
        "rest angle are not counted, the sign of an amplitude neither.",
        value_rows(values, [value for o in named for value in o.best]),
        "Stiffness and motor inertia, of all sets in which nothing is missing in the end. Light wrists say "
        "little of their stiffness.",
        value_rows(motor_side),
        "## The fit that is given the effects",
        "χ² a sample of its worst joint, in the fit groups; 1 is the measurement noise.",
        tables.knowing(outcomes),
        "## Confidence",
        "Findings of all cases, decidable or not, by the confidence that was stated with them; where members "
        "of a family tie, of the family. The first named:",
        calibration_rows(a for each in additions for a in each[:1]),
        "Later ones:",
        calibration_rows(a for each in additions for a in each[1:]),
        "## Every case that should be right and is not",
        tables.wrong(outcomes),
    ]


def text(pieces: Sequence[str | Table], drawn: Callable[[Table], str] = plain) -> str:
    """The tables for the screen, or as `drawn` makes them."""
    blocks = [drawn(p) if isinstance(p, list) else p if p.startswith("#") else _wrapped(p) for p in pieces]
    return "\n\n".join(blocks)


def write(pieces: Sequence[str | Table], page: Path = PAGE) -> None:
    """Renew the part between the markers; what is said of several seeds before them stays."""
    body = text(pieces, markdown)
    filled = f"{HEAD}\n\n{body}\n\n{TAIL}" if body else f"{HEAD}\n{TAIL}"
    old = page.read_text(encoding="utf-8") if page.is_file() else FRAME
    before, after = old.partition(HEAD)[0], old.partition(TAIL)[2]
    page.write_text(f"{before}{filled}{after}", encoding="utf-8")


def _wrapped(words: str) -> str:
    return textwrap.fill(words, 110, break_on_hyphens=False)
