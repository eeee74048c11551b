"""The app's parts that know no browser: value checks, the queue, the clock, hints."""

from __future__ import annotations

import threading
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexviz.app.checks import Rule, check
from flexviz.app.clock import Clock
from flexviz.app.controls import off
from flexviz.app.events import LIMIT, Dispatcher, Event, EventQueue
from flexviz.app.hints import Hints, css_text
from flexviz.errors import InputError

NUMBER = Rule("number", 0.0, 10.0)
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
        (Rule("number", 0, 5, whole=True), 3.0, 3),
        (Rule("choice", options=("a", "b")), "b", "b"),
        (Rule("switch"), False, False),
        (Rule("press"), True, True),
        (Rule("text"), "name", "name"),
        (Rule("range", 0, 5, length=2), [1, 2.5], (1.0, 2.5)),
    ],
)
def test_good_values_come_through(rule: Rule, value: Any, expected: Any) -> None:
    assert check(rule, value) == expected
    assert type(check(rule, value)) is type(expected)


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
        (Rule("number"), 10**400),
        (Rule("number", 0, 5, whole=True), 2.5),
        (Rule("choice", options=("a",)), "../../etc/passwd"),
        (Rule("choice", options=("a",)), 0),
        (Rule("switch"), 1),
        (Rule("press"), False),
        (Rule("text"), "x" * 100000),
        (Rule("range", 0, 5, length=2), [3, 1]),
        (Rule("range", 0, 5, length=2), [1]),
        (Rule("range", 0, 5, length=2), [1, float("nan")]),
        (Rule("none"), 1),
        (Rule("number", 0, 5, disabled=True), 3),
    ],
)
def test_bad_values_do_not(rule: Rule, value: Any) -> None:
    with pytest.raises(InputError):
        check(rule, value)


@given(st.sampled_from(["number", "choice", "switch", "press", "text", "range", "none"]), ANYTHING)
def test_whatever_comes_is_accepted_or_refused(kind: Any, value: Any) -> None:
    rule = Rule(kind, 0.0, 10.0, options=("a", "b"), length=2)
    try:
        accepted = check(rule, value)
    except InputError as error:
        assert len(str(error)) < 300
    else:
        assert check(rule, accepted) == accepted


# -- queue -----------------------------------------------------------------------------------------------


def test_of_waiting_events_only_the_newest_of_a_key_stays() -> None:
    queue = EventQueue()
    for value in range(5):
        queue.put("bandwidth", value)
    queue.put("run")
    queue.put("bandwidth", 9)
    assert [(e.key, e.value) for e in iter(lambda: queue.take(0.0), None)] == [
        ("run", None),
        ("bandwidth", 9),
    ]


def test_each_step_counts() -> None:
    queue = EventQueue()
    for value in ("a", "b"):
        queue.put("step", value, each=True)
    assert [queue.take(0.0), queue.take(0.0)] != [None, None] and len(queue) == 0


def test_the_queue_has_an_end() -> None:
    queue = EventQueue()
    for value in range(LIMIT + 50):
        queue.put("flood", value, each=True)
    assert len(queue) == LIMIT


def test_many_threads() -> None:
    queue = EventQueue()

    def put(name: str) -> None:
        for value in range(200):
            queue.put(name, value)

    threads = [threading.Thread(target=put, args=(f"t{i}",)) for i in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(e.value for e in iter(lambda: queue.take(0.0), None)) == [199] * 8


def test_a_failing_handler_is_reported() -> None:
    failed: list[tuple[str, str]] = []
    dispatcher = Dispatcher(lambda event, error: failed.append((event.key, type(error).__name__)))
    dispatcher.on("bad", lambda value: 1 / value)
    dispatcher.act(Event("bad", 0))
    dispatcher.act(Event("unknown"))
    assert failed == [("bad", "ZeroDivisionError"), ("unknown", "KeyError")]


# -- clock -----------------------------------------------------------------------------------------------


def test_clock_runs_stands_steps_and_begins_again() -> None:
    now = [100.0]
    clock = Clock(lambda: now[0])
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
    off(handle, "something runs", "does it")
    assert handle.disabled and handle.hint == "off: something runs"
    off(handle, "", "does it")
    assert not handle.disabled and handle.hint == "does it"


def test_hints_are_drawn_for_buttons_that_have_one() -> None:
    hints, buttons = Hints(), [fake_button(name) for name in "abc"]
    for one in buttons:
        hints.add(one)
    assert hints.rules() == []
    assert "width: calc(0.3333" in hints.row(buttons)
    buttons[0].hint, buttons[2].hint = "first", "last"
    text = "\n".join(hints.rules())
    assert '"first"; left: 6px' in text and '"last"; right: 6px' in text and 'id="b"' not in text
    buttons[0].visible = False
    assert "first" not in "\n".join(hints.rules())


@given(st.text(max_size=30))
def test_a_hint_cannot_leave_its_string(text: str) -> None:
    written = css_text(f'{text}</style>"')
    assert written.count('"') == 2 and "<" not in written and "\n" not in written
