"""τ without the torque of gravity, that of payloads left in or out; and nothing but gravity."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from flexviz.checks.faults import Case, Fault, hypothesis


@hypothesis
def gravity(case: Case) -> Iterator[Fault]:
    if not (case.now.gravity and case.now.motion):
        return

    def move(name: str, **lacking: bool) -> Fault:
        values = {"lacks": tuple(lacking)}
        return Fault("gravity", case.every, "tau", lambda now: replace(now, **lacking), name, values=values)  # type: ignore[arg-type]

    yield move("none", gravity=False, load=False)
    if any(case.now.bodies):
        yield move("payload", gravity=False)
    yield move("only", motion=False)
