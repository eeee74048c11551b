"""`flexviz diagnose SET`: is the model complete, and if not, what is missing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.cli.identifying import SetArgument
from flexviz.cli.own import EffectsFromOption, load_own

if TYPE_CHECKING:
    from flexviz.diagnosis import Absorbed, Diagnosis, Finding


GuardOption = Annotated[
    bool | None,
    typer.Option(
        "--guard/--no-guard",
        help="Also look at what moves with the observer's bandwidth (without either: only where the "
        "model does not reach the measurement noise).",
    ),
]


def diagnose(
    measurement_set: SetArgument,
    apply: Annotated[
        bool, typer.Option("--apply", help="Add the found effects one by one and refit after each.")
    ] = False,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write the result as JSON.")
    ] = None,
    guard: GuardOption = None,
    effects_from: EffectsFromOption = None,
) -> int:
    """Say whether the model is complete, and if not, which effect is missing and where."""
    from flexviz.cli import output
    from flexviz.cli.progress import Reporter, interruptible
    from flexviz.diagnosis import diagnose as search
    from flexviz.importing import with_plausibility_warnings
    from flexviz.measurements import read_set

    load_own(effects_from)
    output.check_output_file(json_file, ".json")
    with Reporter(f"reading {measurement_set}") as report, interruptible() as should_stop:
        measurements = with_plausibility_warnings(read_set(measurement_set))
        result = search(
            measurements,
            apply=apply,
            guarded=guard,
            progress=report,
            should_stop=should_stop,
        )
    if json_file is not None:
        document = result.to_json()
        if not apply:
            del document["steps"]
        output.write_json(json_file, document)
    show(result)
    return 130 if result.stopped else 0


def show(result: Diagnosis) -> None:
    """The answer in sentences on standard output."""
    from flexviz.cli import output

    console = output.results()
    for line in lines(result):
        console.print(line, soft_wrap=True)


def lines(result: Diagnosis) -> list[str]:
    """The answer as lines of text: verdict, findings, staircase, what else there is to know."""
    out = [sentence(result)]
    for number, finding in enumerate(result.findings, 1):
        out.append(f"{number:3d}. {described(finding)}")
        for tie in finding.inseparable_from:
            place = f" on {tie.joint}" if tie.joint else ""
            out.append(f"     not told apart from {tie.effect}{place} (correlation {tie.correlation:.2f})")
            if tie.breaks:
                out.append(f"     {tie.breaks}")
    for step in result.steps:
        label = "as it is" if step.added is None else f"with {step.added.text}"
        held_out = "" if step.rms_validation is None else f", held out {_numbers(step.rms_validation)}"
        out.append(f"{label}: rms {_numbers(step.rms)} Nm{held_out} Nm → {step.verdict}")
        if step.added is not None and step.added.absorbed:
            out.append(f"     until then it had moved {'; '.join(map(_moved, step.added.absorbed[:3]))}")
    if result.steps and result.steps[-1].noise_floor:
        out.append(f"the measurement noise alone leaves {_numbers(result.steps[-1].noise_floor)} Nm")
    out.extend(f"note: {text}" for text in result.notes)
    if result.stopped:
        out.append("stopped; this is what was found so far")
    return out


def _moved(absorbed: Absorbed) -> str:
    place = f" of {absorbed.joint}" if absorbed.joint else ""
    change = f"{absorbed.before:.4g} → {absorbed.after:.4g} {absorbed.unit}"
    return f"{absorbed.name.replace('_', ' ')}{place} ({change}, {absorbed.deviations:.0f} standard errors)"


def sentence(result: Diagnosis) -> str:
    """The verdict in one sentence."""
    if result.verdict == "nothing-missing":
        return "Nothing is missing: what is left is measurement noise."
    if result.verdict == "unknown":
        place = result.where[0]
        low, high = place.range
        return (
            f"Unknown: something is missing on {place.joint} that no effect in the library explains; it "
            f"follows {place.variable} ({100 * place.explained:.0f} % of the residual, "
            f"mostly {low:.3g} … {high:.3g})."
        )
    return f"Missing: {described(result.findings[0])}"


def described(finding: Finding) -> str:
    """An effect with its place and values."""
    from flexviz.cli.tables import interval
    from flexviz.wording import unit_text

    place = finding.joint or finding.payload or "the whole robot"
    group = f" in group {finding.group}" if finding.group else ""
    values = ", ".join(
        f"{k} {' ± '.join(interval(v, s))} {unit_text(u)}".rstrip()
        for k, (v, s, u) in finding.parameters.items()
    )
    return (
        f"{finding.effect} on {place}{group}: {values}; "
        f"explains {100 * finding.score:.0f} % of the held-out excess, confidence {finding.confidence:.2f}"
    )


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{v:.4g}" for v in values)
