"""A card for every public recording in DIR: `python -m benchmarks.gallery DIR [--write]`.

Each recording is diagnosed with all steps, compared with a rigid fit of the same friction terms, and with its
link encoders where it has them. What a recording is, its licence and what its authors state is in
`RECORDINGS`; all other figures are computed. Without --write the page is printed; with it,
benchmarks/results/public-recordings.md is renewed.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np

from benchmarks.command import command
from benchmarks.real import held_out_share
from benchmarks.rigid import rigid_held_out
from benchmarks.tables import markdown
from flexviz.analysis.diagnosis import Diagnosis, Finding, diagnose
from flexviz.analysis.identification import identify
from flexviz.base.arrays import Array
from flexviz.content.charts.svg import draw_svg
from flexviz.content.view import staircase_chart
from flexviz.content.wording import estimate_words, finding_name, listed, short_names, values_text
from flexviz.data.importing import import_logs
from flexviz.data.measurements import MeasurementSet, read_set

RESULTS = Path(__file__).resolve().parent / "results"
PAGE, PICTURES = RESULTS / "public-recordings.md", RESULTS / "images" / "robots"
HEIGHT = 220  # [px] of a picture
FRICTION = ("coulomb_friction", "torque_offset")  # what a specialist's rigid fit has beside viscous friction


@dataclass(frozen=True)
class Recording:
    """A public recording: where it is in DIR, and what its source says."""

    folder: str
    title: str
    source: str
    licence: str
    content: str
    stated: str = ""  # by its authors


PENDULUM = "github.com/dfki-ric-underactuated-lab/double_pendulum", "BSD-3-Clause"
RECORDINGS = (
    Recording(
        "kuka_kr300",
        "KUKA KR300 R2500",
        "github.com/JonasWeigand/Robot_Identification",
        "MIT",
        "Six joints, two trajectories of 10 s at 250 Hz, one held out; link encoders on joints 1 to 3.",
        "No joint exceeds 0.76 rad/s.",
    ),
    Recording(
        "tx40",
        "Stäubli TX40",
        "github.com/thanhndv212/figaroh-examples",
        "Apache-2.0",
        "Six joints, one excitation of 7.6 s at 5 kHz: 4.5 s to fit, 3.1 s held out. Torques from currents.",
        "Motor 6 turns with joints 5 and 6: its friction brakes both.",
    ),
    Recording(
        "dfki_pendulum/a0",
        "Double pendulum, design A.0",
        *PENDULUM,
        "Two AK80-6 drives, gears of 6 : 1, one run of 75 s at about 300 Hz: 48 s to fit, 26 s held out.",
    ),
    Recording(
        "dfki_pendulum/c1",
        "Double pendulum, design C.1",
        *PENDULUM,
        "Two AK80-6 drives, two runs of 6 s at 500 Hz, one of them held out.",
        "Its authors' rigid fit has Coulomb friction of 0.16 and 0.12 Nm.",
    ),
    Recording(
        "dfki_pendulum/late_cycles",
        "Double pendulum, design C.0",
        *PENDULUM,
        "Two AK80-6 drives, two runs of 6 s with late cycles, one of them held out.",
        "Its authors' rigid fit has Coulomb friction of 0.093 and 0.078 Nm.",
    ),
)


def opened(folder: Path, work: Path) -> MeasurementSet:
    """The set of a folder, or of the logs that its mapping names."""
    if (folder / "measurements.toml").is_file():
        return read_set(folder)
    import_logs(folder / "mapping.toml", work / folder.name, accept=True)
    return read_set(work / folder.name)


def percent(shares: Array) -> str:
    """Errors of joints: their mean and the largest."""
    return f"{100 * float(np.mean(shares)):.1f} %, {100 * float(np.max(shares)):.0f} %"


def added(finding: Finding) -> str:
    """An effect with its values."""
    values = values_text(finding)
    return f"{finding_name(finding)}: {values}" if values else finding_name(finding)


def stiffness(result: Diagnosis) -> str:
    """Table of the last model's stiffnesses, with what link encoders show, which no fit has seen."""
    found = [p for p in result.parameters if p.name == "stiffness"]
    names = short_names(tuple(p.joint or "" for p in found))
    encoded = {entry.joint: entry.text for entry in result.link_side}
    rows = [
        ["joint", "stiffness of the last model", "determined", *(["by its link encoder"] if encoded else [])]
    ]
    for name, p in zip(names, found, strict=True):
        beside = [encoded.get(p.joint or "", "–")] if encoded else []
        rows.append([name, estimate_words(p), p.identifiable, *beside])
    return markdown(rows, numbers=False)


