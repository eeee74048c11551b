"""A mapping being drafted: it may lack what is not known yet, and gives the reasons for its entries."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flexviz.importing.formats import LogSource
from flexviz.importing.mapping import SIGNALS, Fix, Mapping, parse
from flexviz.robot import is_library_robot
from flexviz.toml import key_text, value_text

DEFAULTS: dict[str, Any] = {"side": "joint", "sign": 1, "offset": 0.0}
HEAD = """# What the columns of these logs are; written by flexviz import after looking at them.
# Correct what is wrong, then:  flexviz import {name} --out SET
# Every key: docs/importing.md. torque_hold, [initial], [controller] and [model] of a set may stand here too.
"""


@dataclass
class DraftJoint:
    """One joint's entry."""

    signals: dict[str, dict[str, Any]] = field(default_factory=dict)  # "theta" … -> the keys of its table
    gear: float = 1.0  # where known
    torque_constant: float | None = None
    # "theta" …, "gear" -> observations and reasons, one sentence each
    comments: dict[str, list[str]] = field(default_factory=dict)

    def comment(self, key: str, why: str) -> None:
        """Add a comment."""
        comments = self.comments.setdefault(key, [])
        if why not in comments:
            comments.append(why)

    def document(self) -> dict[str, Any]:
        """The joint's table."""
        document: dict[str, Any] = {"gear": self.gear} if self.gear != 1.0 else {}
        document |= {"torque_constant": self.torque_constant} if self.torque_constant is not None else {}
        return document | {name: self.signals[name] for name in SIGNALS if name in self.signals}

    def lines(self) -> list[str]:
        """The lines of the joint's table, with comments."""
        document, lines = self.document(), []
        for key, value in document.items():
            lines += [f"# {key}: {why}" for why in self.comments.get(key, [])]
            lines.append(f"{key} = {value_text(value)}")
        unknown = (item for item in self.comments.items() if item[0] not in document)
        return lines + [f"# {key} = …  # {'; '.join(comments)}" for key, comments in unknown]


@dataclass
class Draft:
    """A whole mapping."""

    robot: str  # as in a measurement set; a URDF's path as it was given
    sources: list[LogSource]  # the logs, with the names of their groups and whether each is for validation
    groups: list[str]
    validation: set[str] = field(default_factory=set)
    time: dict[str, Any] = field(default_factory=dict)  # the keys of [time]
    time_comment: str = ""
    joints: dict[str, DraftJoint] = field(default_factory=dict)  # name -> entry
    seen: list[str] = field(default_factory=list)  # lines about the logs
    missing: list[str] = field(default_factory=list)  # what must still be filled in, one sentence each

    def mapping(self) -> Mapping:
        """The mapping, checked; paths are as they were given. InputError where something is missing."""
        return parse(self.document(Path.cwd()), Path("mapping"))

    def document(self, folder: Path) -> dict[str, Any]:
        """The content of the file, with paths relative to its folder."""
        logs = []
        for source, group in zip(self.sources, self.groups, strict=True):
            entry: dict[str, Any] = {"file": relative(source.path, folder)}
            entry |= {"episode": source.episode} if source.episode is not None else {}
            logs.append(entry | {"group": group, "payload": "none", "validation": group in self.validation})
        joints = {name: joint.document() for name, joint in self.joints.items()}
        robot = self.robot if is_library_robot(self.robot) else relative(Path(self.robot), folder)
        document: dict[str, Any] = {"format": 1, "robot": robot}
        document |= {"time": self.time} if self.time else {}
        return document | {"payloads": {"none": {"bodies": []}}, "logs": logs, "joints": joints}

    def apply(self, fixes: tuple[Fix, ...], why: str) -> None:
        """Apply fixes, and comment on the reason."""
        for fix in fixes:
            joint = self.joints[fix.joint]
            joint.signals[fix.signal][fix.key] = fix.value
            if DEFAULTS.get(fix.key) == fix.value:
                del joint.signals[fix.signal][fix.key]
            joint.comment(fix.signal, why)

    def text(self, file: Path | None) -> str:
        """The file's text, with comments; `file` is its future path, None: in the current folder."""
        folder = Path.cwd() if file is None else file.absolute().parent
        document = self.document(folder)
        lines = [*HEAD.format(name=file.name if file else "mapping.toml").splitlines(), ""]
        lines += ["format = 1", f"robot = {value_text(document['robot'])}", ""]
        lines += [f"# {line}" for line in self.seen]
        if self.missing:
            lines += ["", *(f"# MISSING: {line}" for line in self.missing)]
        if self.time:
            lines += ["", "[time]", *(f"{key} = {value_text(value)}" for key, value in self.time.items())]
            lines[-1] += f"  # {self.time_comment}" if self.time_comment else ""
        lines += ["", "[payloads.none]", "bodies = []"]
        lines += ["# [payloads.p1]  # mass [kg], com [m] and inertia [kg m²] in the link's frame"]
        lines += [
            '# bodies = [{ link = "…", mass = 2.0, com = [0, 0, 0], inertia = [0.01, 0.01, 0.01, 0, 0, 0] }]'
        ]
        for entry in document["logs"]:
            lines += ["", "[[logs]]", *(f"{key} = {value_text(value)}" for key, value in entry.items())]
        if not self.validation and len(self.groups) > 1:
            lines[-1] += "  # true on one log keeps it for checking the result"
        for name, joint in self.joints.items():
            lines += ["", f"[joints.{key_text(name)}]"]
            lines += joint.lines()
        return "\n".join(lines) + "\n"


def relative(path: Path, folder: Path) -> str:
    """A path relative to `folder`."""
    return Path(os.path.relpath(path.absolute(), folder.absolute())).as_posix()
