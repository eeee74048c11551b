"""`flexviz design ROBOT|SET --out DIR`: which motions and payloads to record."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.base.errors import InputError
from flexviz.outlets.terminal import terminal
from flexviz.outlets.terminal.options import GravityOption, stated_gravity
from flexviz.outlets.terminal.terminal import Reporter, interruptible

if TYPE_CHECKING:
    from flexviz.analysis.designing import DesignSettings
    from flexviz.model.simulation import Plan


def design(
    robot: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT|SET", help="A robot's .urdf, a preset of simulate, or the folder of a set."
        ),
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="New folder for the references and the summary.")],
    parameter: list[str] | None = typer.Option(
        None,
        metavar="NAME[:joint]",
        help="Minimise its standard error; repeat for more. Default: stiffness, motor inertia, friction.",
    ),
    separate: list[str] | None = typer.Option(
        None,
        metavar="EFFECT[:place]",
        help="Tell this effect from another one instead: give it twice, once for each.",
    ),
    effect: list[str] | None = typer.Option(
        None, metavar="NAME[:place]", help="Add an effect to the model; repeat for more."
    ),
    settings: Path | None = typer.Option(
        None, metavar="FILE.toml", help="Payloads, limits of the motion, settings of the search."
    ),
    groups: int | None = typer.Option(None, metavar="N", help="How many. Default: 3; to separate: 1."),
    duration: float | None = typer.Option(None, metavar="S", help="Seconds of each group. Default: 10."),
    floor: float | None = typer.Option(None, metavar="Z", help="Minimum height of the tool in metres."),
    beside: bool | None = typer.Option(
        None,
        "--beside/--alone",
        help="Count the groups that the set has already. Default: only with --separate.",
    ),
    static: bool = typer.Option(
        False, "--static", help="A static test for stiffness instead: pushes against a clamp, and weights."
    ),
    gravity: GravityOption = None,
    seed: int = typer.Option(0, metavar="N", min=0, help="Seed of the search."),
) -> int:
    """Choose motions and payloads from which parameters, or a missing effect, are learned best."""
    with Reporter(f"reading {robot}") as report:
        from flexviz.analysis.designing import design as search
        from flexviz.analysis.designing import design_facts, settings_from, write_design
        from flexviz.data.measurements import check_free

        check_free(out)
        groups = 1 if groups is None and separate and settings is None else groups
        chosen = settings_from(settings, {"groups": groups, "duration": duration}, floor)
        subject = mounted(robot, stated_gravity(gravity))
        if static:
            return _static(subject, effect or (), chosen, settings, seed, out, report)
        with interruptible("the best groups so far are kept") as should_stop:
            found = search(
                subject, parameters=parameter or (), separate=separate or (), effects=effect or (),
                settings=chosen, settings_file=settings, beside=beside, seed=seed, progress=report,
                should_stop=should_stop,
            )  # fmt: skip
            write_design(found, out)
    plan, expected = design_facts(found)
    terminal.print_lines([f"{plan}\n\n{expected}", f"written to {out}"])
    return 130 if found.stopped else 0


def _static(
    robot: str | Plan,
    effects: list[str] | tuple[str, ...],
    settings: DesignSettings,
    file: Path | None,
    seed: int,
    out: Path,
    report: Reporter,
) -> int:
    """A static test instead of motions."""
    from flexviz.analysis.designing import design_static, static_fact, subject_of, write_static

    with interruptible("nothing is written") as should_stop:
        subject = subject_of(robot, effects, progress=report, should_stop=should_stop)
    found = design_static(subject, settings, seed, file)
    write_static(found, out)
    terminal.print_lines([static_fact(found).text, f"written to {out}"])
    return 0


def mounted(robot: str, gravity: tuple[float, float, float] | None) -> str | Plan:
    """A robot that is known by its URDF or as a preset, under this gravity [m/s²]; None: as it is."""
    if gravity is None:
        return robot
    from flexviz.model.simulation import make_plan

    if Path(robot).is_dir():
        raise InputError("--gravity applies to a URDF or preset, but a set states its own", file=robot)
    return make_plan(robot, gravity=gravity)
