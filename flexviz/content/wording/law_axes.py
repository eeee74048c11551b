"""Axes on which the laws of effects are drawn."""

from __future__ import annotations

VARIABLES = {
    "velocity": "motor velocity",
    "position": "motor angle",
    "angle within a cycle": "motor angle within one cycle",
    "load": "size of the transmitted torque",
    "path since reversal": "path since the last reversal",
    "path since rest": "path since the last standstill",
    "warming time": "time in the group",
    "velocity per degree": "motor velocity",
    "recorded torque": "recorded torque",
    "recorded torque's rate": "rate of the recorded torque",
    "torque": "transmitted torque",
    "torque's rate": "rate of the transmitted torque",
    "link velocity": "link velocity",
    "link position": "link angle",
    "payload's torque": "torque of the payload as stated",
    "law": "torque by the law",
    "time": "time in the group",
    "neighbour's acceleration": "acceleration of the neighbouring motor",
    "sum of velocities": "sum of both motors' velocities",
}  # name of a `LawVariable` -> label
QUANTITIES = {"friction per degree": "friction per degree below 20 °C"}


def law_axes(variable: str, quantity: str, joint: str) -> tuple[str, str]:
    """Labels of both axes; those of older sessions are labels already."""
    across = f"{VARIABLES[variable]} of {joint}" if variable in VARIABLES else variable
    return across, QUANTITIES.get(quantity, quantity)
