"""Which sets are measured, and the class that each belongs to.

DIR/fresh-SEED/KIND/cases are simulated here (`making.py`), with DIR/fresh-SEED/KIND/truth beside them. A
folder of given sets may hold practice, robotlike and real; another one the sets of
`benchmarks.public_robots`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.running import case_folder, made_cases, truth_file

EFFECTS, MANY, RECORDED = "effects", "many", "recorded"  # how a set is judged
CLASSES: dict[str, str] = {
    "practice": EFFECTS,
    "planar-single": EFFECTS,
    "arms-single": EFFECTS,
    "pair": EFFECTS,
    "clean": EFFECTS,
    "unknown": EFFECTS,
    "robotlike": MANY,
    "robotlike-fresh": MANY,
    "filtered": MANY,
    "servo": MANY,
    "real": RECORDED,
}
"""Class → how its sets are judged: few hidden effects, many of them, or none known."""
FRESH_KINDS = {"robotlike": "robotlike-fresh", "filtered": "filtered", "servo": "servo"}


@dataclass(frozen=True)
class StickSet:
    """One measurement set.

    Attributes:
        key: its name among all sets, and the place of its results.
        kind: its class.
        folder: of the measurement set.
        truth: file with what is hidden, if that is known.
    """

    key: str
    kind: str
    folder: Path
    truth: Path | None


def find_sets(
    work: Path,
    given: Path | None = None,
    public: Path | None = None,
    classes: Sequence[str] = (),
    only: str = "",
) -> list[StickSet]:
    """The sets that are there, those of `classes` (all by default) with `only` in their key."""
    found = [*_given(given), *_recorded(given, public), *_fresh(work)]
    found.sort(key=lambda one: (list(CLASSES).index(one.kind), one.key))
    return [one for one in found if (not classes or one.kind in classes) and only in one.key]


def _given(given: Path | None) -> Iterator[StickSet]:
    for kind in ("practice", "robotlike"):
        if given is not None and (given / kind).is_dir():
            for name, folder, truth in _pairs(given / kind):
                yield StickSet(f"{kind}/{name}", kind, folder, truth)


def _recorded(given: Path | None, public: Path | None) -> Iterator[StickSet]:
    roots = {"real": given / "real" if given else None, "public": public}
    for label, root in roots.items():
        if root is None:
            continue
        for file in sorted(root.rglob("measurements.toml")):
            name = file.parent.relative_to(root).as_posix().replace("/", "-")
            yield StickSet(f"{label}/{name}", "real", file.parent, None)


def _fresh(work: Path) -> Iterator[StickSet]:
    for seed in sorted(work.glob("fresh-*")):
        for kind in ("diagnosis", *FRESH_KINDS):
            for name, folder, truth in _pairs(seed / kind):
                key = f"{seed.name}/{kind}/{name}"
                yield StickSet(key, FRESH_KINDS.get(kind) or _study_class(name), folder, truth)


def _pairs(root: Path) -> Iterator[tuple[str, Path, Path]]:
    """Name, set and truth of every case that is completely made."""
    for name in made_cases(root):
        yield name, case_folder(root, name), truth_file(root, name)


def _study_class(name: str) -> str:
    """Of a case of `benchmarks.diagnosis_study`, KIND-ROBOT-NUMBER-LABEL."""
    kind, robot = name.split("-")[:2]
    if kind == "single":
        return "planar-single" if robot == "2r" else "arms-single"
    return kind
