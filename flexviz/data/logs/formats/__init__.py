"""Formats of logs: one file each, which declares what it recognises and how it is read, and one line here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from flexviz.base.errors import InputError
from flexviz.base.progress import Progress
from flexviz.data.logs.formats.bags import BAG
from flexviz.data.logs.formats.base import LETTERS, Log, LogFormat, ReadOptions, joined
from flexviz.data.logs.formats.delimited import DELIMITED
from flexviz.data.logs.formats.excel import EXCEL
from flexviz.data.logs.formats.frames import FRAMES
from flexviz.data.logs.formats.json_logs import JSON
from flexviz.data.logs.formats.lerobot import LEROBOT
from flexviz.data.logs.formats.matlab import MATLAB
from flexviz.data.logs.formats.numpy_archives import NUMPY
from flexviz.data.logs.formats.packed import inside_of, members, unpacked
from flexviz.data.logs.formats.parquet import PARQUET
from flexviz.data.logs.formats.stacked import unstacked

FORMATS: tuple[LogFormat, ...] = (
    BAG, DELIMITED, PARQUET, MATLAB, NUMPY, JSON, FRAMES, EXCEL, LEROBOT,
)  # fmt: skip
KNOWN = ", ".join(known.title for known in FORMATS) + ", and these zipped"


@dataclass(frozen=True)
class LogSource:
    """Where one log lies: a file or folder, the episode in a dataset of episodes, further files."""

    path: Path
    episode: int | None = None
    beside: tuple[Path, ...] = ()  # further files of the same run

    @property
    def paths(self) -> tuple[Path, ...]:
        """All files of the run."""
        return (self.path, *self.beside)


def open_run(source: LogSource, options: ReadOptions) -> Log:
    """Read the files of one run as one log."""
    options = replace(options, episode=source.episode)
    if not source.beside:
        return open_log(source.path, options)
    logs = []
    for letter, path in zip(LETTERS, source.paths, strict=False):
        start = f"{letter}/"
        own = {name.removeprefix(start) for name in options.wanted or () if name.startswith(start)}
        logs.append(open_log(path, replace(options, wanted=None if options.wanted is None else own)))
    return joined(logs)


def open_log(path: Path, options: ReadOptions) -> Log:
    """Read a log; InputError for whatever cannot be read."""
    packed = inside_of(path)
    if packed is not None:
        archive, member = packed
        found = logs_in(archive)
        if member not in found and (member or len(found) != 1):
            inside = ", ".join(found[:8]) or "no log"
            raise InputError(f"the archive holds {inside}, expected one of them: {archive.name}/…", file=path)
        with unpacked(archive, member or found[0]) as file:
            return replace(open_log(file, options), file=path)
    known = format_of(path)
    episode = "" if options.episode is None else f", episode {options.episode}"
    options.progress(Progress(f"reading {path.name}{episode}", 0.0))
    return unstacked(known.read(path, options))


def logs_in(archive: Path) -> list[str]:
    """The members of an archive that are logs."""
    return [
        name for name in members(archive) if any(Path(name).suffix.lower() in x.suffixes for x in FORMATS)
    ]


def format_of(path: Path) -> LogFormat:
    """The format of a file or folder."""
    try:
        is_folder, exists = path.is_dir(), path.exists()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be opened ({reason})", file=path) from None
    if not exists:
        raise InputError("file not found", file=path)
    for known in FORMATS:
        if known.recognises(path):
            return known
    if is_folder and (path / "measurements.toml").is_file():
        raise InputError("this is a measurement set already: flexviz identify reads it", file=path)
    if is_folder:
        marks = " nor ".join(f"{known.folder} ({known.mark})" for known in FORMATS if known.mark)
        raise InputError(f"neither {marks}", file=path)
    raise InputError(f'"{path.suffix}" is no known format; flexviz import reads {KNOWN}', file=path)


def find_logs(paths: Sequence[Path]) -> list[LogSource]:
    """The logs that paths name; a folder of logs stands for all of them, a dataset for its episodes."""
    found: list[LogSource] = []
    for path in paths:
        logs = [path]
        recognised = any(known.recognises(path) for known in FORMATS)
        if path.is_dir() and not recognised and not (path / "measurements.toml").is_file():
            # inside a folder, datasets of episodes are not taken for logs
            formats = [known for known in FORMATS if not known.episodes and not known.named]
            inside = (p for p in path.iterdir() if not p.name.startswith("."))
            logs = sorted(
                p
                for p in inside
                if any(known.recognises(p) for known in formats) or (inside_of(p) and logs_in(p))
            )
            if not logs:
                raise InputError(f"the folder holds no log; flexviz import reads {KNOWN}", file=path)
        for log in logs:
            if log.is_file() and inside_of(log) is not None:
                inside_it = logs_in(log)
                found += [LogSource(log / x) for x in inside_it] if len(inside_it) > 1 else [LogSource(log)]
                continue
            episodes = format_of(log).episodes
            found += [LogSource(log, episode) for episode in (episodes(log) if episodes else [None])]
    for i, source in enumerate(found):
        if source in found[:i]:
            raise InputError("is given twice, expected once", file=source.path)
    return found
