"""Read and check the robot, the payloads and the groups of a measurement set, from files or arrays."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from flexviz.base.errors import FlexvizError, InputError, choose_from
from flexviz.base.facts import Fact
from flexviz.data.measurements.data import OPTIONAL_SIGNALS, Array, Group
from flexviz.data.measurements.drive import Drive, check_goals
from flexviz.data.measurements.schema import Body, GroupEntry, SetHeader
from flexviz.data.measurements.segments import SHORTEST, Segmented, check_time, make_segments
from flexviz.data.measurements.tables import Table, require
from flexviz.data.measurements.time_units import check_time_unit
from flexviz.robot.mounting import GRAVITY
from flexviz.robot.robot import PayloadBody, Robot

LARGEST_BODY = 10.0  # [m] payloads beyond this size or distance can only be in a wrong unit
HEAVIEST_BODY = 3.0  # times the robot's moving mass; no arm carries more
COMPARED = 1000  # samples, of which no two recordings have all in common


def values(numbers: list[float] | None) -> Array | None:
    """A list of the file as a read-only array."""
    if numbers is None:
        return None
    array = np.array(numbers, dtype=float)
    array.setflags(write=False)
    return array


def temperatures(numbers: list[float] | None, n: int) -> Array | None:
    """A group's temperatures, one per joint, from one per joint or one for all."""
    return values(numbers * n if numbers and len(numbers) == 1 else numbers)


def read_robot(
    source: str,
    joints: Sequence[str] | None,
    folder: Path,
    file: Path,
    gravity: Sequence[float] = GRAVITY,
) -> Robot:
    """The robot with these joints; a path is relative to `folder`, errors name `file`, which asks for it."""
    try:
        return Robot.load(source, joints, folder, gravity)
    except InputError as error:
        if any(f'joint "{joint}"' in error.message for joint in joints or ()):
            raise InputError(error.message, file=file, place="joints") from None
        where = ", ".join(part for part in (source, error.place) if part)
        raise InputError(f"{where}: {error.message}", file=file, place="robot") from None
    except FlexvizError:
        raise
    except Exception as error:  # whatever a broken robot description makes the libraries raise
        raise InputError(f'"{source}" cannot be used as a robot: {error}', file=file, place="robot") from None


def read_payloads(content: SetHeader, robot: Robot, file: Path) -> dict[str, tuple[PayloadBody, ...]]:
    """Name of each payload -> its bodies, checked."""
    return {
        name: tuple(
            read_body(body, robot, file, f"payloads.{name}.bodies, entry {i + 1}")
            for i, body in enumerate(payload.bodies)
        )
        for name, payload in content.payloads.items()
    }


def read_body(body: Body, robot: Robot, file: Path, place: str) -> PayloadBody:
    """A payload's body, its link and inertia checked."""

    def refuse(key: str, message: str) -> NoReturn:
        raise InputError(message, file=file, place=f"{place}{key}")

    if body.link not in robot.links:
        refuse("", f'link "{body.link}" does not exist; {choose_from(body.link, robot.links)}')
    own = float(np.sum(robot.cad_parameters[:, 0]))
    if body.mass > HEAVIEST_BODY * own > 0.0:
        refuse(", mass", f"{body.mass:g} on a robot of {own:.3g} kg: is it in grams? expected kg")
    result = PayloadBody(body.link, body.mass, body.com, body.inertia)
    moments = np.linalg.eigvalsh(result.inertia_matrix)
    size = float(np.max(np.abs(moments)))
    expected = "expected Ixx Iyy Izz Ixy Ixz Iyz [kg m²] about the body's own centre of mass"
    if moments[0] < -1e-9 * size:
        found = ", ".join(f"{moment:.4g}" for moment in moments)
        refuse(", inertia", f"no body has the principal moments {found}; {expected}")
    if body.mass > 0.0 and size > body.mass * LARGEST_BODY**2:
        refuse(", inertia", f"{size:g} kg m² needs a body larger than {LARGEST_BODY:g} m; {expected}")
    if float(np.linalg.norm(body.com)) > LARGEST_BODY:
        refuse(", com", f"{body.com} is over {LARGEST_BODY:g} m from the link, expected metres")
    return result


