"""A mapping being drafted, and the questions that this may ask.

The draft may lack what is not known yet, and gives the reasons for its entries.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flexviz.base import toml
from flexviz.data.logs import NEEDED, SIGNALS, Fix, LogSource, Mapping, Proposal, parse_mapping, proposed
from flexviz.data.measurements import TorqueSide
from flexviz.robot.mounting import GRAVITY
from flexviz.robot.robot import is_library_robot

Ask = Callable[[str, str], str]  # question, answer when only Enter is pressed -> answer
DEFAULTS: dict[str, Any] = {"side": "joint", "sign": 1, "offset": 0.0}
HEAD = """# What the columns of these logs are; written by flexviz import after looking at them.
# Correct what is wrong, then:  flexviz import {name} --out SET
# Every key: docs/importing.md. torque_hold, [initial], [controller] and [model] of a set may stand here too.
"""
PAYLOAD_EXAMPLE = [
    "# [payloads.p1]  # mass [kg], com [m] and inertia [kg m²] in the link's frame",
    '# bodies = [{ link = "…", mass = 2.0, com = [0, 0, 0], inertia = [0.01, 0.01, 0.01, 0, 0, 0] }]',
]


@dataclass
class DraftJoint:
    """One joint's entry."""

    signals: dict[str, dict[str, Any]] = field(default_factory=dict)  # "theta" … -> the keys of its table
    gear: float = 1.0  # where known; negative: motor and joint turn opposite ways
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
            lines.append(f"{key} = {toml.value_text(value)}")
        unknown = (item for item in self.comments.items() if item[0] not in document)
        return lines + [f"# {key} = …  # {'; '.join(comments)}" for key, comments in unknown]


@dataclass
class Draft:
    """A whole mapping."""

    robot: str  # as in a measurement set; a URDF's path as it was given
    sources: list[LogSource]  # the logs, with the names of their groups and whether each is for validation
    groups: list[str]
    gravity: tuple[float, float, float] = GRAVITY  # [m/s²] in the base's frame
    validation: set[str] = field(default_factory=set)
    payloads: dict[str, list[dict[str, Any]]] = field(default_factory=dict)  # name -> bodies, as in a set
    loads: dict[str, str] = field(default_factory=dict)  # group -> its payload; none where it is not here
    torque: TorqueSide | None = None  # None: the data decide
    drive: bool = False  # the joints follow goals, and no torque was recorded
    time: dict[str, Any] = field(default_factory=dict)  # the keys of [time]
    time_comment: str = ""
    joints: dict[str, DraftJoint] = field(default_factory=dict)  # name -> entry
    seen: list[str] = field(default_factory=list)  # lines about the logs
    missing: list[str] = field(default_factory=list)  # what must still be filled in, one sentence each
    proposals: list[tuple[Proposal, str]] = field(
        default_factory=list
    )  # keys for the user to decide, and why

    notes: list[str] = field(default_factory=list)  # of these lines those on goals and joints left out
    alike: list[str] = field(default_factory=list)  # comments: joints that may have one type of servo
    accepted: list[Proposal] = field(default_factory=list)  # of the logs and of the whole

    @property
    def needed(self) -> tuple[str, ...]:
        """The signals that every joint needs."""
        return ("theta", "theta_ref") if self.drive else NEEDED

    def mapping(self) -> Mapping:
        """The mapping, checked; paths are as they were given. InputError where something is missing."""
        return parse_mapping(self.document(Path.cwd()), Path("mapping"))

    def document(self, folder: Path) -> dict[str, Any]:
        """The content of the file, with paths relative to its folder."""
        logs = []
        for source, group in zip(self.sources, self.groups, strict=True):
            files = [relative(path, folder) for path in source.paths]
            entry: dict[str, Any] = {"file": files if source.beside else files[0]}
            entry |= {"episode": source.episode} if source.episode is not None else {}
            entry |= {"group": group, "payload": self.loads.get(group, "none")}
            logs.append(entry | {"validation": group in self.validation})
        joints = {name: joint.document() for name, joint in self.joints.items()}
        robot = self.robot if is_library_robot(self.robot) else relative(Path(self.robot), folder)
        document: dict[str, Any] = {"format": 1, "robot": robot}
        document |= {"gravity": list(self.gravity)} if self.gravity != GRAVITY else {}
        document |= {"torque": self.torque} if self.torque else {}
        document |= {"drive": {"from": "goal"}} if self.drive else {}
        document |= {"time": self.time} if self.time else {}
        payloads = {name: {"bodies": bodies} for name, bodies in {"none": [], **self.payloads}.items()}
        return proposed(document | {"payloads": payloads, "logs": logs, "joints": joints}, self.accepted)

    def leave_out(self, joint: str, why: str) -> None:
        """Draft no entry for a joint, which is then locked at zero; the reason stands among what was seen."""
        del self.joints[joint]
        self.note(f"left out: {why}")

    def note(self, text: str) -> None:
        """Say what a user has to know of how the logs were read."""
        self.seen.append(f"  {text}")
        self.notes.append(text)

    def apply(self, fixes: tuple[Fix, ...], why: str) -> None:
        """Apply fixes, and comment on the reason."""
        for fix in fixes:
            joint = self.joints[fix.joint]
            joint.signals[fix.signal][fix.key] = fix.value
            if DEFAULTS.get(fix.key) == fix.value:
                del joint.signals[fix.signal][fix.key]
            joint.comment(fix.signal, why)

    def accept(self, remedies: Iterable[Proposal], why: str) -> None:
        """Set proposed keys, and comment on the reason where a joint has them."""
        for one in remedies:
            if one.place[:1] == ("joints",):
                _, joint, signal = one.place
                self.apply((Fix(joint, signal, one.key, one.value),), why)
            elif one.key == "gravity":
                x, y, z = one.value
                self.gravity = x, y, z
            else:
                self.accepted.append(one)

    def text(self, file: Path | None) -> str:
        """The file's text, with comments; `file` is its future path, None: in the current folder."""
        folder = Path.cwd() if file is None else file.absolute().parent
        document = self.document(folder)
        lines = [*HEAD.format(name=file.name if file else "mapping.toml").splitlines(), ""]
        tables = ("time", "payloads", "logs", "joints")
        lines += toml.dumps({key: document[key] for key in document if key not in tables}).splitlines()
        if self.drive:
            lines += ["# kp = […]  # Nm/rad, if known", *self.alike]
        if model := self.proposed("model"):
            lines += ["", "# [model]", *model]
        lines += ["", *self.proposed(), *(f"# {line}" for line in self.seen)]
        if self.missing:
            lines += ["", *(f"# MISSING: {line}" for line in self.missing)]
        if self.time:
            lines += [
                "",
                "[time]",
                *(f"{key} = {toml.value_text(value)}" for key, value in self.time.items()),
            ]
            lines[-1] += f"  # {self.time_comment}" if self.time_comment else ""
        lines += ["", *toml.dumps({"payloads": document["payloads"]}).splitlines()]
        lines += [] if self.payloads else PAYLOAD_EXAMPLE
        for log in document["logs"]:
            lines += ["", *toml.dumps({"logs": [log]}).strip().splitlines()]
            lines += self.proposed("logs", log["group"])
        if not self.validation and len(self.groups) > 1:
            lines[-1] += "  # true on one log keeps it for checking the result"
        for name, joint in self.joints.items():
            lines += ["", f"[joints.{toml.key_text(name)}]", *joint.lines()]
            for signal in joint.signals:
                lines += self.proposed("joints", name, signal)
        return "\n".join(lines) + "\n"

    def proposed(self, *place: str) -> list[str]:
        """The proposals for a table, as comments; a key of a signal stands in its table already changed."""
        chosen: dict[str, tuple[Proposal, str]] = {
            p.text: (p, why) for p, why in self.proposals if p.place == place
        }
        lines = [f"# {why}" for why in dict.fromkeys(why for _, why in chosen.values())]
        if len(place) < 3:
            return lines + [f"# {text}" for text in chosen]
        table = self.joints[place[1]].signals[place[2]] | {p.key: p.value for p, _ in chosen.values()}
        return [*lines, f"# {place[2]} = {toml.value_text(table)}"] if chosen else []


