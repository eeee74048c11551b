"""Read a measurement set: `measurements.toml`, the robot, and one table per group."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np

from flexviz import toml
from flexviz.errors import FlexvizError, InputError, choose_from
from flexviz.measurements.bridging import Bridged
from flexviz.measurements.data import OPTIONAL_SIGNALS, Array, Group, MeasurementSet, present_fingerprint
from flexviz.measurements.schema import Body, GroupEntry, SetHeader, locate, parse
from flexviz.measurements.segments import SHORTEST, Segmented, check_time, make_segments
from flexviz.measurements.tables import column_names, read_columns, require
from flexviz.measurements.unit_checks import UnitCheck, check_optional
from flexviz.robot import PayloadBody, Robot, is_library_robot
from flexviz.wording import plural

TRUTH = "truth.json"  # present in simulated sets; never opened here
LARGEST_BODY = 10.0  # [m] payloads beyond this size or distance can only be in a wrong unit

log = logging.getLogger("flexviz.measurements")


def read_set(path: str | Path, *, logged: bool = True) -> MeasurementSet:
    """Read and check the measurement set in the folder `path` (or whose `measurements.toml` it is).

    Anything wrong is one InputError that names file and place; oddities are kept in
    `MeasurementSet.warnings`, and logged unless not `logged`.
    """
    file = locate(path)
    content = parse(toml.read(file), file)
    folder = file.resolve().parent
    if not is_library_robot(content.robot):
        inside(folder, content.robot, file, "robot")
    robot = read_robot(content.robot, content.joints, folder, file)
    payloads = read_payloads(content, robot, file)
    warnings: list[str] = []

    def warn(text: str) -> None:
        warnings.append(text)
        if logged:
            log.warning("%s", text)

    users: dict[Path, str] = {}  # table -> the first group that uses it
    paths = []
    for i, group in enumerate(content.groups):
        paths.append(inside(folder, group.file, file, f'group {i + 1} "{group.name}", file'))
        if (first := users.setdefault(paths[-1], group.name)) != group.name:
            warn(f'{paths[-1]}: groups "{first}" and "{group.name}" use the same file')
    for note in robot.notes:
        warn(f"{content.robot}: {note}")
    stiffness = values(content.initial.stiffness)
    clocks: dict[Path, Segmented] = {}
    files = present_fingerprint(folder, robot, paths)
    groups = tuple(
        read_group(entry, table, robot, payloads[entry.payload], stiffness, warn, clocks)
        for entry, table in zip(content.groups, paths, strict=True)
    )
    groups = without_scraps(groups, warn)
    if changed := present_fingerprint(folder, robot, paths).changes_since(files):
        raise InputError(f"{', '.join(changed)} changed while the set was read", file=file)
    check_signals(groups, file)
    for text in clock_warnings(clocks):
        warn(text)
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
        files_read=files,
        date=content.date,
    )


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


def inside(folder: Path, name: str, file: Path, place: str) -> Path:
    """The file `name` in `folder`; InputError when it lies outside (also by a link) or does not exist."""
    try:
        path = (folder / name).resolve()
        if Path(name).is_absolute() or not path.is_relative_to(folder):
            message = f'"{name}" lies outside the set\'s folder, expected a path inside it'
            raise InputError(message, file=file, place=place)
        if not path.is_file():
            raise InputError(f'"{name}" does not exist in the set\'s folder', file=file, place=place)
    except (OSError, ValueError, RuntimeError) as error:
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or error
        raise InputError(f'"{name}" is not a usable path ({reason})', file=file, place=place) from None
    return path


def read_robot(source: str, joints: Sequence[str] | None, folder: Path, file: Path) -> Robot:
    """The robot with these joints; a path is relative to `folder`, errors name `file`, which asks for it."""
    try:
        return Robot.load(source, joints, base=folder)
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
    file: Path,
    robot: Robot,
    bodies: tuple[PayloadBody, ...],
    stiffness: Array | None,
    warn: Callable[[str], None],
    clocks: dict[Path, Segmented],
) -> Group:
    """Read and check one group's table; what was done to its clock is added to `clocks`."""
    n, joints = robot.n, robot.joints
    present = column_names(file)
    needed = [f"{kind}_{joint}" for kind in ("theta", "tau") for joint in joints]
    require(present, ["time", *needed], file)
    # a joint called joint_1 has tau_joint_1: not the torque sensor of a joint called 1
    places = {f"{kind}_{joint}": (kind, j) for kind in OPTIONAL_SIGNALS for j, joint in enumerate(joints)}
    optional = [name for name in places if name in present and name not in needed]
    table = read_columns(file, ["time", *needed, *optional])
    time, signals = table[:, 0], table[:, 1 : 1 + 2 * n]  # θ of every joint, then τ of every joint
    check_time(time, file)

    def warn_here(text: str) -> None:
        warn(f"{file}: {text}")

    units = UnitCheck(robot, bodies, time, signals[:, :n], signals[:, n:], file, warn_here)
    units.check_time()
    units.check_theta()
    units.check_tau(stiffness)
    for name, column in zip(needed, signals.T, strict=True):
        if column[0] == column[-1] and np.ptp(column) == 0.0:
            warn_here(f"column {name} never changes")
    for name in sorted({*present} - {"time", *needed, *optional}):
        if name.startswith(("theta_", "tau_", "q_")):
            meant = choose_from(name, ["time", *needed, *optional])
            warn_here(f"column {name} belongs to no joint of the set and is not used; {meant}")
    compared: dict[str, Array] = {}  # NaN for joints without such a column
    for name, column in zip(optional, table.T[1 + 2 * n :], strict=True):
        kind, j = places[name]
        measured = signals[:, n + j] if kind == "tau_joint" else signals[:, j]
        check_optional(name, column, measured, file, warn_here)
        if kind not in compared:
            compared[kind] = np.full((n, len(column)), np.nan).T
        compared[kind][:, j] = column
    clocks[file] = found = make_segments(time, signals, n)
    if found.dropped and found.segments:
        warn_here(f"{found.dropped} samples in stretches of fewer than {SHORTEST} between gaps are not used")
    if found.filled or found.jitters:
        time = time.copy()  # so that the table can be forgotten
    names = entry.name, entry.trajectory, entry.payload
    degrees = temperatures(entry.temperature, n)
    return Group(
        *names, bodies, entry.validation, file, found.segments, time, **compared, temperature=degrees
    )