def unproved(measurements: MeasurementSet, result: Diagnosis) -> str:
    """What the recording leaves open: its groups, payloads, joints without a stiffness, the verdict."""
    fitted = [group for group in measurements.groups if not group.validation]
    seconds = sum(len(s) * s.step for group in fitted for s in group.segments)
    groups = "one group" if len(fitted) == 1 else f"{len(fitted)} groups"
    said = [
        f"The model predicts motions like the recorded ones; it was fitted to {seconds:.0f} s in {groups}."
    ]
    if not any(group.bodies for group in measurements.groups):
        said.append("Nothing was carried, so the masses of the links are known only as far as they move.")
    unknown = [p.joint or "" for p in result.parameters if p.name == "stiffness" and p.identifiable == "no"]
    if unknown:
        names = dict(zip(measurements.joints, short_names(measurements.joints), strict=True))
        said.append(f"The stiffness of {listed([names[j] for j in unknown])} is not determined.")
    if result.steps[-1].verdict != "nothing-missing":
        said.append("What is left is above the noise: values of the model stand in for what it lacks.")
    return " ".join(said)


def card(recording: Recording, measurements: MeasurementSet, picture: Path | None) -> str:
    """One recording's section; its picture is written to `picture`."""
    result = diagnose(measurements, apply=True)
    plain = identify(measurements, effects=FRICTION)
    flexible, rigid = rigid_held_out(measurements, plain)
    shares = [held_out_share(measurements, step.model) for step in result.steps if step.model is not None]
    name = recording.folder.replace("/", "-")
    if picture is not None:
        chart = staircase_chart(result.steps, spread=result.torque_spread)
        words = replace(chart, height=HEIGHT, note=chart.description)
        (picture / f"{name}.svg").write_text(draw_svg(words, name), encoding="utf-8")
    lines = [
        f"## {recording.title}",
        "",
        f"{recording.content} Source: {recording.source}; licence: {recording.licence}.",
        "",
        f"![Error of {recording.title} after each added effect](images/robots/{name}.svg)",
        "",
        "| model | held-out error: mean, worst joint |",
        "|---|---|",
        f"| rigid, viscous and Coulomb friction, offset | {percent(rigid)} |",
        f"| flexible, the same friction | {percent(flexible)} |",
        *(
            f"| {'flexible, viscous friction' if step.added is None else '+ ' + added(step.added)} "
            f"| {percent(share)} |"
            for step, share in zip(result.steps, shares, strict=True)
        ),
        "",
        f"Last verdict: {result.steps[-1].verdict}. {recording.stated}".rstrip(),
        "",
        stiffness(result),
        "",
        f"**What it does not prove.** {unproved(measurements, result)}",
    ]
    return "\n".join(lines)


HEADER = """\
# Public recordings: a card for each

[The page](../../docs/robots.md) says what they mean.

<!-- made by `python -m benchmarks.gallery DIR --write` -->

What flexviz finds on recordings that anybody can get. Errors are those of runs that no fit has seen: rms of
the torque that is not explained, divided by the torque's standard deviation, while a joint moves faster than
0.01 rad/s. The recordings are not part of this project.
"""


@command
def main(
    folder: Annotated[Path, "folder of the recordings"],
    *,
    only: Annotated[str | None, "recordings with this text in their folders; nothing is written"] = None,
    write: Annotated[bool, "write public-recordings.md and its pictures"] = False,
) -> int:
    here = [one for one in RECORDINGS if (folder / one.folder).is_dir()]
    missing = [one.folder for one in RECORDINGS if one not in here]
    if missing:
        print(f"{folder}: {listed(missing)} not here", file=sys.stderr)
    if only is not None:
        here = [one for one in here if only in one.folder]
    pictures = PICTURES if write and not missing and only is None else None
    if pictures is not None:
        pictures.mkdir(parents=True, exist_ok=True)
    cards = []
    with tempfile.TemporaryDirectory() as work:
        for one in here:
            print(one.folder, file=sys.stderr, flush=True)
            cards.append(card(one, opened(folder / one.folder, Path(work)), pictures))
    text = "\n\n".join([HEADER.rstrip(), *cards]) + "\n"
    if pictures is not None:
        PAGE.write_text(text, encoding="utf-8")
    else:
        print(text)
    return 0 if here and not (write and missing) else 2


if __name__ == "__main__":
    sys.exit(main())
