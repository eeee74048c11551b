"""Every reader takes a spoilt input or refuses it in one line; more inputs: `python -m benchmarks.fuzz`."""

from __future__ import annotations

import random

import pytest

from benchmarks.fuzz import fuzz, spoilt
from benchmarks.fuzz_readers import READERS


def test_every_reader_survives() -> None:
    readers = {name: reader for name, reader in READERS.items() if name not in SLOW}
    faults, counts = fuzz(readers, range(400), seed=1)
    assert not faults, faults[0].traceback
    assert all(sum(row) > 0 for row in counts.values())
    assert sum(row[0] for row in counts.values()) > 50 and sum(row[1] for row in counts.values()) > 200


@pytest.mark.slow
def test_slow_readers_survive() -> None:
    faults, counts = fuzz({name: READERS[name] for name in SLOW}, range(24), seed=1)
    assert not faults, faults[0].traceback
    assert all(sum(row) > 0 for row in counts.values())


def test_inputs_are_spoilt_alike_each_time() -> None:
    content = b'{"a": [1, 2.5, "x"], "b": {"c": null}}'
    made = [[spoilt(content, "x.json", random.Random(n)) for n in range(200)] for _ in range(2)]
    assert made[0] == made[1] and len(set(made[0])) > 100


SLOW = ("session", "results", "mapping", "rrd")
