"""Workflows of `flexviz report` and `flexviz record`, for use from Python."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Unpack

from flexviz.analysis.acceptance import read_limits
from flexviz.analysis.diagnosis import BandwidthCheck, check_bandwidth, diagnose, maps_of
from flexviz.analysis.identification import FitOptions, FitSettings, Identification, fit_settings, identify
from flexviz.base.errors import Cancelled, InputError, choose_from
from flexviz.base.files import write_file
from flexviz.base.progress import Progress, ProgressCallback, StopCallback, ignore, never
from flexviz.content.session import (
    Analysis,
    OpenedSession,
    Session,
    is_session,
    open_session,
    save_session,
    with_settings,
)
from flexviz.data.measurements import MeasurementSet, set_of
from flexviz.model.equation import layout_of
from flexviz.outlets.report import diagnosed_session, session_animation, session_report
from flexviz.robot.model import FlexibleModel

if TYPE_CHECKING:
    from flexviz.outlets.recording import Recorded, RecordingFile

REPORT_SUFFIXES = {".html": "html", ".htm": "html", ".md": "md", ".json": "json"}


@dataclass(frozen=True, eq=False)
class WrittenReport:
    """A report and the session it shows.

    Attributes:
        file: what was written.
        session: with the diagnosis that the report needed.
        changed: files of the set that differ from those the session's results belong to.
    """

    file: Path
    session: Session
    changed: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class RecordedAnalysis:
    """A recording and the identifications in it, in their order."""

    recorded: Recorded
    results: tuple[Identification, ...]

    def viewer(self, width: int | Literal["auto"] = "auto", height: int = 600) -> Any:
        """The recording in Rerun's viewer, of this size [px], to be displayed by a notebook.

        Raises:
            MissingPackage: rerun-notebook is not installed.
        """
        from flexviz.outlets.recording import notebook_viewer

        return notebook_viewer(self.recorded.file, width, height)


def write_report(
    source: str | Path | MeasurementSet | OpenedSession,
    out: str | Path,
    *,
    guard: bool | None = None,
    keep: str | Path | None = None,
    animation: str | Path | None = None,
    require: str | Path | None = None,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
) -> WrittenReport:
    """Write a report: of a set after a full diagnosis, of a session from what is in it.

    Args:
        source: a set, also in memory, folder of a set or a session, or an open session.
        out: file to write: .html, .md or .json.
        guard: also check how results change with the observer bandwidth; None: only if the model does not
            reach the measurement noise.
        keep: new folder for a session with the results.
        animation: HTML file of the measured and the identified robot in motion, written after the report.
        require: file of limits, for a section that says whether the result keeps them.
        progress, should_stop: see `flexviz.base.progress`.

    Raises:
        InputError: for a file of another kind, or a folder `keep` that is not empty.
    """
    out = Path(out)
    keep, animation, require = (None if one is None else Path(one) for one in (keep, animation, require))
    kind = report_kind(out)
    if keep is not None and keep.exists() and (not keep.is_dir() or any(keep.iterdir())):
        raise InputError("exists and is not empty, expected a new folder", file=keep)
    opened = source if isinstance(source, OpenedSession) else open_session(source)
    limits = None if require is None else read_limits(require, opened.measurements.joints)
    saved, present = is_session(opened.folder) and opened.measurements.in_files, opened.session.analysis
    if saved or present.diagnosis is not None or present.identification is not None:
        session = _completed(opened, guard, progress, should_stop)
    else:
        callbacks = {"progress": progress, "should_stop": should_stop}
        found = diagnose(opened.measurements, apply=True, guard=guard, **callbacks)
        session = diagnosed_session(opened.measurements, found)
    if keep is not None:
        save_session(session, opened.measurements, keep)
    folder = keep or (opened.folder if saved and session is opened.session else None)
    folder = None if folder is None else folder.resolve()
    text = session_report(
        session, opened.measurements, kind, folder=folder, changed=opened.changed, limits=limits
    )
    write_file(out, text)
    if animation is not None:
        told = {"progress": progress, "should_stop": should_stop}
        write_file(animation, session_animation(session, opened.measurements, **told))
    return WrittenReport(out, session, opened.changed)


def report_kind(out: Path) -> str:
    """The kind of report that a file's name asks for."""
    kind = REPORT_SUFFIXES.get(out.suffix.lower())
    if kind is None:
        found = out.suffix or out.name
        raise InputError(
            f'"{found}" is not a kind of report; {choose_from(found, REPORT_SUFFIXES)}', file=out
        )
    return kind


