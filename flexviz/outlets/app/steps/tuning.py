"""What the present tuning of the observer costs, live: the residual of every joint and the trade."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flexviz.analysis.identification import ObservedResidual, ResidualPreview
from flexviz.base.errors import InputError
from flexviz.content.view import Cost, residuals_html, stretch, trade_chart
from flexviz.content.wording import escape, number
from flexviz.model.observers import EsoGains, make_observer
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import Page, dim, put, warning
from flexviz.outlets.app.residual_axis import before_after
from flexviz.outlets.app.state import Changed, LiveTuning, Turn
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.uplot import ChartColumn

LONGEST = 70_000  # samples of all joints that are evaluated while a slider is dragged
SLOW = 0.12  # [s] of processor time: longer evaluations wait until the slider rests
REST = 0.3  # [s] without a change
LEAST_TRIED, MOST_TRIED = 4, 200  # tunings from which a smallest residual is told; that are remembered
GRID = tuple(np.geomspace(5.0, 2000.0, 12).round(1).tolist())  # [rad/s] bandwidths that are tried when idle


class LiveResidual:
    """The residual of the identified model with the present observer; the model's values are kept."""

    def __init__(self, store: Store, page: Page, shown: Callable[[], bool]) -> None:
        self._store, self._page, self._shown = store, page, shown
        self._preview: ResidualPreview | None = None
        self._of: tuple[object, ...] = ()  # what the preview belongs to
        self._trade: dict[float, Cost] = {}
        self._trade_of: tuple[object, ...] = ()
        self._rms: list[np.ndarray] = []  # (n,) residuals of every tuning that was tried [Nm]
        self._rms_of: tuple[object, ...] = ()
        self._failed: set[float] = set()  # bandwidths of the grid that cannot be used
        self._observer = make_observer(store.analysis.fit.observer)  # as drawn
        self._found: ObservedResidual | None = None  # as drawn
        self._took = 0.0  # [s] of processor time, the last evaluation
        self._touched = 0.0  # the last change [s, monotonic]
        self._due: float | None = None  # when a slow evaluation is due [s, monotonic]
        self._draft: EsoGains | None = None  # gains to show instead of those in use
        self._head, self._grid = ExplainedHtml(page.gui), page.gui.add_html("")
        self._folder = page.gui.add_folder(None, visible=False)
        self._charts = ChartColumn(page.server, self._folder)
        selected = Changed.OPENED | Changed.JOINT | Changed.GROUP | Changed.STEP
        store.subscribe(selected | Changed.OBSERVER | Changed.RESULT, self._changed, Turn.CONTROLS)
        store.subscribe(Changed.TICK, self._tick)

    @property
    def below(self) -> float:
        """Place of a folder between the residuals and the trade."""
        return self._grid.order + 0.5

    def show_draft(self, draft: EsoGains | None) -> None:
        """Show the residual with gains that are not used yet; None: with the observer as set."""
        if draft != self._draft:
            self._draft = draft
            self._changed()

    def _changed(self) -> None:
        """Evaluate and draw at once, or when the slider rests if that takes long."""
        if not self._shown():
            if self._store.live is not None:
                self._store.set_live(None)
            return
        self._touched = time.monotonic()
        if self._took > SLOW and self._preview is not None and self._of == self._now():
            self._due = self._touched + REST
        else:
            self._draw()

    def _tick(self) -> None:
        if self._due is not None:
            if time.monotonic() >= self._due:
                self._draw()
        elif self._shown() and not self._store.running and time.monotonic() - self._touched > REST:
            self._fill_trade()

    def _now(self) -> tuple[object, ...]:
        return self._store.analysis.identification, self._store.group

    def _draw(self) -> None:
        self._due = None
        store, analysis = self._store, self._store.analysis
        if analysis.identification is None:
            self._store.set_live(None)
            self._show(dim("After Run (step Identify) the residual is shown here while you drag."))
            return
        tuning = analysis.used_tuning if self._draft is None else (analysis.fit.observer, None, self._draft)
        self._observer = observer = make_observer(*tuning)
        begin = time.thread_time()
        try:
            found = self._prepared().at(observer)
        except InputError as error:
            self._show(warning(escape(str(error))))
            return
        finally:
            self._took = time.thread_time() - begin
        self._remember(found.rms)
        self._store.set_live(LiveTuning(store.group.name, found, self._draft))
        if isinstance(observer.bandwidth, float) and self._draft is None:
            self._keep(observer.bandwidth, Cost(found.rms, found.noise_floor))
        lag = f"{number(1000 * observer.lag(store.group.segments[0].step), 3)} ms lag"
        tried = f" with the gains below, not used yet ({lag})" if self._draft else ""
        span = f"{number(found.time[0], 3)} to {number(found.time[-1], 3)} s"
        head = (
            f'<div class="fv fv-tuned"><b>Residual with this observer</b>{tried} '
            f'<span class="fv-dim">in group {escape(store.group.name)}, {span}; parameters kept. Below each '
            "joint: rms residual / noise. × least: rms against the best tuning tried.</span></div>"
        )
        self._found = found
        self._show(head, self._cards())
        self._draw_trade()

    def _cards(self) -> str:
        """The residual of every joint, and how far it is from the smallest one."""
        store, joints = self._store, self._store.measurements.joints
        fits, spread = before_after(store), store.measurements.torque_spread
        ends = [fits.largest(store.group.name, joint) for joint in range(len(joints))]
        least = np.min(self._rms, axis=0) if len(self._rms) >= LEAST_TRIED else ()
        assert self._found is not None
        return residuals_html(self._found, joints, store.joint, ends, least, spread)

    def _remember(self, rms: np.ndarray) -> None:
        now = (*self._now(), self._store.analysis.fit.observer)
        if now != self._rms_of:
            self._rms, self._rms_of = [], now
        self._rms.append(rms)
        if len(self._rms) > MOST_TRIED:
            self._rms = [np.min(self._rms, axis=0)] * LEAST_TRIED

    def _show(self, head: str, grid: str = "") -> None:
        with self._page.server.atomic():
            self._head.content, self._grid.content = head, grid
            put(self._folder, visible=bool(grid) and len(self._trade) > 1)

    def _prepared(self) -> ResidualPreview:
        """The preview of the present result and group."""
        if self._preview is None or self._of != self._now():
            store, fitted = self._store, self._store.analysis.fitted
            result = store.analysis.identification
            assert result is not None
            longest = LONGEST // store.measurements.n
            parts, _ = stretch(store.group.segments, store.clock.time, longest)
            group = replace(store.group, segments=tuple(parts))
            effects = fitted.effects if fitted else ()
            self._preview = ResidualPreview(store.measurements, group, result.model, effects)
            self._of = self._now()
        return self._preview

    def _keep(self, bandwidth: float, cost: Cost) -> None:
        analysis = self._store.analysis
        now = (*self._now(), analysis.fit.observer, analysis.fit.gains)
        if now != self._trade_of:
            self._trade, self._trade_of, self._failed = {}, now, set()
        self._trade[bandwidth] = cost

    def _fill_trade(self) -> None:
        """Evaluate one more bandwidth of the grid."""
        analysis = self._store.analysis
        if self._took > SLOW or self._trade_of != (*self._now(), analysis.fit.observer, analysis.fit.gains):
            return
        rest = [width for width in GRID if width not in self._trade and width not in self._failed]
        if not rest or self._preview is None or self._draft is not None:
            return
        try:
            found = self._preview.at(make_observer(analysis.fit.observer, rest[0], analysis.fit.gains))
        except InputError:
            self._failed.add(rest[0])
            return
        self._trade[rest[0]] = Cost(found.rms, found.noise_floor)
        self._remember(found.rms)
        self._grid.content = self._cards()
        self._draw_trade()

    def _draw_trade(self) -> None:
        store = self._store
        present = float(self._observer.bandwidth_of(store.measurements.n)[store.joint])
        self._charts.show((trade_chart(self._trade, store.joint, store.joint_name, present),))
        put(self._folder, visible=len(self._trade) > 1)
