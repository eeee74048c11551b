"""States of joints in MCAP files, ROS 2 bags (folders, .db3) and ROS 1 bags.

`rosbags` reads all of these without a ROS installation. JointState is the same in every ROS release, so its
definition need not be in the bag. Other types whose name says "State" or "Feedback" are read by the
definition in the bag (see `messages`); the rest is never decoded.

A column of a JointState is called `<topic>/<joint>/<position|velocity|effort>`. Joints that always come in
the same messages share a table: where two drivers publish on one topic, each has its own.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from flexviz.base.errors import InputError, require_extra
from flexviz.base.progress import Progress
from flexviz.data.logs.formats.base import (
    EMPTY_FIELD,
    LOGGED,
    SHORTEST,
    STAMP,
    Log,
    LogFormat,
    LogTable,
    ReadOptions,
    check_stop,
)
from flexviz.data.logs.formats.messages import DEFINITIONS, TopicNumbers
from flexviz.data.measurements import Array, readable

JOINT_STATE = "sensor_msgs/msg/JointState"
OTHER_STATES = re.compile(r"/msg/\w*(State|Feedback|States)$")
NOT_OF_JOINTS = re.compile(r"^(sensor|nav|geometry|lifecycle|diagnostic|tf2|action|controller_manager)_msgs/")
FIELDS = ("position", "velocity", "effort")
CHECK_EVERY = 2000  # messages between two reports of progress and looks at should_stop


@dataclass
class MessageGroup:
    """The messages of one topic with the same joints in the same order."""

    names: tuple[str, ...]
    rows: list[int] = field(default_factory=list)  # which message of the topic
    stamp: list[int] = field(default_factory=list)  # [ns]
    logged: list[int] = field(default_factory=list)  # [ns]
    values: dict[str, list[Array]] = field(default_factory=lambda: {name: [] for name in FIELDS})


def read_bag(path: Path, options: ReadOptions) -> Log:
    """Every JointState topic of a bag."""
    first = path.suffix == ".bag"
    kind = "ROS 1 bag" if first else "MCAP" if path.suffix == ".mcap" else "ROS 2 bag"
    require_extra("rosbags", "reading MCAP files and ROS bags")
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

    with readable(path, "bag"), Reader1(path) if first else Reader2(path) as reader:
        every = [c for c in reader.connections if is_state(c)]
        states = [c for c in every if wants_topic(options, c.topic)] or [
            c
            for c in every
            if c.msgtype == JOINT_STATE  # whose faults are named
        ]
        if not states:
            topics = sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})
            present = ", ".join(topics[:8]) + (", …" if len(topics) > 8 else "") or "no topics"
            raise InputError(
                f"no topic holds {JOINT_STATE} or another state of joints; the bag has {present}", file=path
            )
        collected, others, unusable = collect(reader, states, first, path, options)
    tables, notes = list[LogTable](), list[str]()
    for topic, groups in collected.items():
        tables += tables_of(topic, list(groups.values()), unusable, notes)
    tables += [table_of(topic, notes) for topic in others if len(topic.rows) >= SHORTEST]
    if not any(table.rows for table in tables):
        short = "; ".join(f"{name}: {why}" for name, why in list(unusable.items())[:3])
        raise InputError(f"no joint has {SHORTEST} messages or more ({short or 'no messages'})", file=path)
    return Log(path, kind, tuple(tables), unusable, tuple(notes))


def is_state(connection: Any) -> bool:
    """Whether a topic's type is JointState, or by its name another state of joints."""
    kind = connection.msgtype
    return kind == JOINT_STATE or bool(OTHER_STATES.search(kind) and not NOT_OF_JOINTS.match(kind))


def wants_topic(options: ReadOptions, topic: str) -> bool:
    return options.wanted is None or any(name.startswith(f"{topic}/") for name in options.wanted)