def without_scraps(groups: tuple[Group, ...], warn: Callable[[str], None]) -> tuple[Group, ...]:
    """The groups without those that gaps leave nothing of; InputError if nothing is left to fit."""
    nothing = [group for group in groups if not group.segments]
    message = f"no stretch without a gap has {SHORTEST} samples or more"
    if nothing and all(group.validation or not group.segments for group in groups):
        raise InputError(f"{message}, expected at least one", file=nothing[0].file)
    for group in nothing:
        warn(f'{group.file}: {message}: group "{group.name}" is left out')
    return tuple(group for group in groups if group.segments)


def check_signals(groups: Sequence[Group], file: Path) -> None:
    """InputError if nothing moves, or no torque acts, in any group."""
    for name, what in (("theta", "no joint moves"), ("tau", "no torque changes")):
        if not any(np.ptp(getattr(s, name), axis=0).any() for group in groups for s in group.segments):
            message = f"{what}: every column {name}_<joint> is constant, expected recorded motion"
            raise InputError(message, file=file, place="groups")


def clock_warnings(clocks: Mapping[Path, Segmented]) -> list[str]:
    """What was done to the clocks of the tables, one sentence for all that share it."""
    jittering = [file for file, found in clocks.items() if found.jitters]
    filled = {file: found.filled for file, found in clocks.items() if found.filled}
    warnings = []
    if jittering:
        warnings.append(
            f"{listed(jittering)}: the time jitters: the signals were resampled to a uniform step"
        )
    if filled:
        count = sum(filled.values())
        what = "1 single missing sample was" if count == 1 else f"{count} single missing samples were"
        warnings.append(f"{listed(list(filled))}: {what} interpolated")
    for file, found in clocks.items():
        if (gaps := found.gaps) is not None and gaps.count:
            warnings.append(f"{file}: {gap_text(gaps)}")
    return warnings


def gap_text(gaps: Bridged) -> str:
    """What was done to the gaps of a table."""
    were = "was" if gaps.count == 1 else "were"
    text = (
        f"{plural(gaps.count, 'gap')} of up to {1e3 * gaps.longest:.3g} ms, short against the content of the "
    )
    text += f"signals, {were} interpolated"
    left = f"; longer gaps, {gaps.left} of up to {1e3 * gaps.longest_left:.3g} ms, split it"
    return text + (left if gaps.left else "")


def listed(files: Sequence[Path]) -> str:
    """The first file in full, and how many more there are."""
    return str(files[0]) + (f" and {len(files) - 1} more" if len(files) > 1 else "")
