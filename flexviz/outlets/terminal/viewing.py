"""`flexviz serve` and `flexviz review`: the app in the browser, and recordings in Rerun's viewer."""

from __future__ import annotations

import threading
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flexviz.base.errors import InputError
from flexviz.base.files import temporary_folder
from flexviz.outlets.terminal import terminal
from flexviz.outlets.terminal.options import BrowserOption

if TYPE_CHECKING:
    from flexviz.outlets.recording import Recording


def review(
    source: Annotated[
        Path, typer.Argument(metavar="FILE.rrd|SESSION", help="A recording (*.rrd), or a session's folder.")
    ],
    other: Path | None = typer.Argument(None, metavar="[OTHER]", help="A second one to compare it with."),
    check: bool = typer.Option(False, "--check", help="Only check it and list its content; open nothing."),
    web: bool | None = typer.Option(
        None, "--web/--native", help="In the browser or in a window; default: a window if there is a display."
    ),
    out: Path | None = typer.Option(
        None, metavar="FILE.rrd", help="Keep the recording that is made of a session."
    ),
    port: int | None = typer.Option(None, metavar="P", help="Port of the page; default: 9090 or a free one."),
    browser: BrowserOption = True,
) -> int:
    """Open recordings in Rerun's viewer, on this machine only; of two, the newest results are compared."""
    from flexviz.content.comparing import compare, comparison_blocks
    from flexviz.outlets.recording import ending_tidily

    terminal.check_output_file(out, ".rrd", named=True)
    with temporary_folder("review") as temporary, ending_tidily():
        sources = [source] if other is None else [source, other]
        if out is not None and (other is not None or source.is_file()):
            raise InputError("--out keeps the recording made of a session, expected one", file=source)
        files = [prepared(one, temporary / str(n), out) for n, one in enumerate(sources)]
        found = [described(file) for file in files]
        if len(found) == 2:
            a, b = found
            if a is None or b is None:
                raise InputError("only recordings of flexviz can be compared", file=files[a is not None])
            terminal.show_blocks(comparison_blocks(compare([a.known, b.known])))
        if not check:
            show(files, web, port, browser)
    return 0


def prepared(source: Path, temporary: Path, out: Path | None) -> Path:
    """The recording to open: checked, or created from a session."""
    from flexviz.content.session import is_session
    from flexviz.outlets.recording import check_recording

    if is_session(source):
        return from_session(source, out or temporary / f"{source.resolve().name}.rrd")
    if source.is_dir():
        raise InputError(
            "neither a recording nor a session; `flexviz record` records a measurement set", file=source
        )
    checked = check_recording(source)
    confirmed = "matches" if checked.confirmed else "not available"
    say(f"{checked.file}: complete, {checked.chunks} chunks as in its footer; recorded SHA-256: {confirmed}")
    return checked.file


def from_session(source: Path, out: Path) -> Path:
    """Record a session."""
    from flexviz.content.session import open_session
    from flexviz.outlets.recording import record_session

    with terminal.Reporter(f"reading {source}") as report:
        opened = open_session(source)
        out.parent.mkdir(exist_ok=True)
        record_session(opened.session, opened.measurements, out, report)
    for file in opened.session.recordings:
        say(f"earlier recording: {file}{'' if file.is_file() else ' (missing)'}")
    return out


def described(file: Path) -> Recording | None:
    """Print the content of a recording; None if flexviz did not write it."""
    from flexviz.content.results import ResultDocument
    from flexviz.content.wording import verdict_text
    from flexviz.outlets.recording import read_recording

    try:
        found = read_recording(file)
    except InputError as error:
        say(str(error))
        return None
    simulated = " (simulated data)" if found.simulated else ""
    say(f"{found.set_name}{simulated}, robot {found.robot}: {', '.join(found.groups)}")
    for number, result in enumerate(found.results, 1):
        label = result.get("label") or "model of the set"
        say(f"result {number}, {label}: {errors(result)}{'' if result['converged'] else ', not converged'}")
    for diagnosis in found.diagnoses:
        say(f"verdict: {verdict_text(ResultDocument.from_dict(diagnosis))}")
    if not found.results:
        say("contains no identification")
    return found


def errors(result: dict[str, Any]) -> str:
    """The errors of a result per joint."""
    from flexviz.content.records import JointErrors
    from flexviz.content.wording import error_whole

    residual = result["residual"]
    rows = {"error": residual["rms"], "held out": residual["rms_validation"]}
    told = []
    for name, rms in rows.items():
        if rms is not None:
            found = JointErrors(rms, residual.get("torque_spread", ()), (), residual.get("units", ()))
            told.append(f"{name} {'; '.join(error_whole(found, j) for j in range(len(rms)))}")
    return ", ".join(told)


def show(files: list[Path], web: bool | None, port: int | None, browser: bool) -> None:
    """Open the recordings; wait until the window is closed, or for Ctrl+C."""
    from flexviz.outlets.recording import has_display, show_in_window, web_viewer

    if web is None:
        web = not has_display() or port is not None or not browser
    if not web:
        failed = show_in_window(files)
        if not failed:
            return
        terminal.note(f"the Rerun window cannot be opened ({failed}); use the page")
    with web_viewer(files, port) as address:
        try:
            say(address)
            if browser:
                webbrowser.open(address)
            threading.Event().wait()
        except KeyboardInterrupt:
            terminal.note("closed")


def say(text: str) -> None:
    """Print one line at once."""
    print(text, flush=True)


def serve(
    source: Path | None = typer.Argument(
        None,
        metavar="SET|SESSION|RESULTS",
        help="Folder with measurements.toml or session.json, or of a batch's results; default: a bundled "
        "example.",
    ),
    port: int | None = typer.Option(
        None, metavar="P", help="Port to listen on; default: 8080 or the next free one."
    ),
    host: str = typer.Option(
        "127.0.0.1",
        metavar="H",
        help="Address to listen on; beyond this machine a token is needed, which is printed.",
    ),
    browser: BrowserOption = True,
    public_host: list[str] | None = typer.Option(
        None,
        metavar="NAME",
        help="Name by which a proxy before it is reached; a token is then needed, which is printed. "
        "Repeat for more.",
    ),
) -> int:
    """Show measured and identified motion side by side in the browser; Ctrl+C ends it."""
    from flexviz import STARTED
    from flexviz.outlets.app import serve as run

    names = tuple(public_host or ())
    run(source, host=host, port=port, open_browser=browser, public_host=names, since=STARTED)
    return 0
