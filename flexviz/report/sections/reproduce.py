"""Everything one needs to get the same again: data with hashes, settings, versions, the command."""

from __future__ import annotations

import platform
import shlex
from importlib.metadata import PackageNotFoundError, version

from flexviz import __version__
from flexviz.effects import loaded_files
from flexviz.report.blocks import Block, Cell, Code, Items, Listing, Section, Table, table, text
from flexviz.report.gathering import Subject
from flexviz.session import Analysis
from flexviz.wording import number, plural

LIBRARIES = ("numpy", "scipy", "pin", "pyarrow")
USED = {"fit": "fit", "validate": "validate", "ignore": "not used"}


def reproduce(subject: Subject) -> Section:
    """Data, settings, history, command."""
    parts = [
        Section("Data", (_groups(subject), _files(subject))),
        Section("Settings", (_settings(subject),)),
        Section("Again", tuple(_again(subject))),
    ]
    history = _history(subject)
    if history:
        parts.append(Section("History", tuple(history)))
    return Section("To reproduce", (), tuple(parts))


def _groups(subject: Subject) -> Table:
    roles = dict(subject.analysis.roles)
    rows = []
    for group in subject.measurements.groups:
        rates = sorted({round(1.0 / segment.step) for segment in group.segments})
        rate = "–" if not rates else f"{rates[0]:g}" + ("" if len(rates) == 1 else f"–{rates[-1]:g}")
        rows.append(
            [
                group.name,
                group.trajectory,
                group.payload,
                USED.get(roles.get(group.name, "ignore"), "not used"),
                number(group.duration, 3),
                rate,
                str(group.samples),
                str(len(group.segments)),
            ]
        )
    head = ("group", "trajectory", "payload", "used to", "length [s]", "rate [Hz]", "samples", "pieces")
    return table(head, rows, (4, 5, 6, 7))


def _files(subject: Subject) -> Table:
    rows: list[list[str | Cell]] = [[f.name, str(f.bytes), f.sha256] for f in subject.fingerprint.files]
    rows.append([Cell("the whole set", strong=True), "", Cell(subject.fingerprint.sha256, strong=True)])
    return table(("file", "bytes", "SHA-256"), rows, (1,), dense=True)


def _settings(subject: Subject) -> Table:
    analysis, measurements = subject.analysis, subject.measurements
    versions = [f"{name} {_version(name)}" for name in LIBRARIES]
    rows = [
        ["measurement set", str(measurements.path)],
        [
            "robot",
            f"{measurements.robot.name} ({measurements.robot.source}), {plural(measurements.n, 'joint')}",
        ],
        ["effects of the set", ", ".join(measurements.effects) or "none"],
        ["effects added", ", ".join(analysis.effects) or "none"],
        ["fitted groups", ", ".join(analysis.groups_with("fit")) or "none"],
        ["held-out groups", ", ".join(analysis.groups_with("validate")) or "none"],
        ["torque hold", f"{measurements.torque_hold:g} s"],
    ]
    if subject.identification is not None:
        found = subject.identification
        bandwidth = analysis.bandwidth
        shown = "its own" if bandwidth is None else _numbers(bandwidth) + " rad/s"
        rows.append(["observer of the identification", f"{found.observer_name}, bandwidth {shown}"])
        rows.append(["refined", "yes" if found.refined else "no"])
    if subject.diagnosis is not None:
        rows.append(["observer of the diagnosis", "two zero-phase bands of its own"])
        rows.append(["time of the diagnosis", f"{number(subject.diagnosis.seconds, 3)} s"])
    rows.append(["flexviz", __version__])
    rows.append(["Python and libraries", f"Python {platform.python_version()}, {', '.join(versions)}"])
    if subject.folder is not None:
        rows.append(["session", str(subject.folder)])
    rows += [["recording", str(file)] for file in subject.session.recordings]
    return table(("setting", "value"), rows)


