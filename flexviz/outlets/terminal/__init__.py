"""The command line: options, messages and exit codes, no computation here.

Exit codes: 0 done, 1 ran but did not converge or missed its limits, 2 bad input or usage, 130 interrupted.
Results go to standard output, progress and messages to standard error. Commands import what they need when
they run, so that `flexviz --help` is quick.
"""

from __future__ import annotations

import atexit
import gc
import sys
from collections.abc import Sequence
from contextlib import redirect_stdout

import typer

from flexviz import __version__
from flexviz.base.errors import FlexvizError, one_line
from flexviz.outlets.terminal.analysis import diagnose, identify, record, report
from flexviz.outlets.terminal.batch import batch, study
from flexviz.outlets.terminal.compare import compare
from flexviz.outlets.terminal.design import design
from flexviz.outlets.terminal.doctor import doctor
from flexviz.outlets.terminal.effects import effects
from flexviz.outlets.terminal.export import export
from flexviz.outlets.terminal.import_ import import_
from flexviz.outlets.terminal.options import with_shared_options
from flexviz.outlets.terminal.sessions import session
from flexviz.outlets.terminal.simulate import simulate
from flexviz.outlets.terminal.verify import verify
from flexviz.outlets.terminal.viewing import review, serve

EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130

app = typer.Typer(
    help="Identify flexible-joint robots from motor-side data, and see what the identified model does.",
    add_completion=False,
    pretty_exceptions_enable=False,
)
for _command in (
    with_shared_options(identify),
    with_shared_options(diagnose),
    with_shared_options(simulate),
    with_shared_options(design),
    with_shared_options(serve),
    with_shared_options(record),
    review,
    import_,
    with_shared_options(export),
    with_shared_options(effects),
    with_shared_options(report),
    with_shared_options(compare),
    with_shared_options(verify),
    with_shared_options(session),
    with_shared_options(batch, own_effects=False),
    with_shared_options(study, own_effects=False),
    doctor,
):
    app.command(_command.__name__.rstrip("_"))(_command)


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: bool = typer.Option(False, "--version", help="Print the version and exit."),
) -> None:
    if version:
        print(f"flexviz {__version__}")
        raise typer.Exit()
    if context.invoked_subcommand is None:
        with redirect_stdout(sys.stderr):  # typer prints its help to standard output
            typer.echo(context.get_help())
        raise typer.Exit(EXIT_BAD_INPUT)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command (by default that of `sys.argv`) and return its exit code."""
    # searching what is left at the end for garbage would take longer than ending
    atexit.register(gc.freeze)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]  # a C locale has no θ
    try:
        code = app(args=arguments, prog_name="flexviz", standalone_mode=False)
    except FlexvizError as error:
        return _fail(str(error), error.exit_code)
    except typer.TyperException as error:
        return _fail(error.format_message(), EXIT_BAD_INPUT)
    except (KeyboardInterrupt, typer.Abort):
        return _fail("interrupted", EXIT_INTERRUPTED)
    except BrokenPipeError:
        raise
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _fail(f"{where}{error.strerror or error}", EXIT_BAD_INPUT)
    return int(code or 0)


def _fail(message: str, code: int) -> int:
    print(f"flexviz: {one_line(message)}", file=sys.stderr)
    return code
