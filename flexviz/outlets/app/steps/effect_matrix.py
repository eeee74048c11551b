"""The effects of the model as a matrix of joints and effects, and a row of controls that changes it."""

from __future__ import annotations

from flexviz.content.view import by_title, joint_effects, joints_with, matrix_html, with_joints
from flexviz.content.wording import short_names
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import Page
from flexviz.outlets.app.state import Changed, Turn
from flexviz.outlets.app.store import Store


class EffectMatrix:
    """Shows which joint has which effect; a press on a joint adds the chosen effect there, or removes it."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store = store
        gui = page.gui
        self._table = ExplainedHtml(gui)
        with gui.add_folder("Joint by joint", expand_by_default=False):
            self._effects = by_title(joint_effects())
            self._effect = page.dropdown("Effect", tuple(self._effects))
            hint = "adds the effect above to this joint, or takes it away"
            self._buttons = page.choose(gui.add_button_group("on joint", ("–",), hint=hint), self._toggle)
        store.subscribe(Changed.OPENED, self._opened, Turn.CONTROLS)
        store.subscribe(Changed.OPENED | Changed.ANALYSIS, self._refresh, Turn.CONTROLS)

    def _opened(self) -> None:
        self._effects = by_title(joint_effects(self._store.measurements.drive is not None))
        self._effect.options = tuple(self._effects)
        self._names = dict(
            zip(short_names(self._store.measurements.joints), self._store.measurements.joints, strict=True)
        )
        self._buttons.options = tuple(self._names)

    def _refresh(self) -> None:
        measurements = self._store.measurements
        self._table.content = matrix_html(
            measurements.effects, self._store.analysis.effects, measurements.joints
        )

    def _toggle(self, short: str) -> None:
        store, title, joint = self._store, self._effect.value, self._names[short]
        effect = self._effects[title]
        joints, own = store.measurements.joints, store.measurements.effects
        if joint in joints_with(effect, own, joints):
            store.say(f"{title} on {joint} is named by the set and stays in", "bad")
            return
        chosen = set(joints_with(effect, store.analysis.effects, joints)) ^ {joint}
        effects = with_joints(effect, tuple(chosen), store.analysis.effects, joints)
        what = "with" if joint in chosen else "without"
        store.change(f"{what} {title} on {joint}", store.analysis.with_fit(effects=effects))
