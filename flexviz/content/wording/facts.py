"""Facts as sentences: each kind has one function, in a file of `flexviz.content.wording.topics`."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pkgutil import iter_modules

from flexviz.base.facts import Fact

Sentence = Callable[[Fact], str]
SENTENCES: dict[str, Sentence] = {}
"""Kind of fact -> what puts it into words."""


def says(*kinds: str) -> Callable[[Sentence], Sentence]:
    """Register a function as the sentence of some kinds of facts."""

    def register(sentence: Sentence) -> Sentence:
        for kind in kinds:
            assert kind not in SENTENCES, f"two sentences for {kind}"
            SENTENCES[kind] = sentence
        return sentence

    return register


def fact_text(fact: Fact) -> str:
    """The sentence of a fact, without a full stop; of one from a session of an older format the one it has.

    Raises:
        KeyError: no topic has words for its kind.
    """
    text = fact.values.get("text")
    if text is None:
        text = sentence_of(fact.kind)(fact)
    return f"{fact.file}: {text}" if fact.file else text


def sentence_of(kind: str) -> Sentence:
    """What puts this kind of facts into words; topics are read when the first one is asked for."""
    if kind not in SENTENCES:
        topics = import_module("flexviz.content.wording.topics")
        for topic in iter_modules(topics.__path__):
            import_module(f"{topics.__name__}.{topic.name}")
    return SENTENCES[kind]
