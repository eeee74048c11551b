"""Computing rooms return facts, and `flexviz.content.wording` alone has the sentences."""

from __future__ import annotations

import ast
import pickle

import pytest

import flexviz
from flexviz.base.facts import Fact
from flexviz.content.wording import fact_text
from flexviz.content.wording.facts import SENTENCES
from tests.sentences import sentences
from tests.test_architecture import PACKAGE, SOURCES, imports, tree, unit

DOCUMENTED = ("model/effects", "model/observers")  # whose classes state their own titles and equations
ERRORS = ("base/errors", "base/schemas")  # which compose what errors say
COMPUTING = ("base", "robot", "data", "checks", "model", "analysis")
LEFT = {"data/importing": 51, "data/logs": 38, "data/measurements": 7}
"""Sentences that still stand in computing rooms, at most; of a room that is not named none."""


def test_sentences_stand_in_wording() -> None:
    found = dict[str, list[str]]()
    for path in SOURCES:
        room = unit(path)
        if room.partition("/")[0] in COMPUTING and room not in ERRORS:
            for line, text in sentences(tree(path), documented=room in DOCUMENTED):
                found.setdefault(room, []).append(f"{path.relative_to(PACKAGE)}:{line}: {text}")
    more = {room: texts for room, texts in found.items() if len(texts) > LEFT.get(room, 0)}
    assert not more, "return a fact, and give its kind a sentence in flexviz/content/wording/topics"


def test_a_sentence_is_found_and_what_documents_or_is_raised_is_not() -> None:
    source = """
class Law:
    "One two three four five."
    title = "One two three four five."
    def law(self, name):
        message = "six words that are only raised"
        if name:
            raise ValueError(message + ADVICE + advice())
        return f"{name} is one of five", ParameterSpec("x", text="one two three four five"), "only four here"
ADVICE = "an error also says this"
def advice():
    return "and what one function returns"
"""
    module = ast.parse(source)
    assert [text for _, text in sentences(module, documented=True)] == ["{} is one of five"]
    assert len(list(sentences(module))) == 2


def test_computing_rooms_do_not_know_words() -> None:
    found = {
        unit(path)
        for path in SOURCES
        for name, _ in imports(path)
        if name.startswith("flexviz.content.wording")
    }
    assert not {room for room in found if room.partition("/")[0] in COMPUTING}


def kinds() -> dict[str, str]:
    """Kinds of facts that the source tree makes, and a file that does."""
    out = dict[str, str]()
    for path in SOURCES:
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Fact" and node.args:
                kind = node.args[0]
                assert isinstance(kind, ast.Constant) and isinstance(kind.value, str), (
                    f"{path.name}:{node.lineno}: write the kind out"
                )
                out[kind.value] = str(path.relative_to(PACKAGE))
    return out


def test_every_kind_of_fact_has_a_sentence_and_every_sentence_a_fact() -> None:
    with pytest.raises(KeyError):
        fact_text(Fact("no_such_kind"))
    assert kinds().keys() == SENTENCES.keys()


def test_a_fact_prints_its_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SENTENCES, "made_up", lambda fact: f"{fact.joints[0]} has {fact.values['count']}")
    fact = Fact("made_up", "odd", joints=("joint1",), values={"count": 3})
    assert f"{fact}" == fact.text == "joint1 has 3"
    assert pickle.loads(pickle.dumps(fact)) == fact and len({fact, fact}) == 1
    assert Fact.words is flexviz._in_words
