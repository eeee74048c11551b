"""The gains of the extended-state observer, set by hand: a draft with its poles, used on request."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.base.arrays import Array
from flexviz.base.errors import InputError
from flexviz.content.view import observer_for, pole_at, poles_html
from flexviz.content.wording import escape, number
from flexviz.model.observers import (
    LARGEST_MULTIPLIER,
    LEAST_MULTIPLIER,
    CausalEso,
    EsoGains,
    binomial_gains,
    eso_poles,
    move_pole,
    multiplied,
    multipliers,
    multipliers_of_poles,
    why_unusable,
)
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import Page, off, put, warning
from flexviz.outlets.app.page_script import POLE_LABEL
from flexviz.outlets.app.state import Changed, Turn
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.style import hidden, label_width

SIGNALS = ("θ", "τ")
STEP = 0.01  # of a multiplier's slider
SAME = 1e-9  # relative difference of gains that are the same
MOVED = re.compile(
    r"(\d{1,9}) (θ|τ) ([0-5]) (-?\d{1,4}\.\d) (-?\d{1,4}\.\d)"
)  # number of the drag, pole, place


class GainsPanel:
    """Multipliers of β1 … β6 of θ and τ, and their poles; `preview` gets the draft, or None."""

    def __init__(
        self, store: Store, page: Page, preview: Callable[[EsoGains | None], None], order: float
    ) -> None:
        self._store, self._preview = store, preview
        self._draft: EsoGains | None = None
        self._width = 1.0  # w, to which the multipliers refer [rad/s]
        self._factors: list[Array] = [np.ones(6), np.ones(6)]  # multipliers of θ and of τ
        self._drag: tuple[str, NDArray[np.complex128]] = (
            "",
            np.zeros(0, complex),
        )  # its number and signal, the poles at its start
        self._refused = ""  # why the dragged pole stays
        self._folder = page.gui.add_folder("Gains of the ESO", expand_by_default=False, order=order)
        with self._folder:
            ExplainedHtml(
                page.gui,
                '<div class="fv fv-dim">x̂̇ᵢ = x̂ᵢ₊₁ + βᵢ(y − x̂₁), for all joints. The sliders multiply the '
                "gains of (s+w)⁶; drag a pole to set them all.</div>",
            )
            self._same = page.checkbox("Same gains for θ and τ", True, lambda _: self._edited())
            page.style(label_width, self._same, "14em")
            self._sliders = [[self._slider(page, i, s) for s in range(2)] for i in range(6)]
            self._poles = page.gui.add_html("")
            moved = page.watch(page.gui.add_text(POLE_LABEL, ""), self._moved)
            page.style(hidden, moved)
            self._use = page.button("Use these gains", self._apply, color="blue")
            hint = "all six poles at −w, w the present bandwidth"
            self._back = page.button("Back to (s+w)^6", self._reset, hint=hint)
            page.row((self._use, self._back))
        store.subscribe(Changed.OPENED | Changed.OBSERVER | Changed.JOINT, self.refresh, Turn.CONTROLS)

    def _slider(self, page: Page, gain: int, signal: int) -> Any:
        label = f"β{gain + 1} {SIGNALS[signal]} ×"
        slider = page.gui.add_slider(label, LEAST_MULTIPLIER, LARGEST_MULTIPLIER, STEP, 1.0)
        return page.watch(slider, partial(self._set, gain, signal))

    def refresh(self) -> None:
        """Show the gains in use; as long as only w changes, the multipliers stay."""
        present = self._present()
        self._folder.visible = present is not None
        if present is None:
            self._drop()
            return
        width = present.bandwidth / self._factors[0][-1] ** (1 / 6)
        if not all(np.allclose(multiplied(f, width), g, rtol=1e-6)
                   for f, g in zip(self._factors, (present.theta, present.tau), strict=True)):  # fmt: skip
            width = present.bandwidth
            self._factors = [multipliers(gains, width) for gains in (present.theta, present.tau)]
        self._width = width
        put(self._same, value=present.theta == present.tau)
        self._refused = ""
        self._edited()

    def _present(self) -> EsoGains | None:
        """The gains in use on the selected joint; None for another observer."""
        analysis = self._store.analysis
        if analysis.fit.observer != CausalEso.name:
            return None
        observer = observer_for(
            analysis.fit.observer, analysis.fit.bandwidth, self._store.joint, analysis.fit.gains
        )
        return observer.gains or EsoGains.of(binomial_gains(float(observer.bandwidth)))  # type: ignore[arg-type]

    def _set(self, gain: int, signal: int, factor: float) -> None:
        """Take a multiplier from its slider."""
        self._factors[signal] = self._factors[signal].copy()
        self._factors[signal][gain], self._refused = factor, ""
        self._edited()

    def _moved(self, text: str) -> None:
        """Move a pole as the page's script tells: "1 θ 0 120.0 80.0"."""
        found = MOVED.fullmatch(text)
        if found is None:
            raise InputError(f'the pole was moved to "{text[:40]}", expected such as "1 θ 0 120.0 80.0"')
        number_, name, index, x, y = found.groups()
        signal, drag = SIGNALS.index(name), f"{number_} {name}"
        if drag != self._drag[0]:
            self._drag = drag, eso_poles(multiplied(self._factors[signal], self._width))
        to, self._refused = pole_at(float(x), float(y), self._width), ""
        try:
            poles = move_pole(self._drag[1], int(index), to, self._width)
            self._factors[signal] = multipliers_of_poles(poles, self._width)
        except InputError as error:
            self._refused = f"The pole stays: {error}."
        self._edited()

    def _edited(self) -> None:
        """Show the draft's multipliers and poles, and whether it can be used."""
        present = self._present()
        if present is None:
            return
        if self._same.value:
            self._factors[1] = self._factors[0]
        for i, row in enumerate(self._sliders):
            put(row[1], visible=not self._same.value)
            for slider, factors in zip(row, self._factors, strict=True):
                shown = min(max(round(float(factors[i]), 2), LEAST_MULTIPLIER), LARGEST_MULTIPLIER)
                put(slider, value=shown)
        theta, tau = (multiplied(factors, self._width) for factors in self._factors)
        why = next((f"gains of {s}: {w}" for s, g in zip(SIGNALS, (theta, tau), strict=True)
                    if (w := why_unusable(g))), "")  # fmt: skip
        told = warning(escape(f"Not used: {why}.")) if why else ""
        told += warning(escape(self._refused)) if self._refused else ""
        gains = ", ".join(number(gain, 3) for gain in theta)
        self._poles.content = (
            f'{told}{poles_html(eso_poles(theta), eso_poles(tau), self._width)}<div class="fv fv-dim">'
            f"w {number(self._width, 3)} rad/s; β of θ: {gains}</div>"
        )
        used = np.allclose((theta, tau), (present.theta, present.tau), rtol=SAME)
        self._draft = None if why or used else EsoGains(theta, tau)
        nothing = "these are the gains in use"
        off(self._use, why or ("" if self._draft else nothing), "for identification too")
        unset = self._store.analysis.fit.gains is None and self._draft is None and not why
        off(self._back, "the poles are all at −w" if unset else "", "all six poles at −w, the bandwidth")
        self._preview(self._draft)

    def _apply(self) -> None:
        self._edited()
        if self._draft is None:
            raise InputError("these gains cannot be used: see the note above the button")
        gains = self._draft
        self._drop()
        self._store.change("gains of the ESO", self._store.analysis.with_fit(gains=gains, bandwidth=None))

    def _reset(self) -> None:
        analysis = self._store.analysis
        width = analysis.fit.bandwidth
        if analysis.fit.gains is not None and width is None:
            width = float(f"{self._width:.4g}")
        self._factors = [np.ones(6), np.ones(6)]
        self._drop()
        self._store.change("poles of the ESO at −w", analysis.with_fit(gains=None, bandwidth=width))
        self.refresh()

    def _drop(self) -> None:
        self._draft = None
        self._preview(None)
