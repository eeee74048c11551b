"""The app's parts that know no browser: value checks, the queue, the clock, hints."""

from __future__ import annotations

import asyncio
import threading
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flexviz.base.errors import InputError
from flexviz.outlets.app.events import MAX_QUEUE_LENGTH, Event, EventQueue
from flexviz.outlets.app.input_rules import (
    Rule,
    choice,
    increasing,
    nothing,
    number,
    press,
    rule_of,
    switch,
    text,
)
from flexviz.outlets.app.page import off
from flexviz.outlets.app.playback import PlaybackClock
from flexviz.outlets.app.state import Changed, ChangeSignal, Turn
from flexviz.outlets.app.style import Tooltips, css_text, in_row
from flexviz.outlets.app.viser_private import LoopEvent

NUMBER = partial(number, low=0.0, high=10.0)
PAIR = partial(increasing, one=partial(number, low=0.0, high=5.0), count=2)
ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20) | st.binary(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=6,
)


@pytest.mark.parametrize(
    "rule, value, expected",
    [
        (NUMBER, 3, 3.0),
        (NUMBER, 10.0, 10.0),
        (NUMBER, 10.0 + 1e-12, 10.0),
        (partial(number, low=0, high=5, whole=True), 3.0, 3),
        (partial(choice, options=("a", "b")), "b", "b"),
        (switch, False, False),
        (press, True, True),
        (text, "name", "name"),
        (PAIR, [1, 2.5], (1.0, 2.5)),
    ],
)
def test_good_values_come_through(rule: Rule, value: Any, expected: Any) -> None:
    assert rule(value) == expected
    assert type(rule(value)) is type(expected)


@pytest.mark.parametrize(
    "rule, value",
    [
        (NUMBER, 99999),
        (NUMBER, -0.1),
        (NUMBER, float("nan")),
        (NUMBER, float("inf")),
        (NUMBER, "3"),
        (NUMBER, True),
        (NUMBER, None),
        (NUMBER, [3]),
        (number, 10**400),
        (partial(number, low=0, high=5, whole=True), 2.5),
        (partial(choice, options=("a",)), "../../etc/passwd"),
        (partial(choice, options=("a",)), 0),
        (switch, 1),
        (press, False),
        (text, "x" * 100000),
        (PAIR, [3, 1]),
        (PAIR, [1]),
        (PAIR, [1, float("nan")]),
        (nothing, 1),
        (rule_of(SimpleNamespace(disabled=True)), 3),
    ],
)
def test_bad_values_do_not(rule: Rule, value: Any) -> None:
    with pytest.raises(InputError):
        rule(value)


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])  # on a busy machine
@given(
    st.sampled_from([NUMBER, partial(choice, options=("a", "b")), switch, press, text, PAIR, nothing]),
    ANYTHING,
)
def test_whatever_comes_is_accepted_or_refused(rule: Rule, value: Any) -> None:
    try:
        accepted = rule(value)
    except InputError as error:
        assert len(str(error)) < 300
    else:
        assert rule(accepted) == accepted


# -- queue -----------------------------------------------------------------------------------------------


def ignored(value: Any) -> None:
    pass


def put(queue: EventQueue, source: str, value: Any, each: bool = False) -> None:
    queue.put(Event(source, ignored, value), each=each)


def test_of_waiting_events_only_the_newest_of_a_source_stays() -> None:
    queue = EventQueue()
    for value in range(5):
        put(queue, "bandwidth", value)
    put(queue, "run", None)
    put(queue, "bandwidth", 9)
    assert [(e.source, e.value) for e in iter(lambda: queue.take(0.0), None)] == [
        ("run", None),
        ("bandwidth", 9),
    ]


def test_each_step_counts() -> None:
    queue = EventQueue()
    for value in ("a", "b"):
        put(queue, "step", value, each=True)
    assert [queue.take(0.0), queue.take(0.0)] != [None, None] and len(queue) == 0


def test_the_queue_has_an_end() -> None:
    queue = EventQueue()
    for value in range(MAX_QUEUE_LENGTH + 50):
        queue.call(ignored, value)
    assert len(queue) == MAX_QUEUE_LENGTH


