"""The motion that would decide between two effects that a diagnosis cannot tell apart."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

from flexviz.analysis.designing import Design, DesignSettings, design, design_facts, design_files
from flexviz.analysis.diagnosis import Diagnosis
from flexviz.base.errors import InputError
from flexviz.base.files import zipped
from flexviz.base.progress import Progress, ProgressCallback, StopCallback
from flexviz.content.session import Analysis
from flexviz.content.wording import effect_text_name, escape
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import Page, dim, off
from flexviz.outlets.app.sets import chosen_set
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.tasks import SetTask
from flexviz.robot.model import EffectValue

DECIDE, DOWNLOAD, FILE = "Motion that would decide", "Download the motion", "deciding-motion.zip"
SETTINGS = DesignSettings(groups=1, evaluations=240, passes=1)
STOPPED = "stopped before there was a motion"
NEXT = "Record this motion on the robot, add it to the set as one more group, and diagnose again."

Pair = tuple[str, str]


@dataclass(frozen=True)
class DesignDecision(SetTask[Design]):
    """Design one more group that tells two effects apart; when stopped, the best one so far."""

    analysis: Analysis
    pair: Pair

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> Design:
        measurements = chosen_set(self.analysis)
        return design(
            measurements,
            separate=self.pair,
            effects=self.analysis.effects,
            settings=SETTINGS,
            progress=lambda news: progress(replace(news, iteration=None)),
            should_stop=should_stop,
        )


def tied_pair(diagnosis: Diagnosis | None) -> Pair | None:
    """The first finding with an effect that the data cannot tell from it, and that effect."""
    for finding in diagnosis.findings if diagnosis is not None else ():
        for tie in finding.inseparable_from:
            return finding.text, EffectValue(tie.effect, tie.joint).text
    return None


class DecidingMotion:
    """The buttons that design and send the motion, and what it is expected to show."""

    def __init__(self, page: Page, store: Store) -> None:
        self._page, self._store = page, store
        self._found: tuple[Pair, Design] | None = None
        self.button = page.button(DECIDE, self._start, visible=False)
        self.download = page.client_button(DOWNLOAD, self._send, visible=False)
        page.row((self.button, self.download))
        self._text = ExplainedHtml(page.gui, visible=False)

    def refresh(self) -> None:
        """Show what belongs to the present diagnosis."""
        pair = tied_pair(self._store.analysis.current_diagnosis)
        self.button.visible = pair is not None
        known = self._found is not None and self._found[0] == pair
        self.download.visible = self._text.visible = known
        if pair is not None:
            names = " and ".join(effect_text_name(text) for text in pair)
            off(self.button, self._store.why_not, f"one more group, within the URDF's limits, for {names}")
        off(self.download, "", "references as CSV and ROS 2 trajectory, with the expected errors")
        if known and self._found is not None:
            plan, _ = design_facts(self._found[1])
            lines = plan.text.splitlines()
            self._text.content = dim("<br>".join([NEXT, *(escape(line) for line in lines if line)]))

    def _start(self) -> None:
        store, pair = self._store, tied_pair(self._store.analysis.current_diagnosis)
        if pair is None:
            raise InputError("the diagnosis found no two effects that look alike")
        if not store.may_start("Designing a motion"):
            return
        task = DesignDecision(store.analysis.without_result(), pair)
        done = partial(self._take, pair)
        store.await_task(task, done, begin="designing a motion", stopped=STOPPED, progress=self._progress)

    def _progress(self, news: Progress) -> None:
        self._store.report(replace(news, text=news.text or "designing a motion"))

    def _take(self, pair: Pair, found: Design) -> None:
        self._found = pair, found
        self.refresh()
        early = "stopped early; the best motion so far" if found.stopped else "a motion was designed"
        self._store.say(f"{early}: download it, record it, diagnose again")

    def _send(self, client: int) -> None:
        if self._found is None:
            raise InputError(f"no motion is designed yet: press {DECIDE}")
        self._page.send_file(client, FILE, zipped(design_files(self._found[1]).items()))
