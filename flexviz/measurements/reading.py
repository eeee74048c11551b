"""Read a measurement set: `measurements.toml`, the robot, and one table a group."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np

from flexviz.errors import FlexvizError, InputError, choose_from
from flexviz.measurements import plausibility
from flexviz.measurements.data import Array, Group, MeasurementSet
from flexviz.measurements.schema import Body, GroupEntry, MeasurementFile, locate, read_file
from flexviz.measurements.segments import SHORTEST, check_time, make_segments
from flexviz.measurements.tables import column_names, read_columns, require
from flexviz.robot import PayloadBody, Robot

OPTIONAL = ("q", "tau_joint", "theta_ref")
TRUTH = "truth.json"  # its presence says that the set is simulated; it is never opened here

log = logging.getLogger("flexviz.measurements")


def read_set(path: str | Path) -> MeasurementSet:
    """Read and check the measurement set in the folder `path` (or whose `measurements.toml` it is).

    Whatever is wrong is one InputError that names file and place. What only looks odd is logged and kept in
    `MeasurementSet.warnings`.
    """
    file = locate(path)
    content = read_file(file)
    folder = file.resolve().parent
    robot = load_robot(content, file, folder)
    payloads = {
        name: tuple(
            read_body(body, robot, file, f"payloads.{name}.bodies, entry {i + 1}")
            for i, body in enumerate(p.bodies)
        )
        for name, p in content.payloads.items()
    }
    warnings: list[str] = []

    def warn(text: str) -> None:
        warnings.append(text)
        log.warning("%s", text)

    tables = [
        inside(folder, g.file, file, f'group {i + 1} "{g.name}", file') for i, g in enumerate(content.groups)
    ]
    for i, table in enumerate(tables):
        if table in tables[:i]:
            first = content.groups[tables.index(table)].name
            warn(f'{table}: groups "{first}" and "{content.groups[i].name}" use the same file')
    stiffness = values(content.initial.stiffness)
    groups = tuple(
        read_group(entry, table, robot, payloads[entry.payload], stiffness, warn)
        for entry, table in zip(content.groups, tables, strict=True)
    )
    controller = content.controller
    return MeasurementSet(
        path=folder,
        name=folder.name,
        robot=robot,
        joints=tuple(content.joints),
        torque_hold=content.torque_hold,
        initial_stiffness=stiffness,
        initial_motor_inertia=values(content.initial.motor_inertia),
        kp=values(controller.kp) if controller else None,
        kd=values(controller.kd) if controller else None,
        effects=tuple(content.model.effects),
        payloads=payloads,
        groups=groups,
        simulated=(folder / TRUTH).exists(),
        warnings=tuple(warnings),
    )


def values(numbers: list[float] | None) -> Array | None:
    """A list of the file as a read-only array."""
    if numbers is None:
        return None
    array = np.array(numbers, dtype=float)
    array.setflags(write=False)
    return array


def inside(folder: Path, name: str, file: Path, place: str) -> Path:
    """The file `name` in `folder`; InputError when it lies outside (also by a link) or does not exist."""
    try:
        path = (folder / name).resolve()
        if Path(name).is_absolute() or not path.is_relative_to(folder):
            raise InputError(
                f'"{name}" lies outside the set\'s folder, a path inside it would be right',
                file=file,
                place=place,
            )
        if not path.is_file():
            raise InputError(f'"{name}" does not exist in the set\'s folder', file=file, place=place)
    except (OSError, ValueError, RuntimeError) as error:
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or error
        raise InputError(f'"{name}" is not a usable path ({reason})', file=file, place=place) from None
    return path


def load_robot(content: MeasurementFile, file: Path, folder: Path) -> Robot:
    """The set's robot with the set's joints; a path must lie inside the folder."""
    source = content.robot
    scheme, colon, _ = source.partition(":")
    if not (colon and scheme in ("example-robot-data", "robots")):
        inside(folder, source, file, "robot")
    try:
        return Robot.load(source, content.joints, base=folder)
    except InputError as error:
        place = "joints" if any(f'joint "{joint}"' in error.message for joint in content.joints) else "robot"
        shown = f"{source}: {error.message}" if place == "robot" else error.message
        raise InputError(shown, file=file, place=place) from None
    except FlexvizError:
        raise
    except Exception as error:  # whatever a broken robot description makes the libraries raise
        raise InputError(f'"{source}" cannot be used as a robot: {error}', file=file, place="robot") from None


def read_body(body: Body, robot: Robot, file: Path, place: str) -> PayloadBody:
    """A payload's body, its link and inertia checked."""
    if body.link not in robot.links:
        raise InputError(
            f'link "{body.link}" does not exist; {choose_from(body.link, robot.links)}',
            file=file,
            place=place,
        )
    result = PayloadBody(body.link, body.mass, np.array(body.com), np.array(body.inertia))
    moments = np.linalg.eigvalsh(result.inertia_matrix)
    size = float(np.max(np.abs(moments)))
    wanted = "Ixx Iyy Izz Ixy Ixz Iyz [kg m²] about the body's own centre of mass would be right"
    if moments[0] < -1e-9 * size:
        found = ", ".join(f"{moment:.4g}" for moment in moments)
        raise InputError(
            f"no body has the principal moments {found}; {wanted}", file=file, place=f"{place}, inertia"
        )
    if body.mass > 0.0 and size > body.mass * 10.0**2:
        raise InputError(
            f"{size:g} kg m² is a body of over 10 m; {wanted}", file=file, place=f"{place}, inertia"
        )
    if float(np.linalg.norm(body.com)) > 10.0:
        raise InputError(
            f"{body.com} is over 10 m from the link, metres would be right", file=file, place=f"{place}, com"
        )
    return result


