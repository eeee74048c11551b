"""Entries of the form for one's own robot: columns, gears and torque constants, runs, payloads, time."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import Any

from flexviz.base.errors import InputError
from flexviz.content.view import shown_signals
from flexviz.data.importing import (
    ANGLE,
    CURRENT,
    FORCE,
    LENGTH,
    TIME,
    TORQUE,
    Draft,
    add_payload,
    currents,
    set_column,
    set_constants,
    set_key,
    typed_numbers,
)
from flexviz.outlets.app.own_robot import OwnFiles
from flexviz.outlets.app.page import Page, off
from flexviz.outlets.app.style import half, label_width

NO_COLUMN, EVERY, MIXED, NUMBER = "–", "every joint", "as it is", "a number"
SIDES = {"behind the gear (joint)": "joint", "before the gear (motor)": "motor"}
SIGNS = {"+": 1, "− (reversed)": -1}
FORCES = ("tau", "tau_joint")  # the other signals are positions
USES = ("fit", "validate")
LABEL = "7em"
NO_OFFSET = "0, 0, 0"  # [m]
Edited = Callable[[Sequence[str], str], None]  # the joints and the signal that were changed


def only(values: Sequence[Any]) -> Any:
    """The value that all have, or None."""
    return values[0] if values and all(value == values[0] for value in values) else None


class ColumnEntry:
    """Column, unit, side and sign of one signal of one joint, or of all joints."""

    def __init__(self, page: Page, edited: Edited) -> None:
        self._edited = edited
        self._own: OwnFiles
        hint = "the row of the table to correct; a click on the row chooses it"
        self._rows: dict[str, tuple[str, str]] = {}  # label -> (joint or EVERY, signal)
        self.row = page.dropdown("Correct", ("–",), lambda _: self.refresh(), hint=hint)
        self._column = page.dropdown("Column", (NO_COLUMN,), self._set_column)
        self._unit = page.dropdown("Unit", (MIXED,), self._set_unit)
        hint = "of one unit in rad or Nm (m or N of a sliding joint): 0.00153398 for 4096 counts per turn"
        self._size = page.watch(
            page.gui.add_text("Size of unit", "", hint=hint, visible=False), self._set_size
        )
        self._side = page.dropdown(
            "Measured", (MIXED, *SIDES), lambda side: self._set("side", SIDES.get(side))
        )
        self._sign = page.dropdown("Sign", (MIXED, *SIGNS), lambda sign: self._set("sign", SIGNS.get(sign)))
        for handle in (self.row, self._column, self._unit, self._size, self._side, self._sign):
            page.style(label_width, handle, LABEL)

    def show(self, own: OwnFiles) -> None:
        """Offer the rows of these files."""
        self._own = own
        self._rows = {
            f"{symbol} of {joint}": (joint, name)
            for joint in (EVERY, *own.draft.joints)
            for name, symbol in shown_signals(own.draft).items()
        }
        self.row.options = tuple(self._rows)
        self.row.value = next(iter(self._rows))
        self._column.options = (NO_COLUMN, *own.preview.columns)
        self.refresh()

    def choose(self, row: str) -> None:
        """Choose a row by its label, if there is one."""
        if row in self._rows:
            self.row.value = row
            self.refresh()

    def refresh(self) -> None:
        """Show the entry of the chosen row."""
        joints, name, signals = self._chosen()
        self._unit.options = (MIXED, *self._units(joints, name), NUMBER)
        single = len(joints) == 1 and self._rows[self.row.value][0] != EVERY
        off(self._column, "" if single else "choose one joint under Correct", "of the log")
        column = only([signal["from"] for signal in signals]) if single else None
        self._column.value = column if column in self._own.preview.columns else NO_COLUMN
        for handle in (self._unit, self._side, self._sign):
            off(handle, "" if signals else "no column is chosen")
        unit = only([signal.get("unit", self._si(joints, name)) for signal in signals])
        sized = isinstance(unit, float | int)
        self._unit.value = NUMBER if sized else unit if unit in self._unit.options else MIXED
        self._size.visible = sized
        if sized:
            self._size.value = f"{unit:.9g}"
        for handle, names, key, usual in (
            (self._side, SIDES, "side", "joint"),
            (self._sign, SIGNS, "sign", 1),
        ):
            value = only([signal.get(key, usual) for signal in signals])
            handle.value = next((text for text, one in names.items() if one == value), MIXED)

    def _chosen(self) -> tuple[list[str], str, list[dict[str, Any]]]:
        """Joints, signal, and the tables of those that have one."""
        joint, name = self._rows[self.row.value]
        joints = list(self._own.draft.joints) if joint == EVERY else [joint]
        entries = [self._own.draft.joints[each].signals.get(name) for each in joints]
        return joints, name, [entry for entry in entries if entry is not None]

    def _slides(self, joints: Sequence[str]) -> bool:
        return all(joint in self._own.prismatic for joint in joints)

    def _si(self, joints: Sequence[str], name: str) -> str:
        slides = self._slides(joints)
        return ("N" if slides else "Nm") if name in FORCES else ("m" if slides else "rad")

    def _units(self, joints: Sequence[str], name: str) -> tuple[str, ...]:
        slides = self._slides(joints)
        if name not in FORCES:
            return tuple(LENGTH if slides else ANGLE)
        return (*(FORCE if slides else TORQUE), *CURRENT)

    def _set(self, key: str, value: Any) -> None:
        """Set a key of the chosen row; None leaves it."""
        joints, name, _ = self._chosen()
        if value is not None:
            for joint in joints:
                set_key(self._own.draft.joints[joint], name, key, value)
            self._edited(joints, name)
        self.refresh()

    def _set_unit(self, unit: str) -> None:
        if unit == NUMBER:
            self._size.visible = True
        else:
            self._set("unit", None if unit == MIXED else unit)

    def _set_size(self, text: str) -> None:
        try:
            values = typed_numbers(text, 1)
        except InputError:
            return  # it is still being typed
        if values:
            self._set("unit", values[0])

    def _set_column(self, column: str) -> None:
        joints, name, _ = self._chosen()
        known = list(self._own.preview.columns)
        set_column(self._own.draft, joints[0], name, "" if column == NO_COLUMN else column, known)
        self._edited(list(self._own.draft.joints), name)
        self.refresh()


class Constants:
    """Gear ratios and torque constants of all joints."""

    def __init__(self, page: Page, edited: Edited, problem: Callable[[str], None]) -> None:
        self._edited, self._problem = edited, problem
        self.draft: Draft
        gui = page.gui
        hint = "motor turns per joint turn, from the data sheet: one number, or one per joint with commas; "
        hint += "negative where they turn opposite ways; empty where the log has divided by it"
        self._gears = page.watch(gui.add_text("Gear ratios", "", hint=hint), self._type_gears)
        hint = (
            "of the motor, from its data sheet (rated torque ÷ rated current): one number, or one per joint"
        )
        self._constants = page.watch(gui.add_text("Torque constants", "", hint=hint), self._type_constants)
        for handle in (self._gears, self._constants):
            page.style(label_width, handle, LABEL)

    def show(self, draft: Draft) -> None:
        self.draft = draft
        gears = [joint.gear for joint in draft.joints.values()]
        self._gears.value = ", ".join(f"{gear:g}" for gear in gears) if any(g != 1.0 for g in gears) else ""
        self._constants.value = ""

    def refresh(self) -> None:
        """Torque constants are asked for only where there are currents."""
        self._constants.visible = bool(currents(self.draft))

    def _type_gears(self, text: str) -> None:
        values = self._numbers(text, signed=True)
        if values is not None:
            set_constants(self.draft, "gear", values or [1.0] * len(self.draft.joints))
            for name in self.draft.needed:
                self._edited(list(self.draft.joints), name)

    def _type_constants(self, text: str) -> None:
        values = self._numbers(text)
        if values:
            set_constants(self.draft, "torque_constant", values)
        elif values is not None:
            for joint in self.draft.joints.values():
                joint.torque_constant = None
        if values is not None:
            self._edited(list(self.draft.joints), "tau")

    def _numbers(self, text: str, signed: bool = False) -> list[float] | None:
        """The typed numbers, [] for none; None where they are not usable (yet)."""
        try:
            values = typed_numbers(text, len(self.draft.joints), signed=signed)
        except InputError as error:
            self._problem(str(error))
            return None
        self._problem("")
        return values or []


class Runs:
    """Use and payload of each run; payloads; the time column."""

    def __init__(self, page: Page, edited: Callable[[], None], problem: Callable[[str], None]) -> None:
        self._edited, self._problem = edited, problem
        self._own: OwnFiles
        gui = page.gui
        self._run = page.dropdown("Log run", ("–",), lambda _: self.refresh())
        self._use = page.dropdown("Use", USES, self._set_use, hint="a run to validate is never fitted")
        self._payload = page.dropdown("Payload", ("none",), self._set_payload)
        with gui.add_folder("Add a payload", expand_by_default=False):
            self._link = page.dropdown("On link", ("–",))
            self._mass = page.watch(gui.add_text("Mass [kg]", ""))
            hint = "x, y, z of its centre of mass in the link's frame"
            self._com = page.watch(gui.add_text("Centre [m]", NO_OFFSET, hint=hint))
            hint = "Ixx, Iyy, Izz, Ixy, Ixz, Iyz about its centre of mass; empty: a point mass"
            self._inertia = page.watch(gui.add_text("Inertia [kg m²]", "", hint=hint))
            page.button("Add payload", self._add, hint="and give it to the chosen run")
        with gui.add_folder("Time", expand_by_default=False):
            self._time = page.dropdown("Time column", (NO_COLUMN,), self._set_time)
            self._time_unit = page.dropdown("Time unit", tuple(TIME), self._set_time)
            hint = "from row to row, where the log has no time column"
            self._step = page.watch(gui.add_text("Step [s]", "", hint=hint), self._set_time)
        for handle in (self._use, self._payload):
            page.style(half, handle, "4.6em")
        body = self._link, self._mass, self._com, self._inertia
        for handle in (self._run, *body, self._time, self._time_unit, self._step):
            page.style(label_width, handle, LABEL)

    def show(self, own: OwnFiles) -> None:
        self._own, draft = own, own.draft
        self._run.options = tuple(draft.groups)
        self._run.value = draft.groups[-1]
        self._link.options = own.links
        self._link.value = own.links[-1]
        self._time.options = (NO_COLUMN, *own.preview.times)
        column = draft.time.get("column")
        self._time.value = column if column in own.preview.times else NO_COLUMN
        unit = draft.time.get("unit", "s")
        self._time_unit.value = unit if unit in TIME else "s"
        self.refresh()

    def refresh(self) -> None:
        """Show use and payload of the chosen run."""
        draft, run = self._own.draft, self._run.value
        self._use.value = USES[run in draft.validation]
        self._payload.options = ("none", *draft.payloads)
        self._payload.value = draft.loads.get(run, "none")
        off(self._step, "the log has a time column" if self._time.value != NO_COLUMN else "")

    def _set_use(self, use: str) -> None:
        change = self._own.draft.validation.add if use == USES[1] else self._own.draft.validation.discard
        change(self._run.value)
        self._edited()

    def _set_payload(self, payload: str) -> None:
        self._own.draft.loads[self._run.value] = payload
        self._edited()

    def _add(self) -> None:
        draft = self._own.draft
        mass = floats(self._mass.value, (1,), "Mass [kg]")
        com = floats(self._com.value, (3,), "Centre [m]")
        inertia = floats(self._inertia.value, (0, 6), "Inertia [kg m²]")
        if not mass[0] > 0:
            raise InputError(f"Mass [kg]: found {mass[0]:g}, expected more than 0")
        draft.loads[self._run.value] = add_payload(draft, self._link.value, mass[0], com, inertia)
        self._mass.value, self._com.value, self._inertia.value = "", NO_OFFSET, ""
        self.refresh()
        self._edited()

    def _set_time(self, _: str) -> None:
        time, draft = self._time.value, self._own.draft
        kept = {key: value for key, value in draft.time.items() if key not in ("column", "unit", "step")}
        if time != NO_COLUMN:
            draft.time = {"column": time, "unit": self._time_unit.value} | kept
        else:
            try:
                step = typed_numbers(self._step.value, 1)
            except InputError as error:
                self._problem(f"Step [s]: {error}")
                return
            draft.time = ({"step": step[0]} if step else {}) | kept
        self._problem("")
        self.refresh()
        self._edited()


def floats(text: str, counts: Sequence[int], what: str) -> list[float]:
    """The numbers of a text; InputError where their count or one of them is wrong."""
    wanted = "nothing or " if 0 in counts else ""
    wanted += "a number" if counts[-1] == 1 else f"{counts[-1]} numbers with commas"
    try:
        values = [float(word) for word in re.findall(r"[^,;\s]+", text)]
    except ValueError:
        values = [math.nan]
    if len(values) not in counts or not all(abs(value) < 1e6 for value in values):
        raise InputError(f"{what}: found {text[:40]!r}, expected {wanted}")
    return values
