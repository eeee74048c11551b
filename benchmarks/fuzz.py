"""Spoilt inputs to every reader: `python -m benchmarks.fuzz --inputs 20000 [--seed N] [--reader NAME]`.

Good files are changed at random: bits, bytes, slices, numbers, values of JSON. Each reader must take them or
refuse them with a FlexvizError of one line within `PATIENCE`. Anything else is a fault: its traceback is
printed, the file that caused it is kept in `--keep DIR`, and the exit code is 1. Work is done in child
processes, so that a crash is found, too.
"""

from __future__ import annotations

import json
import logging
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import traceback
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.command import command
from benchmarks.running import alone, say
from flexviz.base.errors import FlexvizError

PATIENCE = 30  # [s] for one input
PER_CHILD = 2000  # inputs
TOKENS = (
    b"nan", b"inf", b"-1", b"0", b"1e300", b"1e-300", b"1e999",
    b"9" * 5000, b"true", b"null", b"abc", b"", b"[]",
    b'""', b"{}", b"-0.0", b"\x00", b"\xff", b"\n", b"../../etc/passwd", b"/", b"*/", b"a." * 40, b"[" * 2000,
)  # fmt: skip
VALUES: tuple[Any, ...] = (
    None, True, -1, 0, 1e300, 10**30, "x", "", [], {}, [[]], {"#": 0}, {"@": 0}, {"~": "nan"},
    {"=": "Tie"}, "\0",
)  # fmt: skip
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:e-?\d+)?")
WORD = re.compile(rb"[A-Za-z_]{3,}")


@dataclass(frozen=True)
class Reader:
    """One kind of input.

    Attributes:
        make: fills a folder with good files.
        spoil: glob of the files that are changed, one per input.
        read: reads the folder.
        weight: how often it is tried: fast readers more often.
    """

    make: Callable[[Path], object]
    spoil: str
    read: Callable[[Path], object]
    weight: int = 1


@dataclass(frozen=True)
class Fault:
    """An input that was neither taken nor refused."""

    reader: str
    number: int
    file: str
    content: bytes
    traceback: str


# -- changes ---------------------------------------------------------------------------------------------


