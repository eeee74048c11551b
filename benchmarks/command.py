"""A function as a command line, by typer."""

from __future__ import annotations

import functools
import inspect
import sys
from collections.abc import Callable, Container, Sequence
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import typer


def command(work: Callable[..., int | None]) -> Callable[..., int]:
    """A function that reads the arguments of `work` from a command line and returns its exit code.

    Keyword-only arguments are options, the others are positional; a text in `Annotated` is the help of an
    argument, names behind it are what may be in its list; the docstring of the module is the help of the
    command. 2: a bad command line, 130: interrupted.
    """
    hints = get_type_hints(work, include_extras=True)
    signature, parameters = inspect.signature(work), []
    for one in signature.parameters.values():
        kind, *said = (
            get_args(hints[one.name]) if get_origin(hints[one.name]) is Annotated else [hints[one.name]]
        )
        told: dict[str, Any] = {"help": said[0]} if said else {}
        if len(said) > 1:
            told = {"help": f"{said[0]}: {', '.join(said[1])}", "callback": among(said[1])}
        name = f"--{one.name.rstrip('_').replace('_', '-')}"
        declared = typer.Option(name, **told) if one.kind is one.KEYWORD_ONLY else typer.Argument(**told)
        parameters.append(one.replace(annotation=Annotated[kind, declared]))

    @functools.wraps(work)
    def called(**given: Any) -> int:
        return int(work(**given) or 0)

    called.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {one.name: one.annotation for one in parameters}
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    said = inspect.getdoc(inspect.getmodule(work)) or ""
    # a paragraph that begins with \b keeps its lines, as lists do
    text = "\n\n".join(f"\b\n{part}" if part.startswith("    ") else part for part in said.split("\n\n"))
    app.command(help=text)(called)

    def main(words: Sequence[str] | None = None) -> int:
        try:
            return int(app(words, standalone_mode=False) or 0)
        except typer.TyperException as error:
            print(error.format_message(), file=sys.stderr)
            return 2
        except (KeyboardInterrupt, typer.Abort):
            print("interrupted; what is done is kept", file=sys.stderr)
            return 130

    return main


def among(names: Container[str]) -> Callable[[list[str]], list[str]]:
    """A check of an option that may be given several times: each has to be one of these names."""

    def checked(given: list[str]) -> list[str]:
        for one in given:
            if one not in names:
                raise typer.BadParameter(f'"{one}" does not exist')
        return given

    return checked