def relative(path: Path, folder: Path) -> str:
    """A path relative to `folder`."""
    return Path(os.path.relpath(path.absolute(), folder.absolute())).as_posix()


class Questions:
    """Answers to questions: the defaults, without asking anybody."""

    def choose(self, question: str, options: Sequence[str], default: int | None) -> int | None:
        """The index of one of the options, or None for none of them."""
        return default

    def numbers(self, question: str, count: int, signed: bool = False) -> list[float] | None:
        """`count` numbers (one stands for all), positive unless `signed`; None where they are not known."""
        return None

    def several(self, question: str, options: Sequence[str]) -> list[int]:
        """The indices of some of the options."""
        return []


class Person(Questions):
    """Asks a person; `tell` shows a line, `ask` returns what was typed. Invalid answers are asked again."""

    def __init__(self, ask: Ask, tell: Callable[[str], None]) -> None:
        self.ask, self.tell = ask, tell

    def choose(self, question: str, options: Sequence[str], default: int | None) -> int | None:
        self._show(question, options)
        self.tell("  0  none of these")
        valid = range(len(options) + 1)
        preset = str(0 if default is None else default + 1)
        wrong = f"is none of 0 … {len(options)}"
        (answer,) = self._ask("number", preset, lambda x: len(x) == 1 and x[0] in valid, wrong)
        return int(answer) - 1 if answer else None

    def numbers(self, question: str, count: int, signed: bool = False) -> list[float] | None:
        wanted = "one number" + (f", or {count} with commas" if count > 1 else "")
        values = self._ask(
            f"{question} ({wanted}; only Enter where it is not known)",
            "",
            lambda x: (
                len(x) in (0, 1, count) and all(0.0 < (abs(value) if signed else value) < 1e9 for value in x)
            ),
            f"is not {wanted} {'other than' if signed else 'above'} 0",
        )
        return (values * count if len(values) == 1 else values) or None

    def several(self, question: str, options: Sequence[str]) -> list[int]:
        self._show(question, options)
        valid = range(1, len(options) + 1)
        wrong = f"holds something that is none of 1 … {len(options)}"
        prompt = "numbers with commas, only Enter for none"
        found = self._ask(prompt, "", lambda x: all(number in valid for number in x), wrong)
        return sorted({int(number) - 1 for number in found})

    def _show(self, question: str, options: Sequence[str]) -> None:
        for line in (question, *(f"  {i + 1}  {option}" for i, option in enumerate(options))):
            self.tell(line)

    def _ask(
        self, prompt: str, default: str, valid: Callable[[list[float]], bool], wrong: str
    ) -> list[float]:
        """Numbers separated by commas or spaces, asked for until they are valid."""
        while True:
            text = self.ask(prompt, default).strip()
            try:
                numbers = [float(word) for word in re.findall(r"[^,\s]+", text)]
                if valid(numbers):
                    return numbers
            except ValueError:
                pass
            self.tell(f'"{text}" {wrong}')