def spoilt(content: bytes, name: str, rng: random.Random) -> bytes:
    """The content with one to three changes."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        if name.endswith(".json") and rng.random() < 0.7:
            content = with_other_value(content, rng)
        else:
            content = rng.choice(CHANGES)(content, rng)
    return content


def with_other_value(content: bytes, rng: random.Random) -> bytes:
    """JSON with another value, or without a key, somewhere."""
    try:
        document = json.loads(content)
    except (ValueError, RecursionError):
        return content
    places: list[tuple[Any, Any]] = []

    def walk(value: Any) -> None:
        for key, inside in list(value.items() if isinstance(value, dict) else enumerate(value)):
            places.append((value, key))
            if isinstance(inside, dict | list):
                walk(inside)

    if not isinstance(document, dict | list):
        return content
    walk(document)
    if not places:
        return content
    holder, key = rng.choice(places)
    kind = rng.random()
    if kind < 0.2:
        del holder[key]
    elif kind < 0.4:
        other, place = rng.choice(places)
        holder[key] = json.loads(json.dumps(other[place]))
    else:
        holder[key] = rng.choice(VALUES)
    return json.dumps(document).encode()


def flipped(content: bytes, rng: random.Random) -> bytes:
    if not content:
        return content
    changed = bytearray(content)
    changed[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def cut(content: bytes, rng: random.Random) -> bytes:
    return content[: rng.randrange(len(content) + 1)]


def without_slice(content: bytes, rng: random.Random) -> bytes:
    start = rng.randrange(len(content) + 1)
    return content[:start] + content[start + rng.randrange(64) :]


def with_slice_twice(content: bytes, rng: random.Random) -> bytes:
    start = rng.randrange(len(content) + 1)
    end = start + rng.randrange(512)
    return content[:end] + content[start:end] * rng.randrange(1, 4) + content[end:]


def with_token(content: bytes, rng: random.Random) -> bytes:
    start = rng.randrange(len(content) + 1)
    return content[:start] + rng.choice(TOKENS) + content[start:]


def with_other_number(content: bytes, rng: random.Random) -> bytes:
    """A number or a word of a text replaced."""
    found = list((NUMBER if rng.random() < 0.7 else WORD).finditer(content[:20_000]))
    if not found:
        return flipped(content, rng)
    place = rng.choice(found)
    return content[: place.start()] + rng.choice(TOKENS) + content[place.end() :]


def with_other_bytes(content: bytes, rng: random.Random) -> bytes:
    start = rng.randrange(len(content) + 1)
    return content[:start] + rng.randbytes(rng.choice((1, 2, 4, 8))) + content[start + 8 :]


CHANGES = (
    flipped, flipped, cut, without_slice, with_slice_twice, with_token, with_other_number, with_other_number,
    with_other_bytes,
)  # fmt: skip


# -- running ---------------------------------------------------------------------------------------------


@contextmanager
def time_limit() -> Iterator[None]:
    def late(*_: object) -> None:
        raise TimeoutError(f"over {PATIENCE} s")

    previous = signal.signal(signal.SIGALRM, late)
    signal.alarm(PATIENCE)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, previous)


def fuzz(
    readers: dict[str, Reader],
    numbers: range,
    seed: int,
    said: Callable[[str, int, Path], None] = lambda *_: None,
) -> tuple[list[Fault], dict[str, list[int]]]:
    """Faults, and how many inputs each reader took and refused."""
    logging.disable(logging.WARNING)
    faults: list[Fault] = []
    counts = {name: [0, 0] for name in readers}
    with tempfile.TemporaryDirectory(prefix="flexviz-fuzz-") as temporary:
        root = Path(temporary)
        for name, reader in readers.items():
            (root / name).mkdir()
            reader.make(root / name)
            reader.read(root / name)  # the good files are good
        for number in numbers:
            rng = random.Random(zlib.crc32(f"{seed} {number}".encode()))
            (name,) = rng.choices(list(readers), [reader.weight for reader in readers.values()])
            folder = root / name
            file = rng.choice(sorted(folder.glob(readers[name].spoil)))
            good = file.read_bytes()
            file.write_bytes(spoilt(good, file.name, rng))
            said(name, number, file)
            try:
                with time_limit():
                    readers[name].read(folder)
                counts[name][0] += 1
            except FlexvizError as error:
                counts[name][1] += 1
                if "\n" in str(error):
                    faults.append(Fault(name, number, file.name, file.read_bytes(), f"two lines: {error}"))
            except KeyboardInterrupt:
                raise
            except BaseException:
                faults.append(Fault(name, number, file.name, file.read_bytes(), traceback.format_exc()))
            file.write_bytes(good)
    return faults, counts


def batch(name: str, numbers: range, seed: int, keep: Path) -> tuple[list[Fault], dict[str, list[int]]]:
    """What `fuzz` finds with the reader `name`, "" for all; the input under way lies in `keep`."""
    from benchmarks.fuzz_readers import READERS

    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # libraries complain about what they read

    def said(name: str, number: int, file: Path) -> None:
        (keep / "now").write_text(f"{name} {number} {file.name}")
        shutil.copyfile(file, keep / "now.input")

    return fuzz({name: READERS[name]} if name else READERS, numbers, seed, said)


@command
def main(*, inputs: int = 20_000, seed: int = 0, reader: str = "", keep: str = "") -> int:
    """Try all inputs in child processes, and print a table."""
    total: Counter[tuple[str, int]] = Counter()
    faults, folder = 0, Path(keep or tempfile.mkdtemp(prefix="flexviz-faults-"))
    folder.mkdir(parents=True, exist_ok=True)
    for first in range(0, inputs, PER_CHILD):
        numbers = range(first, min(first + PER_CHILD, inputs))
        try:
            found, counts = alone(batch, reader, numbers, seed, folder)
        except BrokenProcessPool:
            now = folder / "now"
            at = now.read_text() if now.is_file() else "the beginning"
            print(f"CRASH at {at}; its input: {now}.input")
            faults += 1
            continue
        for fault in found:
            place = folder / f"{fault.reader}-{fault.number}-{fault.file}"
            place.write_bytes(fault.content)
            print(f"FAULT {place}\n{fault.traceback}", flush=True)
        faults += len(found)
        total.update({(name, k): count for name, row in counts.items() for k, count in enumerate(row)})
        say(f"{numbers.stop} of {inputs} inputs, {faults} faults")
    for name in sorted({name for name, _ in total}):
        taken, refused = total[name, 0], total[name, 1]
        print(f"{name:10} {taken + refused:7} inputs: {taken} taken, {refused} refused")
    print(f"{total.total()} inputs, {faults} faults; files in {folder}")
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
