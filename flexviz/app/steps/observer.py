"""Step 2, Observer: which filter turns θ and τ into derivatives, and how wide it is."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from flexviz.app.controls import watch
from flexviz.app.steps.sweep import Sweep
from flexviz.app.style import no_number_box
from flexviz.observers import OBSERVERS, Observer, make_observer
from flexviz.view import numbers_html, observer_for, observer_numbers, sweep_bandwidths
from flexviz.wording import escape, number

if TYPE_CHECKING:
    from flexviz.app.application import Application

LOWEST, HIGHEST = 5.0, 2000.0  # [rad/s]
MARKS = (5.0, 20.0, 100.0, 500.0, 2000.0)


class ObserverStep:
    """Observer type and bandwidth; lag and noise gain as numbers; the sweep."""

    def __init__(self, app: Application) -> None:
        self._app = app
        gui = app.server.gui
        names = tuple(OBSERVERS)
        self.folder = gui.add_folder(None, visible=False)
        with self.folder:
            self._type = gui.add_dropdown("Observer type", names, initial_value=names[0])
            self._bandwidth = gui.add_slider(
                "Bandwidth [rad/s]", math.log10(LOWEST), math.log10(HIGHEST), 0.01, math.log10(50.0),
                marks=tuple((math.log10(mark), f"{mark:g}") for mark in MARKS),
                hint="logarithmic; the states on the right follow at once",
            )  # fmt: skip
            self._exact = gui.add_number(
                "exactly", 50.0, min=LOWEST, max=HIGHEST, step=0.1, hint="the same bandwidth [rad/s], typed"
            )
            self._single = gui.add_checkbox(
                "Only this joint", False, hint="the bandwidth is the selected joint's alone; else all joints'"
            )
            self._default = gui.add_button("Use the observer's own bandwidth", color="gray")
            self._numbers = gui.add_html("")
            self.sweep = Sweep(app, self._around, self._set)
        app.add_style(no_number_box(self._bandwidth._impl.uuid))
        watch(self._type, app.queue, "observer")
        watch(self._bandwidth, app.queue, "bandwidth-log")
        watch(self._exact, app.queue, "bandwidth")
        watch(self._single, app.queue, "bandwidth-single")
        app.on("bandwidth-single", lambda _: None)
        app.press(self._default, "bandwidth-default", self.take_own)
        app.on("observer", self._observer)
        app.on("bandwidth-log", lambda value: self._set(10.0**value))
        app.on("bandwidth", self._set)

    def opened(self) -> None:
        """A new set is shown."""
        self.sweep.opened()
        self.refresh()

    def refresh(self) -> None:
        """Show the session's observer, its bandwidth and its numbers."""
        analysis = self._app.session.analysis
        observer = self._present()
        width = float(observer.bandwidth)  # type: ignore[arg-type]
        self._type.value = analysis.observer
        shown = min(max(width, LOWEST), HIGHEST)
        if abs(10.0**self._bandwidth.value / shown - 1.0) > 0.005:
            self._bandwidth.value = math.log10(shown)
        self._exact.value = float(f"{shown:.4g}")
        own = " (its own)" if analysis.bandwidth is None else ""
        numbers = observer_numbers(observer, self._app.show.group.segments[0].step)
        each = ""
        if isinstance(analysis.bandwidth, tuple):
            names = zip(self._app.measurements.joints, analysis.bandwidth, strict=False)
            listed = ", ".join(f"{escape(joint)} {number(w, 3)}" for joint, w in names)
            own, each = " on this joint", f'<div class="fv fv-dim">One a joint [rad/s]: {listed}.</div>'
        self._numbers.content = (
            f'<div class="fv"><b>{OBSERVERS[analysis.observer].title}</b>, '
            f"bandwidth {number(width, 4)} rad/s{own}</div>" + each + numbers_html(numbers)
        )
        self.sweep.refresh()

    def _present(self) -> Observer:
        analysis = self._app.session.analysis
        return observer_for(analysis.observer, analysis.bandwidth, self._app.show.joint)

    def _around(self) -> tuple[float, ...]:
        return sweep_bandwidths(float(self._present().bandwidth), LOWEST, HIGHEST)  # type: ignore[arg-type]

    def _observer(self, name: str) -> None:
        make_observer(name)
        self._app.change(f"observer {name}", replace(self._app.session.analysis, observer=name))

    def _set(self, bandwidth: float) -> None:
        width = float(f"{min(max(bandwidth, LOWEST), HIGHEST):.4g}")
        analysis, app = self._app.session.analysis, self._app
        if not self._single.value or app.measurements.n == 1:
            app.change("bandwidth", replace(analysis, bandwidth=width))
            return
        present = [observer_for(analysis.observer, analysis.bandwidth, j) for j in range(app.measurements.n)]
        each = [float(observer.bandwidth) for observer in present]  # type: ignore[arg-type]
        each[app.show.joint] = width
        joint = app.measurements.joints[app.show.joint]
        app.change(f"bandwidth of {joint}", replace(analysis, bandwidth=tuple(each)))

    def take_own(self) -> None:
        """Use the observer's own bandwidth."""
        self._app.change("the observer's own bandwidth", replace(self._app.session.analysis, bandwidth=None))