def test_many_threads() -> None:
    queue = EventQueue()

    def put_many(name: str) -> None:
        for value in range(200):
            put(queue, name, value)

    threads = [threading.Thread(target=put_many, args=(f"t{i}",)) for i in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(e.value for e in iter(lambda: queue.take(0.0), None)) == [199] * 8


# -- the change signal -----------------------------------------------------------------------------------


def test_subscribers_hear_in_turn_and_of_nested_changes_afterwards() -> None:
    signal, heard = ChangeSignal(), []
    signal.subscribe(Changed.RESULT | Changed.MESSAGE, lambda: heard.append("status"), Turn.STATUS)

    def draw_table() -> None:
        heard.append("table")
        signal.tell(Changed.MESSAGE)

    signal.subscribe(Changed.RESULT, draw_table, Turn.CONTROLS)
    signal.subscribe(Changed.RESULT, lambda: heard.append("plot"))
    signal.subscribe(Changed.JOINT, lambda: heard.append("joint"))
    signal.tell(Changed.RESULT)
    assert heard == ["plot", "table", "status", "status"]


def test_a_subscriber_that_fails_does_not_silence_the_signal() -> None:
    signal, heard = ChangeSignal(), []

    def fail() -> None:
        raise InputError("no")

    signal.subscribe(Changed.RESULT, fail)
    signal.subscribe(Changed.JOINT, lambda: heard.append("joint"))
    with pytest.raises(InputError):
        signal.tell(Changed.RESULT)
    signal.tell(Changed.JOINT)
    assert heard == ["joint"]


def test_only_the_loop_wakes_the_pages() -> None:
    async def scene() -> None:
        event = LoopEvent()
        await asyncio.to_thread(event.set)
        assert not event.is_set()
        asyncio.get_running_loop().call_soon_threadsafe(event.set)
        await asyncio.wait_for(event.wait(), 5.0)

    with ThreadPoolExecutor(1) as thread:  # this one may have a loop already, of the browser's tests
        thread.submit(asyncio.run, scene()).result()


# -- clock -----------------------------------------------------------------------------------------------


def test_clock_runs_stands_steps_and_begins_again() -> None:
    now = [100.0]
    clock = PlaybackClock(lambda: now[0])
    clock.span(2.0, 12.0)
    assert clock.time == 2.0 and not clock.playing
    clock.play()
    now[0] += 3.0
    assert clock.time == pytest.approx(5.0)
    clock.set_speed(2.0)
    now[0] += 3.0
    assert clock.time == pytest.approx(11.0)
    now[0] += 1.0
    assert clock.time == pytest.approx(3.0)  # began again
    clock.pause()
    now[0] += 5.0
    assert clock.time == pytest.approx(3.0)
    clock.step(-5.0)
    assert clock.time == 2.0
    clock.play()
    clock.seek(99.0)
    assert clock.time == pytest.approx(12.0, abs=1e-6) or clock.time == pytest.approx(2.0, abs=1e-6)
    clock.step(0.5)
    assert not clock.playing


def fake_button(uuid: str) -> Any:
    return SimpleNamespace(_impl=SimpleNamespace(uuid=uuid), hint="", visible=True, disabled=False)


def test_a_control_that_is_off_says_why() -> None:
    handle = fake_button("u")
    off(handle, "a computation is running (Stop ends it)", "does it")
    assert handle.disabled and handle.hint == "off: a computation is running (Stop ends it)"
    off(handle, "", "does it")
    assert not handle.disabled and handle.hint == "does it"


def test_tooltips_are_drawn_for_buttons_that_have_one() -> None:
    tooltips, buttons = Tooltips(), [fake_button(name) for name in "abc"]
    for one in buttons:
        tooltips.add(one)
    assert tooltips.rules() == []
    tooltips.open_left(("c",))
    buttons[0].hint, buttons[2].hint = "first", "last"
    text = "\n".join(tooltips.rules())
    assert '"first"; left: 6px' in text and '"last"; right: 6px' in text and 'id="b"' not in text
    buttons[0].visible = False
    assert "first" not in "\n".join(tooltips.rules())
    assert "width: calc(0.3333" in in_row("a", "b", "c")


@given(st.text(max_size=30))
def test_a_hint_cannot_leave_its_string(text: str) -> None:
    written = css_text(f'{text}</style>"')
    assert written.count('"') == 2 and "<" not in written and "\n" not in written
