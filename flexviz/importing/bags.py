"""Read sensor_msgs/JointState from MCAP files, ROS 2 bags (folders, .db3) and ROS 1 bags.

`rosbags` reads all of these without a ROS installation. JointState has been the same in every ROS release, so
its definition need not be in the bag, and what else a bag holds is never decoded.

A column is called `<topic>/<joint>/<position|velocity|effort>`. Joints that always come in the same messages
share a table: where two drivers publish on one topic, each has its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag2 import Reader as Reader2
from rosbags.typesys import Stores, get_typestore

from flexviz.errors import FlexvizError, InputError, one_line
from flexviz.importing.log import EMPTY, LOGGED, SHORTEST, STAMP, Log, Reading, Table
from flexviz.measurements import Array
from flexviz.progress import Progress

JOINT_STATE = "sensor_msgs/msg/JointState"
FIELDS = ("position", "velocity", "effort")
CHECK_EVERY = 2000  # messages between two looks at the clock and at Ctrl+C


@dataclass
class Layout:
    """The messages of one topic with the same joints in the same order."""

    names: tuple[str, ...]
    rows: list[int] = field(default_factory=list)  # which message of the topic
    stamp: list[int] = field(default_factory=list)  # [ns]
    logged: list[int] = field(default_factory=list)  # [ns]
    values: dict[str, list[Array]] = field(default_factory=lambda: {name: [] for name in FIELDS})


def read_bag(path: Path, reading: Reading) -> Log:
    """Every JointState topic of a bag."""
    first = path.suffix == ".bag"
    kind = "ROS 1 bag" if first else "MCAP" if path.suffix == ".mcap" else "ROS 2 bag"
    with translated(path), Reader1(path) if first else Reader2(path) as reader:
        states = [c for c in reader.connections if c.msgtype == JOINT_STATE]
        if not states:
            raise InputError(f"no topic holds {JOINT_STATE}; {present(reader)}", file=path)
        topics = collect(reader, states, first, path, reading)
    tables, unusable, notes = [], {}, []
    for topic, layouts in topics.items():
        found, refused, said = tables_of(topic, list(layouts.values()))
        tables += found
        unusable |= refused
        notes += said
    if not any(table.rows for table in tables):
        short = "; ".join(f"{name}: {why}" for name, why in list(unusable.items())[:3])
        raise InputError(f"no joint has {SHORTEST} messages or more ({short or 'no messages'})", file=path)
    return Log(path, kind, tuple(tables), unusable, tuple(notes))


def collect(
    reader: Any, states: Sequence[Any], first: bool, path: Path, reading: Reading
) -> dict[str, dict[tuple[str, ...], Layout]]:
    """Topic -> names in a message -> those messages."""
    store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
    decode = store.deserialize_ros1 if first else store.deserialize_cdr
    topics: dict[str, dict[tuple[str, ...], Layout]] = {c.topic: {} for c in states}
    seen = dict.fromkeys(topics, 0)
    total = max(1, sum(c.msgcount for c in states))
    for number, (connection, logged, raw) in enumerate(reader.messages(states)):
        if number % CHECK_EVERY == 0:
            reading.progress(Progress(f"reading {path.name}", min(1.0, number / total)))
            reading.check_stop()
        message: Any = decode(raw, JOINT_STATE)
        names = tuple(message.name)
        layouts = topics[connection.topic]
        layout = layouts.get(names) or layouts.setdefault(names, Layout(names))
        layout.rows.append(seen[connection.topic])
        seen[connection.topic] += 1
        layout.stamp.append(message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec)
        layout.logged.append(logged)
        for name in FIELDS:
            layout.values[name].append(getattr(message, name))
    return topics


def tables_of(topic: str, layouts: list[Layout]) -> tuple[list[Table], dict[str, str], list[str]]:
    """The tables of one topic, why some joints have none, and what to say about it."""
    joints = list(dict.fromkeys(name for layout in layouts for name in layout.names))
    together: dict[tuple[int, ...], list[str]] = {}
    for joint in joints:
        together.setdefault(tuple(i for i, x in enumerate(layouts) if joint in x.names), []).append(joint)
    tables: list[Table] = []
    unusable: dict[str, str] = {}
    notes: list[str] = []
    for number, (which, members) in enumerate(together.items()):
        name = (
            topic if len(together) == 1 else f"{topic} ({', '.join(members[:3])}{', …' * (len(members) > 3)})"
        )
        parts = [layouts[i] for i in which]
        order = np.argsort(np.concatenate([np.array(part.rows) for part in parts]), kind="stable")
        if len(order) < SHORTEST:
            why = f"only {len(order)} messages, at least {SHORTEST} would be right"
            unusable |= {f"{topic}/{joint}/{field}": why for joint in members for field in FIELDS}
            continue
        prefix = topic if number == 0 else f"{topic}#{number + 1}"
        times = {
            f"{prefix}/{key}": np.concatenate([np.array(getattr(p, attribute), np.int64) for p in parts])[
                order
            ]
            for key, attribute in ((STAMP, "stamp"), (LOGGED, "logged"))
        }
        stamped = bool((times[f"{prefix}/{STAMP}"] > 0).all())
        if not stamped:
            notes.append(f"{name} has no time in its headers: the time of recording is used")
        columns: dict[str, Array] = dict(times)
        for joint in members:
            for key in FIELDS:
                values = np.concatenate([column(part, joint, key) for part in parts])[order]
                if np.isfinite(values).any():
                    columns[f"{topic}/{joint}/{key}"] = values
                else:
                    unusable[f"{topic}/{joint}/{key}"] = f"{EMPTY} {key}"
        clock = f"{prefix}/{STAMP if stamped else LOGGED}"
        tables.append(Table(name, columns, clock, dict.fromkeys(times, "ns")))
    return tables, unusable, notes


def column(layout: Layout, joint: str, key: str) -> Array:
    """(N,) one joint's values; NaN where a message does not have them."""
    index, count = layout.names.index(joint), len(layout.names)
    return np.array([row[index] if len(row) == count else np.nan for row in layout.values[key]], dtype=float)


def present(reader: Any) -> str:
    """What a bag without joint states holds instead."""
    topics = sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})
    return "the bag has " + (", ".join(topics[:8]) + (", …" if len(topics) > 8 else "") or "no topics")


@contextmanager
def translated(path: Path) -> Iterator[None]:
    """One-line InputErrors for whatever a broken bag makes the library raise."""
    try:
        yield
    except FlexvizError:
        raise
    except MemoryError:
        raise InputError("the bag does not fit into memory", file=path) from None
    except Exception as error:  # struct, sqlite, yaml, decompression and decoding errors of every kind
        reason = one_line(str(error) or type(error).__name__)[:200]
        cut = "magic" in reason or "Truncated" in reason
        hint = (
            "; an MCAP file cut short is repaired by `mcap recover`" if cut and path.suffix == ".mcap" else ""
        )
        raise InputError(f"not a readable bag: {reason}{hint}", file=path) from None