def _again(subject: Subject) -> list[Block]:
    blocks: list[Block] = []
    path = shlex.quote(str(subject.measurements.path))
    if subject.folder is not None:
        blocks.append(text("This report from the saved results, without computing anything again:"))
        folder = shlex.quote(str(subject.folder))
        blocks.append(Listing(f"flexviz report {folder} --out report.html", "sh"))
    if subject.diagnosis is not None and _as_the_set_says(subject):
        flags = [f"--effects-from {shlex.quote(str(file))}" for file in loaded_files()]
        flags += ["--guard"] if subject.diagnosis.guard is not None else []
        again = " ".join([f"flexviz report {path} --out report.html", *flags])
        blocks += [text("Everything from the data:"), Listing(again, "sh")]
    else:
        blocks += [text("Everything from the data, in Python:"), Listing(program(subject), "python")]
    blocks.append(text("Whether the data are the same:", quiet=True))
    blocks.append(Listing(_check(subject), "sh"))
    return blocks


def _as_the_set_says(subject: Subject) -> bool:
    """Whether the groups are used as the set says, and every effect was found rather than chosen by hand."""
    analysis = subject.analysis
    plain = Analysis.start(subject.measurements).roles == analysis.roles
    found = [name for name, finding in subject.added if finding is not None]
    return plain and list(analysis.effects) == found and subject.identification is None


def program(subject: Subject) -> str:
    """A Python program that computes the present model again."""
    analysis = subject.analysis
    lines = [
        "from dataclasses import replace",
        "",
        "import flexviz",
        "from flexviz.session import with_roles",
        "",
        *(f"flexviz.load_effects({str(file)!r})" for file in loaded_files()),
        f"measurements = flexviz.read_set({str(subject.measurements.path)!r})",
    ]
    if analysis.roles != Analysis.start(subject.measurements).roles:
        lines.append(f"measurements = with_roles(measurements, {dict(analysis.roles)!r})")
    effects = list(analysis.effects)
    if subject.identification is not None:
        lines += [
            "identification = flexviz.identify(",
            "    measurements,",
            f"    effects={effects!r},",
            f"    observer={analysis.observer!r},",
            f"    bandwidth={analysis.bandwidth!r},",
            f"    refine={analysis.refine!r},",
            ")",
        ]
    if subject.diagnosis is not None:
        lines += [
            f"complete = replace(measurements, effects=(*measurements.effects, *{effects!r}))",
            "diagnosis = flexviz.diagnose(complete, apply=False)",
        ]
    return "\n".join(lines)


def _check(subject: Subject) -> str:
    """Lines that `sha256sum --check` reads, for the files that lie in the set's folder."""
    files = [f for f in subject.fingerprint.files if ":" not in f.name]
    rows = "\n".join(f"{f.sha256}  {f.name}" for f in files)
    return f"cd {shlex.quote(str(subject.measurements.path))} && sha256sum --check <<'END'\n{rows}\nEND"


def _history(subject: Subject) -> list[Block]:
    steps = subject.session.steps
    blocks: list[Block] = []
    if len(steps) > 1:
        rows = []
        for step in steps:
            when = step.when.replace("T", " ").replace("+00:00", " UTC")
            rows.append([when or "–", step.label, step.version or "–"])
        blocks.append(table(("when", "what", "flexviz"), rows))
    if subject.session.notes:
        blocks.append(text("Notes:"))
        blocks.append(Items(tuple((note.text, *_when(note.when)) for note in subject.session.notes)))
    return blocks


def _when(when: str) -> tuple[str | Code, ...]:
    return (f" ({when.replace('T', ' ').replace('+00:00', ' UTC')})",) if when else ()


def _numbers(bandwidth: float | tuple[float, ...]) -> str:
    values = bandwidth if isinstance(bandwidth, tuple) else (bandwidth,)
    return ", ".join(f"{value:g}" for value in values)


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"
