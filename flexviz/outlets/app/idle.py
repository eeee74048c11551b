"""Idle work: errors, laws, simulated motion and residual maps of the identified model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from flexviz.analysis.laws import LawThroughData
from flexviz.base.jobs import Result
from flexviz.content.records import ResidualMap
from flexviz.content.session import runs
from flexviz.outlets.app.state import Changed, Derived, Turn
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.tasks import DrawLaws, IdleTask, JudgeErrors, MapResiduals, Replay


class IdleWork:
    """Computes what the current result lacks; restarts interrupted tasks."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._under_way: dict[type[IdleTask[Any]], tuple[Derived, str]] = {}  # result; entry
        missing = Changed.OPENED | Changed.GROUP | Changed.RESULT | Changed.DERIVED | Changed.ACTIVITY
        missing |= Changed.VIEW  # another model beside the shown one
        store.subscribe(missing, self._fill, Turn.WORK)

    def _fill(self) -> None:
        store, derived, analysis = self._store, self._store.derived, self._store.analysis
        result, group, fitted = derived.result, store.group.name, analysis.fitted
        if result is None or store.running:
            return

        def mapped(maps: tuple[ResidualMap, ...]) -> None:
            derived.maps = maps

        def drawn(laws: tuple[LawThroughData, ...]) -> None:
            derived.laws = laws

        for state in (analysis, *runs(store.session)):  # runs of a session that was opened are judged anew
            of, task = store.kept.keep(state.identification), JudgeErrors.of(state)
            if of.errors is None and "errors" not in of.failed and task is not None:
                self._start(task, of, "errors", of.judge)
                break
        if derived.laws is None and "laws" not in derived.failed and fitted is not None:
            settings = replace(analysis.without_result().with_fit(effects=fitted.effects), roles=fitted.roles)
            self._start(DrawLaws(settings, result.model, result.chance_covariance), derived, "laws", drawn)
        beside = (store.beside[1],) if store.beside else ()
        for one in (derived, *beside):
            if one.result is not None and group not in one.replays and group not in one.failed:
                keep = partial(one.replays.__setitem__, group)
                self._start(Replay(analysis.path, one.result.model, group), one, group, keep)
                break
        if not store.maps and "maps" not in derived.failed and fitted is not None:
            settings = replace(analysis.without_result().with_fit(effects=fitted.effects), roles=fitted.roles)
            self._start(MapResiduals(settings, result.model), derived, "maps", mapped)

    def _start(
        self, task: IdleTask[Result], derived: Derived, entry: str, keep: Callable[[Result], None]
    ) -> None:
        """Start a task for an entry of a result, unless it is already running."""
        store, kind, running = self._store, type(task), (derived, entry)
        if self._under_way.get(kind) == running:
            return

        def end() -> None:
            if self._under_way.get(kind) is running:
                del self._under_way[kind]

        def done(result: Result) -> None:
            end()
            keep(result)
            store.tell(Changed.DERIVED)

        def failed(reason: str) -> None:
            end()
            derived.failed.add(entry)
            if store.kept.of(derived.result) is derived:
                what = {"maps": "mapped", "laws": "drawn", "errors": "judged"}.get(entry, "simulated")
                store.fail(f"the identified model could not be {what}: {reason}")
                store.tell(Changed.DERIVED)

        store.tasks.stop(kind)
        self._under_way[kind] = running
        store.tasks.start(task, done, failed=failed, stopped=end)
