"""The gains of the extended-state observer, set by hand: a draft with its poles, used on request."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from flexviz.app.page import Page, off, put, warning
from flexviz.app.state import Changed, Turn
from flexviz.app.store import Store
from flexviz.app.style import half, label_width
from flexviz.errors import InputError
from flexviz.observers import CausalEso, EsoGains, binomial_gains, eso_poles, why_unusable
from flexviz.view import observer_for, poles_html
from flexviz.wording import escape

SIGNALS = ("θ", "τ")


def written(gain: float) -> str:
    """A gain with six digits, as short as possible: "1.92e7"."""
    return f"{gain:.6g}".replace("e+0", "e").replace("e+", "e")


class GainsPanel:
    """Fields for β1 … β6 of θ and τ; `preview` gets the draft, None where there is none."""

    def __init__(
        self, store: Store, page: Page, preview: Callable[[EsoGains | None], None], order: float
    ) -> None:
        self._store, self._preview = store, preview
        self._folder = page.gui.add_folder("Gains of the ESO", expand_by_default=False, order=order)
        with self._folder:
            page.gui.add_html('<div class="fv fv-dim">x̂̇ᵢ = x̂ᵢ₊₁ + βᵢ(y − x̂₁), for all joints</div>')
            self._same = page.checkbox("Same gains for θ and τ", True, lambda _: self._edited())
            page.style(label_width, self._same, "14em")
            self._fields = [[self._field(page, f"β{i} {signal}") for signal in SIGNALS] for i in range(1, 7)]
            self._poles = page.gui.add_html("")
            self._use = page.button("Use these gains", self._apply, color="blue")
            hint = "all six poles at −w, w the present bandwidth"
            self._back = page.button("Back to (s+w)^6", self._reset, hint=hint)
            page.row((self._use, self._back))
        store.subscribe(Changed.OPENED | Changed.OBSERVER | Changed.JOINT, self.refresh, Turn.CONTROLS)

    def _field(self, page: Page, label: str) -> Any:
        field = page.watch(page.gui.add_text(label, ""), lambda _: self._edited())
        page.style(half, field, "2.7em")
        return field

    def refresh(self) -> None:
        """Show the gains in use."""
        present = self._present()
        self._folder.visible = present is not None
        if present is None:
            self._drop()
            return
        for column, gains in enumerate((present.theta, present.tau)):
            for row, gain in zip(self._fields, gains, strict=True):
                put(row[column], value=written(gain))
        put(self._same, value=present.theta == present.tau)
        self._edited()

    def _present(self) -> EsoGains | None:
        """The gains in use on the selected joint; None for another observer."""
        analysis = self._store.analysis
        if analysis.observer != CausalEso.name:
            return None
        observer = observer_for(analysis.observer, analysis.bandwidth, self._store.joint, analysis.gains)
        return observer.gains or EsoGains.of(binomial_gains(float(observer.bandwidth)))  # type: ignore[arg-type]

    def _edited(self) -> None:
        """Show the draft's poles, and whether it can be used."""
        for row in self._fields:
            put(row[1], visible=not self._same.value)
        present = self._present()
        if present is None:
            return
        try:
            theta, tau = (
                self._typed(column, gains) for column, gains in enumerate((present.theta, present.tau))
            )
            tau = theta if self._same.value else tau
            why = next((f"gains of {s}: {w}" for s, g in zip(SIGNALS, (theta, tau), strict=True)
                        if (w := why_unusable(g))), "")  # fmt: skip
        except InputError as error:
            theta, tau, why = (), (), str(error)
        drawable = len(theta) and all(np.isfinite(g) and g > 0 for g in (*theta, *tau))
        refusal = warning(escape(f"Not used: {why}.")) if why else ""
        self._poles.content = refusal + (poles_html(eso_poles(theta), eso_poles(tau)) if drawable else "")
        self._draft = None if why or (theta, tau) == (present.theta, present.tau) else EsoGains(theta, tau)
        nothing = "these are the gains in use"
        off(self._use, why or ("" if self._draft else nothing), "for identification too")
        unset = self._store.analysis.gains is None and self._draft is None and not why
        off(self._back, "the poles are all at −w" if unset else "", "all six poles at −w, the bandwidth")
        self._preview(self._draft)

    def _typed(self, column: int, present: tuple[float, ...]) -> tuple[float, ...]:
        """The gains of θ or τ as typed; those in use where they are unchanged."""
        out = []
        for i, (row, gain) in enumerate(zip(self._fields, present, strict=True), 1):
            text = row[column].value.strip()
            try:
                out.append(gain if text == written(gain) else float(text))
            except ValueError:
                raise InputError(f'β{i} is "{text}", expected a number such as 2.4e4') from None
        return tuple(out)

    def _apply(self) -> None:
        self._edited()
        if self._draft is None:
            raise InputError("these gains cannot be used: see the note above the button")
        gains = self._draft
        self._drop()
        self._store.change("gains of the ESO", replace(self._store.analysis, gains=gains, bandwidth=None))

    def _reset(self) -> None:
        analysis = self._store.analysis
        self._drop()
        width = analysis.bandwidth
        if analysis.gains is not None and width is None:
            width = float(f"{analysis.gains.bandwidth:.4g}")
        self._store.change("poles of the ESO at −w", replace(analysis, gains=None, bandwidth=width))
        self.refresh()

    def _drop(self) -> None:
        self._draft: EsoGains | None = None
        self._preview(None)
