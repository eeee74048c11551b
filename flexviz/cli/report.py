"""`flexviz report SET|SESSION --out FILE.html`: what was found, in one file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.cli.diagnose import GuardOption
from flexviz.cli.own import EffectsFromOption, load_own
from flexviz.errors import InputError, choose_from

if TYPE_CHECKING:
    from collections.abc import Callable

    from flexviz.cli.progress import Reporter
    from flexviz.session import OpenedSession, Session

SUFFIXES = {".html": "html", ".htm": "html", ".md": "md", ".json": "json"}
SourceArgument = Annotated[
    Path, typer.Argument(metavar="SET|SESSION", help="Folder with measurements.toml or session.json.")
]


def report(
    source: SourceArgument,
    out: Annotated[Path, typer.Option(metavar="FILE", help="File to write: .html, .md or .json.")],
    guard: GuardOption = None,
    keep: Annotated[
        Path | None,
        typer.Option("--session", metavar="DIR", help="Also keep the results as a session in a new folder."),
    ] = None,
    effects_from: EffectsFromOption = None,
) -> int:
    """Write a report: of a set after a full diagnosis, of a session from what is saved in it."""
    from flexviz.cli import output
    from flexviz.cli.progress import Reporter, interruptible
    from flexviz.files import write_whole
    from flexviz.report import session_report
    from flexviz.session import is_session, open_session, save_session

    load_own(effects_from)
    kind = kind_of(out)
    output.check_output_file(out)
    if keep is not None and keep.exists() and (not keep.is_dir() or any(keep.iterdir())):
        raise InputError("exists and is not empty; a new folder would be right", file=keep)
    with Reporter(f"reading {source}") as progress, interruptible() as should_stop:
        opened = open_session(source)
        saved = is_session(source)
        complete = completed if saved else diagnosed
        session = complete(opened, guard, progress, should_stop)
    measurements = opened.measurements
    if keep is not None:
        save_session(session, measurements, keep)
    folder = keep or (opened.folder if saved and session is opened.session else None)
    folder = None if folder is None else folder.resolve()
    text = session_report(session, measurements, kind, folder=folder, changed=opened.changed).encode()
    try:
        write_whole(out, text)
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror or error})", file=out) from None
    console = output.results()
    console.print(f"{out}: {len(text) / 1e3:.0f} kB", soft_wrap=True)
    diagnosis = session.analysis.diagnosis
    return 130 if diagnosis is not None and diagnosis.stopped else 0


def kind_of(out: Path) -> str:
    """The kind of report that a file's name asks for."""
    kind = SUFFIXES.get(out.suffix.lower())
    if kind is None:
        found = out.suffix or out.name
        raise InputError(f'"{found}" says no kind of report; {choose_from(found, SUFFIXES)}', file=out)
    return kind


def diagnosed(
    opened: OpenedSession, guard: bool | None, progress: Reporter, should_stop: Callable[[], bool]
) -> Session:
    """A set: everything is looked for, and what is found is added."""
    from flexviz.diagnosis import diagnose
    from flexviz.report import diagnosed_session

    found = diagnose(
        opened.measurements,
        apply=True,
        guarded=guard,
        progress=progress,
        should_stop=should_stop,
    )
    return diagnosed_session(opened.measurements, found)


def completed(
    opened: OpenedSession, guard: bool | None, progress: Reporter, should_stop: Callable[[], bool]
) -> Session:
    """A session: as it is saved; only what is asked for and is not there is computed, the model stays."""
    from dataclasses import replace

    from flexviz.cli.progress import note
    from flexviz.diagnosis import diagnose
    from flexviz.progress import Progress
    from flexviz.report import chosen_set, guarded

    session, measurements = opened.session, opened.measurements
    analysis = session.analysis
    if opened.changed:
        note(f"the data have changed since the session was saved: {', '.join(opened.changed)}")
        return session
    if not analysis.diagnosis_up_to_date and analysis.groups_with("fit"):
        known = analysis.identification if analysis.up_to_date else None
        found = diagnose(
            chosen_set(measurements, analysis),
            apply=False,
            start=known.model if known is not None and known.converged else None,
            guarded=guard,
            progress=progress,
            should_stop=should_stop,
        )
        return session.then("looked for the missing effect", analysis.with_diagnosis(found))
    diagnosis = analysis.diagnosis
    if guard and diagnosis is not None and diagnosis.guard is None and diagnosis.model is not None:
        progress(Progress("checking parameters against the observer's bandwidth"))
        looked = replace(diagnosis, guard=guarded(measurements, analysis, diagnosis.model, should_stop))
        return session.then("looked at the bandwidth", replace(analysis, diagnosis=looked))
    return session