def read_group(
    entry: GroupEntry,
    file: Path,
    robot: Robot,
    bodies: tuple[PayloadBody, ...],
    stiffness: Array | None,
    warn: Callable[[str], None],
) -> Group:
    """Read and check one group's table."""
    joints, n = robot.joints, robot.n
    names = column_names(file)
    wanted = ["time", *(f"theta_{joint}" for joint in joints), *(f"tau_{joint}" for joint in joints)]
    require(names, wanted, file)
    optional = {
        kind: {
            j: f"{kind}_{joint}"
            for j, joint in enumerate(joints)
            if f"{kind}_{joint}" in set(names) - set(wanted)
        }
        for kind in OPTIONAL
    }
    chosen = wanted + [name for columns in optional.values() for name in columns.values()]
    table = read_columns(file, chosen)
    time, signals = table[:, 0], table[:, 1 : 1 + 2 * n]
    check_time(time, file)

    def warn_here(text: str) -> None:
        warn(f"{file}: {text}")

    plausibility.check_units(robot, bodies, stiffness, time, signals[:, :n], signals[:, n:], file, warn_here)
    for name, column in zip(wanted[1:], signals.T, strict=True):
        if column[0] == column[-1] and np.ptp(column) == 0.0:
            warn_here(f"column {name} never changes")
    unused = sorted(set(names) - set(chosen))
    for name in unused:
        if name.startswith(("theta_", "tau_", "q_")):
            warn_here(
                f"column {name} belongs to no joint of the set and is not used; {choose_from(name, chosen)}"
            )
    extras: dict[str, Array | None] = {}
    for kind, columns in optional.items():
        extras[kind] = np.full((n, len(time)), np.nan).T if columns else None
        for j, name in columns.items():
            column = table[:, chosen.index(name)]
            reference = signals[:, n + j] if kind == "tau_joint" else signals[:, j]
            plausibility.check_companion(name, column, reference, file, warn_here)
            extras[kind][:, j] = column  # type: ignore[index]
    segments, dropped, resampled = make_segments(time, signals, n)
    if not segments:
        raise InputError(
            f"no stretch without a gap has {SHORTEST} samples or more, at least one would be right", file=file
        )
    if dropped:
        warn_here(
            f"{dropped} samples lie in stretches of fewer than {SHORTEST} between gaps and are not used"
        )
    if resampled:
        warn_here("the time jitters: the signals were resampled to a uniform step")
        time = time.copy()  # so that the table can be forgotten
    return Group(
        name=entry.name,
        trajectory=entry.trajectory,
        payload=entry.payload,
        bodies=bodies,
        validation=entry.validation,
        file=file,
        segments=tuple(segments),
        time=time,
        **extras,
    )
