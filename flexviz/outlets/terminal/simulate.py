"""`flexviz simulate PRESET --out DIR`: measurement sets with known truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.outlets.terminal import terminal
from flexviz.outlets.terminal.options import FormatOption, GravityOption, stated_gravity

if TYPE_CHECKING:
    from flexviz.model.simulation import SimulatedSet


def simulate(
    preset: Annotated[
        str,
        typer.Argument(
            metavar="PRESET|URDF|SET",
            help="paper-a … paper-f, planar-2r, panda, a robot's .urdf, or the folder of a set to repeat.",
        ),
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder to write the set to.")],
    effect: list[str] | None = typer.Option(
        None,
        metavar="NAME[:joint][:param=value,...]",
        help="Hide an effect in the robot; repeat for more; none hides nothing.",
    ),
    start: str = typer.Option("rest", metavar="rest|moving", help="How the motion starts."),
    temperature: list[float] | None = typer.Option(
        None, metavar="T", help="Temperature [°C] that each group states, in their order; one: of all groups."
    ),
    gravity: GravityOption = None,
    compensate: Path | None = typer.Option(
        None,
        metavar="FRICTION.csv",
        help="Table of friction that the controller compensates, from export --to table; the recorded "
        "torque is without it.",
    ),
    seed: int = typer.Option(0, metavar="N", min=0, help="Seed of the measurement noise."),
    table_format: FormatOption = "parquet",
) -> int:
    """Simulate a flexible-joint robot; write its measurement set and truth.json."""
    with terminal.Reporter(f"simulating {preset}") as report:
        from flexviz.model.simulation import simulate_preset

        mounted = stated_gravity(gravity)
        terminal.check_new_folder(out, table_format)
        with terminal.interruptible("nothing is written") as should_stop:
            done = simulate_preset(
                preset,
                out,
                effect or [],
                seed,
                start,
                progress=report,
                should_stop=should_stop,
                temperatures=temperature or (),
                gravity=mounted,
                compensate=compensate,
                table_format=table_format,
            )
    terminal.print_lines(summary(done))
    return 0


def summary(done: SimulatedSet) -> list[str]:
    """Summary of the written set, as lines of text."""
    from flexviz.content.wording import temperature_text, unit_text
    from flexviz.model.effects import EFFECTS

    plan = done.plan
    lines = [f"{plan.robot.source}: {note}" for note in plan.robot.notes]
    lines += [f"{done.folder}: {plan.name}, seed {done.seed}"]
    for group in plan.groups:
        use = "validation" if group.validation else "fit"
        about = (f"{group.duration:g} s", temperature_text(group.temperature), use)
        parts = filter(None, (group.trajectory, group.payload, *about))
        lines.append(f"  {group.name}: {', '.join(parts)}")
    sliding = {joint for joint, one in zip(plan.robot.joints, plan.robot.prismatic, strict=True) if one}
    for effect in plan.model.effects:
        units = EFFECTS[effect.effect].units_on(effect.joint in sliding)
        values = ", ".join(
            f"{name} {value:g} {unit_text(units[name])}".rstrip() for name, value in effect.parameters.items()
        )
        place = effect.joint or effect.payload or "all joints"
        lines.append(f"  hidden: {effect.effect} on {place}: {values}")
    return lines
