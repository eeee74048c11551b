"""The legend of the scene, in a corner of the canvas."""

from __future__ import annotations

from flexviz.analysis.diagnosis import PredictionErrors
from flexviz.analysis.diagnosis import Step as DiagnosisStep
from flexviz.content.session import standing
from flexviz.content.view import (
    OF_EARLIER,
    LinkColours,
    joints_html,
    legend_html,
    link_colours,
    model_name,
    name_with_error,
)
from flexviz.content.wording import driving_signal, finding_title
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import Page
from flexviz.outlets.app.state import Changed, Turn
from flexviz.outlets.app.store import Store

WIDTH = 310  # [pixels]


def model_names(store: Store) -> tuple[str, ...]:
    """What the models on the screen are called; of several each has its number and error."""
    now = standing(store.analysis)
    earlier = f", {OF_EARLIER}" if now.fit == "earlier" else ""
    if store.beside is None:
        return (f"identified{earlier}",)
    models = [step for step, _ in store.chain]
    joints, spread = store.measurements.joints, store.measurements.torque_spread
    names = [
        model_name(models, joints, number, spread)
        for number in (len(store.analysis.model_steps) - 1, store.view.beside or 0)
    ]
    shown = names[0] if now.errors == "verdict" else name_with_error("Run", store.errors, spread)
    return f"{shown}{earlier}", names[1]


def colours_of(store: Store, errors: PredictionErrors | DiagnosisStep | None) -> LinkColours | None:
    """Colours of the links by a model's errors; their scale ends at the largest error of all models."""
    known = [*(one.errors for one in store.kept), *(one.step for one in store.analysis.model_steps)]
    earlier = [one for one in known if one is not None]
    return link_colours(errors, store.measurements.torque_spread, earlier)


class LegendPanel:
    """Colours of robots and links; error, torque and deflection of every joint, while they play."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store = store
        panel = page.gui.add_panel()
        with panel.add_tab("Legend"):
            self._robots = ExplainedHtml(page.gui)
            self._joints = page.gui.add_html("")
        panel.float(x=12, y=12, width=WIDTH)
        results = Changed.ANALYSIS | Changed.DERIVED
        shown = Changed.OPENED | Changed.JOINT | Changed.GROUP | Changed.VIEW | results
        store.subscribe(shown, self._draw, Turn.CONTROLS)
        store.subscribe(Changed.TICK, self._draw_joints, Turn.CONTROLS)

    def _draw(self) -> None:
        store, motion = self._store, self._store.motion
        found, signal = colours_of(store, store.errors), driving_signal(store.measurements.drive is not None)
        names = model_names(store)
        self._robots.content = legend_html(found, names, store.view.arcs, motion.rigid, signal)
        diagnosis = store.analysis.current_diagnosis
        findings = diagnosis.findings if diagnosis and standing(store.analysis).verdict == "present" else ()
        missing = {one.joint: finding_title(one) for one in reversed(findings) if one.joint}
        self._drawn = (
            (store.measurements.joints, found, motion),
            (store.joint, missing, store.measurements.torque_units, signal),
        )
        self._at = -1.0
        self._draw_joints()

    def _draw_joints(self) -> None:
        """Draw the table, if the instant has changed."""
        now = round(self._store.clock.time, 2)
        if now != self._at:
            self._at, (drawn, chosen) = now, self._drawn
            self._joints.content = joints_html(*drawn, now, *chosen)
