"""Step 2, Observer: the filter that differentiates θ and τ, and its bandwidth."""

from __future__ import annotations

import math
from dataclasses import replace

from flexviz.app.change import Changed, Turn
from flexviz.app.page import dim
from flexviz.app.steps.step import WorkflowStep
from flexviz.app.steps.sweep import BandwidthSweep
from flexviz.app.style import no_number_box
from flexviz.observers import OBSERVERS, Observer, make_observer
from flexviz.view import numbers_html, observer_for, observer_numbers, sweep_bandwidths
from flexviz.wording import escape, number

LOWEST, HIGHEST = 5.0, 2000.0  # [rad/s] limits of the bandwidth
MARKS = (5.0, 20.0, 100.0, 500.0, 2000.0)


class ObserverStep(WorkflowStep):
    """Observer type and bandwidth; lag and noise gain as numbers; the sweep."""

    title = "Observer"

    def build(self) -> None:
        """Type, bandwidth as slider and number, numbers, sweep."""
        page, gui = self.page, self.page.gui
        names = tuple(OBSERVERS)
        self._type = page.watch(
            gui.add_dropdown("Observer type", names, initial_value=names[0]), self._choose
        )
        self._slider = page.watch(
            gui.add_slider(
                "Bandwidth [rad/s]", math.log10(LOWEST), math.log10(HIGHEST), 0.01, math.log10(50.0),
                marks=tuple((math.log10(mark), f"{mark:g}") for mark in MARKS),
                hint="logarithmic; the states on the right are updated immediately",
            ),
            lambda exponent: self._set_bandwidth(10.0**exponent),
        )  # fmt: skip
        self._exact = page.watch(
            gui.add_number(
                "exactly",
                50.0,
                min=LOWEST,
                max=HIGHEST,
                step=0.1,
                hint="the same bandwidth [rad/s] as a number",
            ),
            self._set_bandwidth,
        )
        self._single = page.watch(
            gui.add_checkbox(
                "Only this joint", False, hint="sets the selected joint's bandwidth only, not every joint's"
            )
        )
        page.button("Use the observer's own bandwidth", self._use_default)
        self._numbers = gui.add_html("")
        self.sweep = BandwidthSweep(self.store, page, self._around, self._set_bandwidth)
        page.style(no_number_box, self._slider)
        page.command("Use the observer's own bandwidth", self._use_default)
        self.store.subscribe(Changed.JOINT, self.refresh, Turn.CONTROLS)

    def refresh(self) -> None:
        """Show the observer, its bandwidth and its numbers."""
        store, analysis = self.store, self.store.analysis
        observer = self._present()
        width = float(observer.bandwidth)  # type: ignore[arg-type]
        self._type.value = analysis.observer
        shown = min(max(width, LOWEST), HIGHEST)
        if abs(10.0**self._slider.value / shown - 1.0) > 0.005:
            self._slider.value = math.log10(shown)
        self._exact.value = float(f"{shown:.4g}")
        where, listed = " (its own)" if analysis.bandwidth is None else "", ""
        if isinstance(analysis.bandwidth, tuple):
            pairs = zip(store.measurements.joints, analysis.bandwidth, strict=False)
            widths = ", ".join(f"{escape(joint)} {number(each, 3)}" for joint, each in pairs)
            where, listed = " on this joint", dim(f"Per joint [rad/s]: {widths}.")
        self._numbers.content = (
            f'<div class="fv"><b>{OBSERVERS[analysis.observer].title}</b>, '
            f"bandwidth {number(width, 4)} rad/s{where}</div>"
            + listed
            + numbers_html(observer_numbers(observer, store.group.segments[0].step))
        )

    def _present(self) -> Observer:
        analysis = self.store.analysis
        return observer_for(analysis.observer, analysis.bandwidth, self.store.joint)

    def _around(self) -> tuple[float, ...]:
        return sweep_bandwidths(float(self._present().bandwidth), LOWEST, HIGHEST)  # type: ignore[arg-type]

    def _choose(self, name: str) -> None:
        make_observer(name)
        self.store.change(f"observer {name}", replace(self.store.analysis, observer=name))

    def _set_bandwidth(self, bandwidth: float) -> None:
        """Use a bandwidth [rad/s], for all joints or only the selected one."""
        width = float(f"{min(max(bandwidth, LOWEST), HIGHEST):.4g}")
        store, analysis, n = self.store, self.store.analysis, self.store.measurements.n
        if not self._single.value or n == 1:
            store.change("bandwidth", replace(analysis, bandwidth=width))
            return
        present = [observer_for(analysis.observer, analysis.bandwidth, joint) for joint in range(n)]
        widths = [float(observer.bandwidth) for observer in present]  # type: ignore[arg-type]
        widths[store.joint] = width
        store.change(f"bandwidth of {store.joint_name}", replace(analysis, bandwidth=tuple(widths)))

    def _use_default(self) -> None:
        self.store.change("the observer's own bandwidth", replace(self.store.analysis, bandwidth=None))
