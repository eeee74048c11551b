"""The entries of step Diagnose: findings, and the effects in the model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from flexviz.analysis.diagnosis import Finding
from flexviz.content.rendering import panel
from flexviz.content.topics import finding_panel
from flexviz.content.view import card_html, evidence_chart, law_chart
from flexviz.content.wording import Families, MergedFinding, escape, merged_texts, text_names
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import Page, off, put
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.uplot import ChartColumn

MAX_ROWS = 12  # in the list of the model's effects
APART, TOGETHER = "Take apart", "Put together"
HEIGHT = 230  # [pixels] of the evidence


class FindingEntry:
    """The text, chart, explanation and buttons of a finding, on one joint or several."""

    def __init__(self, page: Page, index: int, add: Callable[[int], None]) -> None:
        self._index = index
        self._finding: Finding | None = None  # whose evidence is shown
        self._group = ""
        self.opened = index == 0  # whether its evidence is shown
        self._goals = False  # whether these drive the joints
        gui = page.gui
        self._text = ExplainedHtml(gui, visible=False)
        self._toggle = page.button("Show evidence", self._switch, visible=False)
        self.add = page.button(
            "Add and refit", partial(add, index), color="blue" if index == 0 else "gray", visible=False
        )
        self._folder = gui.add_folder(None, visible=False)
        self._chart = ChartColumn(page.server, self._folder)
        self._card = ExplainedHtml(gui, visible=False)
        page.row((self._toggle, self.add))

    def show(self, merged: MergedFinding[Finding] | None, store: Store) -> None:
        """Show a finding with its evidence in the selected group; None hides the entry."""
        for handle in (self._text, self._toggle, self.add, self._card):
            put(handle, visible=merged is not None)
        self._finding = None
        if merged is None:
            put(self._folder, visible=False)
            return
        joints, members = store.measurements.joints, merged.members
        self._goals = store.measurements.drive is not None
        here = (member for member in members if member.joint == store.joint_name)
        self._finding, self._group = next(here, members[0]), store.group.name
        self._text.content = panel(
            finding_panel(merged, self._index + 1, self._index == 0, joints), "fv-finding"
        )
        self._card.content = card_html(merged.effect)
        what = "this effect" if len(members) == 1 else f"it on {merged.place(joints)}"
        off(self.add, store.why_not, f"adds {what}, identifies once and diagnoses again")
        self._show_evidence(self._finding)

    def _show_evidence(self, finding: Finding) -> None:
        there = finding.evidence is not None or finding.law is not None
        why = "" if there else "only screened briefly, so there is no evidence"
        if self._goals:
            why = "no torque was recorded through which its law could be drawn; see the tab Compare"
        off(self._toggle, why, "the law of this effect through its data")
        shown = self.opened and there
        self._toggle.label = "Hide evidence" if shown else "Show evidence"
        self._folder.visible = shown
        if shown:
            law = None if finding.law is None else law_chart(finding.law, HEIGHT)
            self._chart.show((law or evidence_chart(finding, self._group, height=HEIGHT),))

    def _switch(self) -> None:
        self.opened = not self.opened
        if self._finding is not None:
            self._show_evidence(self._finding)


class ModelList:
    """The model's effects, one row per kind, or joint by joint."""

    def __init__(self, page: Page, remove: Callable[[Sequence[str]], None]) -> None:
        self._effects: tuple[str, ...] = ()
        self._joints: tuple[str, ...] = ()
        self._shown: list[tuple[str, ...]] = []  # effects of each row
        self._families: Families = {}
        self._apart = False  # whether they are listed joint by joint
        self._why = ""
        self._remove = remove
        self._heading = ExplainedHtml(page.gui)
        self._rows = []
        for index in range(MAX_ROWS):
            text = ExplainedHtml(page.gui, visible=False)
            button = page.button("Remove", partial(self._pressed, index), visible=False)
            page.row((button,), share=0.3)
            self._rows.append((text, button))
        self._toggle = page.button(APART, self._switch, visible=False)

    def show(
        self,
        own: Sequence[str],
        added: Sequence[str],
        joints: tuple[str, ...],
        why: str,
        families: Families,
        goals: bool = False,
    ) -> None:
        """Show the set's own and the added effects.

        Args:
            own, added: texts of the effects.
            joints: all of the robot.
            why: the reason that none can be removed now.
            families: of those added effects that stand for one.
            goals: drive the joints.
        """
        self._effects, self._joints, self._why, self._families = tuple(added), joints, why, families
        self._list()
        text = f"the set's own: {', '.join(text_names(own, joints))}" if own else ""
        if not own and not added:
            text = f"{'gain' if goals else 'stiffness'}, inertia and viscous friction only"
        left = len(self._shown) - MAX_ROWS
        more = f" and {left} more" if left > 0 else ""
        self._heading.content = (
            f'<div class="fv"><b>In the model</b>{": " if text else ""}{escape(text)}{more}</div>'
        )

    def _list(self) -> None:
        together = merged_texts(self._effects, self._joints, self._families)
        self._apart &= len(together) < len(self._effects)
        self._toggle.visible = len(together) < len(self._effects)
        self._toggle.label = TOGETHER if self._apart else APART
        off(self._toggle, "", "effects of one kind on several joints, to remove one or all of them")
        self._shown = [(text,) for text in self._effects] if self._apart else together
        for index, (text, button) in enumerate(self._rows):
            texts = self._shown[index] if index < len(self._shown) else ()
            put(text, visible=bool(texts))
            put(button, visible=bool(texts))
            if texts:
                (name,) = text_names(texts, self._joints, self._families)
                text.content = f'<div class="fv fv-added">+ {escape(name)}</div>'
                what = "it" if len(texts) == 1 else "it from all these joints"
                off(button, self._why, f"removes {what}, refits and diagnoses again")

    def _switch(self) -> None:
        self._apart = not self._apart
        self._list()

    def _pressed(self, index: int) -> None:
        if index < len(self._shown):
            self._remove(self._shown[index])