def collect(
    reader: Any, states: Sequence[Any], first: bool, path: Path, options: ReadOptions
) -> tuple[dict[str, dict[tuple[str, ...], MessageGroup]], list[TopicNumbers], dict[str, str]]:
    """JointStates: topic -> names in a message -> those messages; the other topics; why some are not read."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
    decode = store.deserialize_ros1 if first else store.deserialize_cdr
    unusable = {c.topic: why for c in states if (why := define(store, c))}
    states = [c for c in states if c.topic not in unusable]
    topics: dict[str, dict[tuple[str, ...], MessageGroup]] = {
        c.topic: {} for c in states if c.msgtype == JOINT_STATE
    }
    others = {c.topic: TopicNumbers(c.topic) for c in states if c.msgtype != JOINT_STATE}
    seen = dict.fromkeys(topics, 0)
    total = max(1, sum(c.msgcount for c in states))
    messages: Any = reader.messages(states) if states else ()
    for number, (connection, logged, raw) in enumerate(messages):
        if number % CHECK_EVERY == 0:
            options.progress(Progress(f"reading {path.name}", min(1.0, number / total)))
            check_stop(options.should_stop)
        if connection.topic not in topics:
            try:
                if connection.topic in others:
                    others[connection.topic].add(decode(raw, connection.msgtype), logged)
            except Exception as error:  # whatever a definition that does not fit makes the decoder raise
                del others[connection.topic]
                unusable[connection.topic] = f"its {connection.msgtype} is not readable ({str(error)[:80]})"
            continue
        message: Any = decode(raw, JOINT_STATE)
        names = tuple(message.name)
        group = topics[connection.topic].setdefault(names, MessageGroup(names))
        group.rows.append(seen[connection.topic])
        seen[connection.topic] += 1
        group.stamp.append(message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec)
        group.logged.append(logged)
        for name in FIELDS:
            group.values[name].append(getattr(message, name))
    return topics, list(others.values()), unusable


def define(store: Any, connection: Any) -> str:
    """Make a topic's type known to the store; why that is not possible, or ""."""
    from rosbags.typesys import get_types_from_idl, get_types_from_msg

    if connection.msgtype in store.fielddefs:
        return ""
    text = getattr(connection.msgdef, "data", "")
    try:
        if text:
            idl = "IDL" in str(connection.msgdef.format)
            types = get_types_from_idl(text) if idl else get_types_from_msg(text, connection.msgtype)
        else:
            types = {}
            for name, definition in DEFINITIONS.items():
                types |= get_types_from_msg(definition, name)
        store.register({name: fields for name, fields in types.items() if name not in store.fielddefs})
    except Exception as error:  # whatever a damaged definition makes the parser raise
        return f"the definition of {connection.msgtype} cannot be read ({str(error)[:80]})"
    known = connection.msgtype in store.fielddefs
    return "" if known else f"the bag does not define {connection.msgtype}"


def table_of(topic: TopicNumbers, notes: list[str]) -> LogTable:
    """The table of a topic of another type than JointState."""
    stamps, logged = f"{topic.name}/{STAMP}", f"{topic.name}/{LOGGED}"
    times = {stamps: np.array(topic.stamp, np.int64), logged: np.array(topic.logged, np.int64)}
    stamped = bool((times[stamps] > 0).all())
    if not stamped:
        del times[stamps]
        notes.append(f"{topic.name} has no time in its headers: the time of recording is used")
    values = {name: x for name, x in topic.columns.items() if np.isfinite(x).any()}
    clock = stamps if stamped else logged
    return LogTable(topic.name, {**times, **values}, clock, dict.fromkeys(times, "ns"))


def tables_of(
    topic: str, groups: list[MessageGroup], unusable: dict[str, str], notes: list[str]
) -> list[LogTable]:
    """The tables of one topic; `unusable` and `notes` are added to."""
    together: dict[tuple[int, ...], list[str]] = {}  # indices of the groups with a joint -> such joints
    for joint in dict.fromkeys(name for group in groups for name in group.names):
        together.setdefault(tuple(i for i, x in enumerate(groups) if joint in x.names), []).append(joint)
    tables: list[LogTable] = []
    for number, (which, members) in enumerate(together.items()):
        parts = [groups[i] for i in which]
        order = np.argsort(np.concatenate([part.rows for part in parts]), kind="stable")
        if len(order) < SHORTEST:
            why = f"only {len(order)} messages, expected at least {SHORTEST}"
            unusable |= {f"{topic}/{joint}/{field}": why for joint in members for field in FIELDS}
            continue
        name, prefix = topic, topic if number == 0 else f"{topic}#{number + 1}"
        if len(together) > 1:
            name = f"{topic} ({', '.join(members[:3])}{', …' * (len(members) > 3)})"
        stamps, logged = f"{prefix}/{STAMP}", f"{prefix}/{LOGGED}"
        columns: dict[str, Array] = {
            stamps: np.concatenate([np.array(part.stamp, np.int64) for part in parts])[order],
            logged: np.concatenate([np.array(part.logged, np.int64) for part in parts])[order],
        }
        units = dict.fromkeys(columns, "ns")
        stamped = bool((columns[stamps] > 0).all())
        if not stamped:
            notes.append(f"{name} has no time in its headers: the time of recording is used")
        for joint in members:
            for key in FIELDS:
                values = np.concatenate([column(part, joint, key) for part in parts])[order]
                if np.isfinite(values).any():
                    columns[f"{topic}/{joint}/{key}"] = values
                else:
                    unusable[f"{topic}/{joint}/{key}"] = f"{EMPTY_FIELD} {key}"
        tables.append(LogTable(name, columns, stamps if stamped else logged, units))
    return tables


def column(group: MessageGroup, joint: str, key: str) -> Array:
    """(N,) one joint's values; NaN where a message does not have them."""
    index, count = group.names.index(joint), len(group.names)
    return np.array([row[index] if len(row) == count else np.nan for row in group.values[key]], dtype=float)


BAG = LogFormat(
    "MCAP, ROS 2 bags (a folder or .db3), .bag",
    read_bag,
    suffixes=(".mcap", ".db3", ".bag"),
    folder="a ROS 2 bag",
    mark="metadata.yaml",
)