def read_group(
    entry: GroupEntry,
    source: Table,
    robot: Robot,
    bodies: tuple[PayloadBody, ...],
    warn: Callable[[Fact], None],
    clocks: dict[Path, Segmented],
    no_torque: Sequence[str] = (),
    drive: Drive | None = None,
) -> Group:
    """Read and check one group; what was done to its clock is added to `clocks`.

    τ of the joints in `no_torque` is not read: it is zero. With a `drive` it is how far the goal is ahead.
    """
    n, joints, file, present = robot.n, robot.joints, source.file, source.names
    signal = [("theta", joint) for joint in joints]
    signal += [("theta_ref" if drive else "tau", joint) for joint in joints if joint not in no_torque]
    needed = [f"{kind}_{joint}" for kind, joint in signal]
    require(present, ["time", *needed], file)
    # a joint called joint_1 has tau_joint_1: not the torque sensor of a joint called 1
    places = {f"{kind}_{joint}": (kind, j) for kind in OPTIONAL_SIGNALS for j, joint in enumerate(joints)}
    taken = {*needed, *(f"tau_{joint}" for joint in joints)}
    optional = [name for name in places if name in present and name not in taken]
    table = source.read(["time", *needed, *optional])
    time, others = table[:, 0], table[:, 1 + len(needed) :]
    places_of = [joints.index(joint) + n * (kind != "theta") for kind, joint in signal]
    signals = spread_out(table[:, 1 : 1 + len(needed)], places_of, 2 * n)
    check_time(time, file)
    goals, signals = (None, signals) if drive is None else with_lead(signals, joints, file)

    def warn_here(fact: Fact) -> None:
        warn(replace(fact, file=str(file)))

    for fact in check_time_unit(time, signals[:, :n], file):
        warn_here(fact)
    for name, column in zip(needed, signals.T[places_of], strict=True):
        if column[0] == column[-1] and np.ptp(column) == 0.0:
            warn_here(Fact("constant-column", "odd", columns=(name,)))
    used = ("time", *needed, *optional)
    for name in unused_columns({*present} - {f"tau_{joint}" for joint in no_torque}, used):
        warn_here(Fact("unused-column", "odd", columns=(name,), values={"used": used}))
    compared = by_kind([places[name] for name in optional], others, n) | named(theta_ref=goals)
    clocks[file] = found = make_segments(time, signals, n)
    if found.dropped and found.segments:
        warn_here(Fact("samples-not-used", "odd", values={"count": found.dropped, "least": SHORTEST}))
    if found.filled or found.jitters:
        time = time.copy()  # so that the table can be forgotten
    return Group(
        entry.name, entry.trajectory, entry.payload, bodies, entry.validation, file, found.segments, time,
        **compared, temperature=temperatures(entry.temperature, n), kp_scale=entry.kp_scale,
    )  # fmt: skip


def named(**signals: Array | None) -> dict[str, Array]:
    """Those that there are."""
    return {name: signal for name, signal in signals.items() if signal is not None}


def with_lead(signals: Array, joints: Sequence[str], file: Path) -> tuple[Array, Array]:
    """The goals (N, n) among θ and goals (N, 2n), checked; θ, and how far they are ahead, (N, 2n)."""
    theta, goals = signals[:, : len(joints)], signals[:, len(joints) :]
    check_goals(goals, theta, joints, file)
    return goals, np.concatenate((theta, goals - theta), axis=1)


def by_kind(places: Sequence[tuple[str, int]], columns: Array, n: int) -> dict[str, Array]:
    """Kind of signal -> its columns (N, n), NaN for joints without one; `places`: kind and joint of each."""
    out: dict[str, Array] = {}
    for (kind, j), column in zip(places, columns.T, strict=True):
        out.setdefault(kind, np.full((n, len(column)), np.nan).T)[:, j] = column
    return out


def spread_out(columns: Array, places: Sequence[int], count: int) -> Array:
    """Columns at their places among `count`, zero elsewhere; not copied if they are all of them."""
    if len(places) == count:
        return columns
    whole = np.zeros((len(columns), count))
    whole[:, places] = columns
    return whole


def unused_columns(present: set[str], used: Sequence[str]) -> list[str]:
    """Columns that look like those of a joint, but are not used."""
    return sorted(name for name in present - {*used} if name.startswith(("theta_", "tau_", "q_")))


def without_scraps(groups: tuple[Group, ...], warn: Callable[[Fact], None]) -> tuple[Group, ...]:
    """The groups without those that gaps leave nothing of; InputError if nothing is left to fit."""
    nothing = [group for group in groups if not group.segments]
    if not groups:
        raise InputError("every group holds a static test, expected a motion as well", place="groups")
    if nothing and all(group.validation or not group.segments for group in groups):
        raise InputError(
            f"no stretch without a gap has {SHORTEST} samples or more, expected at least one",
            file=nothing[0].file,
        )
    for group in nothing:
        values = {"least": SHORTEST}
        warn(Fact("group-too-short", "odd", groups=(group.name,), values=values, file=str(group.file)))
    return tuple(group for group in groups if group.segments)


def check_signals(groups: Sequence[Group], file: Path) -> None:
    """InputError if nothing moves, or no torque acts, in any group."""
    for name, what in (("theta", "no joint moves"), ("tau", "no torque changes")):
        if not any(np.ptp(getattr(s, name), axis=0).any() for group in groups for s in group.segments):
            message = f"{what}: every column {name}_<joint> is constant, expected recorded motion"
            raise InputError(message, file=file, place="groups")


def copies(groups: Sequence[Group]) -> Iterator[Fact]:
    """Groups with the same samples, which count twice or confirm themselves."""
    seen: dict[bytes, Group] = {}
    for group in groups:
        longest = max(group.segments, key=len)
        samples = b"".join(signal[:COMPARED].tobytes() for signal in (longest.theta, longest.tau))
        if (first := seen.setdefault(hashlib.sha256(samples).digest(), group)) is not group:
            yield Fact("same-samples", "odd", groups=(first.name, group.name), file=str(group.file))


def clock_facts(clocks: Mapping[Path, Segmented]) -> Iterator[Fact]:
    """What was done to the clocks of the tables, one fact for all that share it."""
    if jittering := tuple(str(file) for file, found in clocks.items() if found.jitters):
        yield Fact("time-jitters", "odd", values={"files": jittering})
    if filled := {str(file): found.filled for file, found in clocks.items() if found.filled}:
        yield Fact("samples-filled", "odd", values={"files": tuple(filled), "count": sum(filled.values())})
    for file, found in clocks.items():
        if (gaps := found.gaps) is not None and gaps.count:
            values = {"count": gaps.count, "longest": gaps.longest, "left": gaps.left}
            values |= {"longest_left": gaps.longest_left} if gaps.left else {}
            yield Fact("gaps-bridged", "odd", values=values, file=str(file))
