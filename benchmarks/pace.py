"""How much of a diagnosis is done when each of its stages begins, and whether the time left was true.

    python -m benchmarks.pace SET …

prints, for every set, the share of the processor time at each stage of `STAGE_SHARES`, then how often the
time left that was told from the first third on held, in processor time: a busy machine does not matter.
"""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path

from benchmarks.command import command
from flexviz.analysis.diagnosis import diagnose
from flexviz.base.progress import Pace, Progress
from flexviz.content.wording import STAGE_SHARES
from flexviz.data.measurements import read_set

SLACK = 1.0  # [s] by which a bound may be missed
FIRST = 1 / 3  # share of the time before which nothing is judged
CLOSE = 1.5  # ratio of middle and truth that counts as close


def told(folder: Path) -> list[tuple[float, str]]:
    """The processor time [s] at which each stage was told, the end last."""
    news: list[tuple[float, str]] = []

    def tell(one: Progress) -> None:
        news.append((time.process_time(), one.text))

    measurements = read_set(folder)
    began = time.process_time()
    diagnose(measurements, progress=tell)
    return [(at - began, text) for at, text in [*news, (time.process_time(), "end")]]


@command
def main(sets: list[Path]) -> None:
    """Print shares and judgements."""
    held = close = count = 0
    for folder in sets:
        news = told(folder)
        whole = news[-1][0]
        shares = {}
        for at, text in news:
            if text in STAGE_SHARES:
                shares.setdefault(text, at / whole)
        print(f"{folder.name}: {whole:.0f} s")
        for text, share in shares.items():
            low, high, _ = STAGE_SHARES[text]
            unusual = "" if low <= share <= high else f", expected {low:.0%} to {high:.0%}"
            print(f"  {share:4.0%} {text}{unusual}")
        now = 0.0
        pace = Pace(STAGE_SHARES, clock=lambda: now)  # noqa: B023, called at once
        for at, text in news:
            now = at
            rest = pace.news(text).rest
            if rest is not None and FIRST * whole <= at < whole:
                left, middle = whole - at, math.sqrt(max(rest[0], SLACK) * max(rest[1], SLACK))
                held += rest[0] - SLACK <= left <= rest[1] + SLACK
                close += 1 / CLOSE <= middle / max(left, SLACK) <= CLOSE
                count += 1
    print(f"time left: true in {held} of {count}; the middle within a factor of {CLOSE} in {close}")


if __name__ == "__main__":
    sys.exit(main())