def _completed(
    opened: OpenedSession, guard: bool | None, progress: ProgressCallback, should_stop: StopCallback
) -> Session:
    """A saved session: only missing results are computed, the model is unchanged."""
    session, measurements = opened.session, opened.measurements
    analysis = session.analysis
    if opened.changed:
        return session
    if not analysis.diagnosis_up_to_date and analysis.groups_with("fit"):
        found = diagnose(
            chosen_set(measurements, analysis),
            apply=False,
            guard=guard,
            progress=progress,
            should_stop=should_stop,
        )
        return session.then("looked for the missing effect", analysis.with_diagnosis(found))
    diagnosis = analysis.diagnosis
    if guard and diagnosis is not None and diagnosis.guard is None and diagnosis.model is not None:
        progress(Progress("checking parameters against the observer's bandwidth"))
        found = bandwidth_checked(measurements, analysis, diagnosis.model, should_stop)
        checked = replace(analysis, diagnosis=replace(diagnosis, guard=found))
        return session.then("looked at the bandwidth", checked)
    return session


def bandwidth_checked(
    measurements: MeasurementSet, analysis: Analysis, model: FlexibleModel, should_stop: StopCallback
) -> BandwidthCheck:
    """Bandwidth check of the final model of a diagnosis."""

    def check() -> None:
        if should_stop():
            raise Cancelled

    chosen = chosen_set(measurements, analysis)
    layout = layout_of(chosen)
    return check_bandwidth(chosen, layout, layout.vector(model), check=check)


def chosen_set(measurements: MeasurementSet, analysis: Analysis) -> MeasurementSet:
    """The set with the roles, servos and effects of a session's state."""
    chosen = with_settings(measurements, analysis)
    return replace(chosen, effects=(*chosen.effects, *analysis.effects))


def record(
    measurements: MeasurementSet | str | Path,
    out: str | Path,
    settings: FitSettings | None = None,
    *,
    apply: bool = False,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
    **options: Unpack[FitOptions],
) -> RecordedAnalysis:
    """Identify a set and record signals, observer states, residuals, iterations and both robots.

    Args:
        measurements: the set, or its folder.
        out: file to write, .rrd.
        settings, options: as in `identify`.
        apply: also find the missing effects, add them one by one and record every step.
        progress, should_stop: see `flexviz.base.progress`; what was recorded before a stop is kept.
    """
    from flexviz.outlets.recording import recording_file

    measurements = set_of(measurements)
    chosen, results = fit_settings(settings, **options), list[Identification]()
    effects = list(chosen.effects)
    with recording_file(measurements, out, progress=progress, should_stop=should_stop) as file:

        def tell(news: Progress) -> None:
            progress(news)
            if news.iteration is not None:
                file.recorder.iteration(news.iteration)

        fit = partial(identify, measurements, chosen, progress=tell, should_stop=should_stop)
        file.recorder.measured(file.part(0.0, 0.1))
        file.recorder.session(
            observer=chosen.observer,
            effects=effects,
            groups=list(chosen.groups or ()),
            refine=chosen.refine,
            diagnose=apply,
        )
        file.recorder.observe(chosen.make_observer(), file.part(0.1, 0.25))
        _solve(file, effects, f"with {', '.join(effects)}" if effects else "present model", fit, results)
        if apply:
            extended = replace(measurements, effects=(*measurements.effects, *effects))
            found = diagnose(extended, apply=True, progress=progress, should_stop=should_stop)
            file.recorder.diagnosis(found)
            if found.stopped:
                raise Cancelled
            for step in found.steps:
                if step.added is None:
                    continue
                effects = [*effects, step.added.text]
                # a free curve's many nodes are fitted from far off slowly, and not to the same minimum
                model = step.model if step.added.stopgap else None
                _solve(file, effects, f"+ {step.added.text}", partial(fit, model=model), results)
        file.simulate(results[-1], file.part(0.5, 1.0))
        file.step("writing", 1.0)
    assert file.written is not None
    return RecordedAnalysis(file.written, tuple(results))


def _solve(
    file: RecordingFile,
    effects: list[str],
    label: str,
    fit: Callable[..., Identification],
    results: list[Identification],
) -> None:
    """Identify with these effects, append the result to `results`, record it and its residual maps."""
    file.recorder.start(label)
    result = fit(effects=effects)
    file.recorder.result(result)
    results.append(result)
    if result.stopped:
        raise Cancelled
    file.step(f"{label}: where it fails", 0.3)
    file.recorder.maps(maps_of(file.recorder.measurements, result.model, effects))
