"""Servos in step 3: the gain where it is known, and which joints have the same servo."""

from __future__ import annotations

import re

from flexviz.base.errors import InputError
from flexviz.data.importing import typed_numbers
from flexviz.data.measurements import Drive
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import Page, put, warning
from flexviz.outlets.app.state import Changed, Turn
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.style import label_width

LABEL = "8em"


def typed_joints(text: str, joints: tuple[str, ...]) -> tuple[tuple[str, ...], ...]:
    """Joints with the same servo of a text such as "a, b; c, d"; InputError where it is not usable (yet)."""
    found = [tuple(re.findall(r"[^,\s]+", part)) for part in text.split(";") if part.strip()]
    named = [name for names in found for name in names]
    known = all(name in joints for name in named) and len(set(named)) == len(named)
    if not known or any(len(names) < 2 for names in found):
        raise InputError(
            f"found {text[:60]!r}, expected joints with commas, each once, a semicolon between two types of "
            f"servo: of {', '.join(joints)}"
        )
    return tuple(found)


class ServoEntries:
    """What is known of the servos besides the recording; a fit takes it instead of estimating it."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store = store
        gui = page.gui
        self.folder = gui.add_folder("Servos", visible=False)
        with self.folder:
            hint = (
                "all joints have one type of servo with the same settings: it is fitted once, and one joint "
            )
            hint += "with gravity gives all their scale"
            self._all = page.checkbox("All servos alike", False, self._set_all, hint=hint)
            hint = "joints with the same servo and settings, with commas; a semicolon between two types"
            self._same = page.watch(gui.add_text("Alike joints", "", hint=hint), self._set_same)
            hint = "gain of the servos where it is known, one number or one per joint; empty: it is estimated"
            self._kp = page.watch(gui.add_text("kp [Nm/rad]", "", hint=hint), self._set_kp)
            self._problem = ExplainedHtml(gui)
        for handle in (self._all, self._same, self._kp):
            page.style(label_width, handle, LABEL)
        store.subscribe(Changed.OPENED | Changed.ANALYSIS, self._refresh, Turn.CONTROLS)

    @property
    def _drive(self) -> Drive:
        return self._store.analysis.drive or self._store.measurements.drive or Drive()

    def _refresh(self) -> None:
        measurements, drive = self._store.measurements, self._drive
        put(self.folder, visible=measurements.drive is not None)
        put(self._all, value=bool(drive.same) and len(drive.same[0]) == measurements.n)
        if self._parsed(self._same.value) != drive.same:
            put(self._same, value="; ".join(", ".join(names) for names in drive.same))
        try:
            shown = typed_numbers(self._kp.value, measurements.n)
        except InputError:
            shown = None
        if (tuple(shown) if shown else None) != drive.kp:
            values = drive.kp or ()
            one = values[:1] if len(set(values)) == 1 else values
            put(self._kp, value=", ".join(f"{value:g}" for value in one))
        put(self._problem, content="")

    def _parsed(self, text: str) -> tuple[tuple[str, ...], ...] | None:
        try:
            return typed_joints(text, self._store.measurements.joints)
        except InputError:
            return None

    def _set_all(self, on: bool) -> None:
        self._change("servos alike", same=(self._store.measurements.joints,) if on else ())

    def _set_same(self, text: str) -> None:
        try:
            self._change("servos alike", same=typed_joints(text, self._store.measurements.joints))
        except InputError as error:
            self._problem.content = warning(str(error))

    def _set_kp(self, text: str) -> None:
        try:
            values = typed_numbers(text, self._store.measurements.n)
        except InputError as error:
            self._problem.content = warning(f"kp: {error}")
            return
        self._change("kp of the servos", kp=tuple(values) if values else None)

    def _change(self, label: str, **fields: object) -> None:
        drive = Drive(**{"kp": self._drive.kp, "same": self._drive.same, **fields})  # type: ignore[arg-type]
        self._store.change(label, self._store.analysis.with_drive(drive))
