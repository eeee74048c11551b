"""benchmarks/results/paper.md: a frame of fixed text with two parts that the commands renew."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

from benchmarks.paper_study import tables
from benchmarks.paper_study.findings import Results, findings
from benchmarks.paper_study.methods import SETTLED, SMALL
from benchmarks.paper_study.seeds import Statistics
from benchmarks.tables import markdown

PAGE = Path(__file__).resolve().parents[1] / "results" / "paper.md"
START_TEXT = {"rest": "from rest", "moving": "started moving"}
PARTS = ("table", "seeds")
Checked = Sequence[tuple[str, bool]]

FRAME = """\
# The paper's simulation, repeated: all tables

[The page](../../docs/paper.md) says what they mean.

Groups A–F are the paper's trajectory-payload groups as we read them: A {T1P1, T2P2}, B {T1P1, T2P2, T3P3}, C
{T1P1, T2P1, T3P3}, D {T1P1, T2P1, T3P1}, E {T1P2, T2P2, T3P2}, F {T1P1}. The paper's true values are lost;
ours lie near its start values. 10 s each, controller and record at 0.25 ms, equation every 25 ms or finer,
noise 2e-5 rad and 2e-3 Nm in the record. "From rest" the reference's velocity jumps when the motion starts
and the arm rings; "started moving" it does not. One more run with another pair of trajectory and payload is
held out. Stiffness and motor inertia start at the paper's values (K 900 and 1000 Nm/rad, B 2.56 and 1.49 kg
m²), inertial parameters and friction at a rigid least-squares fit; the paper's own start values for those
are not used.

`python -m benchmarks.paper table --write` and `python -m benchmarks.paper seeds --write` make everything
below.

<!-- begin table -->
<!-- end table -->

<!-- begin seeds -->
<!-- end seeds -->
"""


def write(part: str, text: str) -> None:
    """Replace one part of the page; the rest is the frame and the other part as it stands."""
    page = PAGE.read_text(encoding="utf-8") if PAGE.exists() else FRAME
    new = FRAME
    for name in PARTS:
        head, tail = f"<!-- begin {name} -->", f"<!-- end {name} -->"
        kept = (text if name == part else _between(page, head, tail)).strip()
        new = new.replace(f"{head}\n{tail}", f"{head}\n\n{kept}\n\n{tail}" if kept else f"{head}\n{tail}")
    PAGE.write_text(new, encoding="utf-8")


def _between(text: str, head: str, tail: str) -> str:
    return text.partition(head)[2].partition(tail)[0]


def table_part(results: Results, checked: Checked) -> str:
    """Verdicts, findings, compact and full tables."""
    parts = ["## What was to be shown", verdicts(checked), "## Where the paper's statements hold"]
    parts += findings(results)
    parts += [
        "## Every observer on every group",
        f"Largest error of each class in %, of the truth or of {SMALL:g} where the truth is smaller (so "
        "that 2 % is "
        'the paper\'s "2 % or 0.01"). Then: largest error in standard errors, how many 95 % intervals hold '
        "the truth, "
        "how many parameters are marked yes, weak, no, the scaled condition number, and the residual of "
        "the equation "
        f"from {SETTLED:g} s on, on the fitted and on the held-out groups; `least` marks the causal "
        "observer that the "
        "residual would choose.",
    ]
    for letter, start in results.studies():
        parts.append(f"### Group {letter.upper()}, {START_TEXT[start]}")
        parts.append(markdown(tables.compact(results.of(letter, start))))
    parts += [
        "## Every parameter",
        "Value ± half of the 95 % interval; weak and no are the program's own marks, everything else it "
        "marks yes. "
        "R: regrouped, Izz₁ + l₁² m₂ and mx₁ + l₁ m₂ with l₁ = 1 m. Columns: the paper's observer with its "
        "own "
        "bandwidth and with the one of least residual, equal delay, zero phase, and the refinement.",
    ]
    for letter, start in results.studies():
        parts.append(f"### Parameters of group {letter.upper()}, {START_TEXT[start]}")
        parts.append(markdown(tables.full(results.of(letter, start))))
    return join(parts)


def seeds_part(parts: Sequence[tuple[str, list[Statistics], Checked]]) -> str:
    """Statistics over noise seeds."""
    text = [
        "## Noise seeds and the Cramér–Rao bound",
        "Group B with `--refine`. Bias and spread of the estimates over the noise seeds, the standard "
        "error that the "
        "program reports (root mean square), how many of its 95 % intervals hold the truth, and the spread "
        "in units of "
        "the Cramér–Rao bound of the raw data: θ and τ at every controller cycle, noise levels known, "
        "controller and "
        "initial states unknown. The bound comes from a Kalman filter along the true motion, "
        "not from the identification's equation.",
    ]
    for start, statistics, checked in parts:
        text.append(f"### Group B, {START_TEXT[start]}, {statistics[0].seeds} seeds")
        text += [markdown(tables.statistics(statistics)), verdicts(checked)]
    return join(text)


def join(parts: Sequence[str]) -> str:
    """Paragraphs with blank lines between; what is neither table nor list is wrapped."""
    wrapped = [
        p if p.startswith(("|", "-", "#")) else textwrap.fill(p, 110, break_on_hyphens=False) for p in parts
    ]
    return "\n\n".join(wrapped)


def verdicts(lines: Checked) -> str:
    """A list of pass and fail."""
    return "\n".join(f"- {'pass' if passed else '**fail**'}: {text}" for text, passed in lines)
