"""Uploaded files on their way to a set, in a temporary folder until all that is named is there. No viser."""

from __future__ import annotations

import shutil
import tempfile
import tomllib
from pathlib import Path

from flexviz.app.uploads import LARGEST_SET, MAIN, MOST_FILES, new_folder, safe_name, unpack
from flexviz.errors import InputError
from flexviz.progress import ProgressCallback, StopCallback, ignore, never
from flexviz.session import SESSION_FILE


class Inbox:
    """Files that came one by one or as a zip."""

    def __init__(self) -> None:
        self._temporary = tempfile.TemporaryDirectory(prefix="flexviz-upload-")
        self._begin()

    def _begin(self) -> None:
        """A new, empty folder; the old one's files stay, a robot that was chosen may lie there."""
        self.folder = new_folder(Path(self._temporary.name), "uploaded")
        self.folder.mkdir()

    @property
    def count(self) -> int:
        """How many files are there."""
        return len(self._files())

    @property
    def no_set(self) -> bool:
        """Whether neither a set's nor a session's file has come."""
        return not (self.folder / MAIN).is_file() and not (self.folder / SESSION_FILE).is_file()

    def put(self, name: str, content: bytes) -> Path:
        """Take one file; returns where it lies. InputError where it is not acceptable."""
        target = self._place(safe_name(name))
        others = [file for file in self._files() if file != target]
        if len(content) + sum(file.stat().st_size for file in others) > LARGEST_SET:
            raise InputError(f"more than {LARGEST_SET / 2**20:.0f} MB together")
        if len(others) >= MOST_FILES:
            raise InputError(f"more than {MOST_FILES} files")
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
        for file in self._files():  # what came before the file that says where it belongs
            place = self._place(file.relative_to(self.folder).as_posix())
            if place != file and not place.exists():
                place.parent.mkdir(parents=True, exist_ok=True)
                file.rename(place)
        return target

    def unpack(
        self, name: str, content: bytes, *, progress: ProgressCallback, should_stop: StopCallback
    ) -> None:
        """Take a zip instead of what is there. A job."""
        self.folder = unpack(name, content, Path(self._temporary.name))

    def named(self) -> list[str]:
        """The files that a set's measurements.toml names."""
        file = self.folder / MAIN
        if not file.is_file():
            return []
        try:
            document = tomllib.loads(file.read_text(encoding="utf-8"))
        except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise InputError(f"{MAIN}: {error}") from None
        groups = document.get("groups", [])
        found = [g.get("file") for g in groups if isinstance(g, dict)] if isinstance(groups, list) else []
        robot = document.get("robot")
        if isinstance(robot, str) and ":" not in robot:
            found.append(robot)
        return [name for name in dict.fromkeys(found) if isinstance(name, str)]

    def missing(self) -> list[str]:
        """What is still needed: measurements.toml, then the files it names."""
        if self.no_set:
            return [MAIN]
        return [name for name in self.named() if not (self.folder / name).is_file()]

    def urdf(self) -> Path | None:
        """The only URDF, or None."""
        found = [file for file in self._files() if file.suffix.lower() == ".urdf"]
        return found[0] if len(found) == 1 else None

    def take(
        self, parent: Path, *, progress: ProgressCallback = ignore, should_stop: StopCallback = never
    ) -> Path:
        """Move the set into a new folder in `parent`, once it has been read; returns the folder. A job."""
        from flexviz.session import open_session

        try:
            open_session(self.folder)
        except InputError as error:
            raise InputError(str(error).replace(f"{self.folder}/", "")) from None
        folder = new_folder(parent, self.folder.name)
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", dir=parent) as beside:
            shutil.copytree(self.folder, Path(beside) / "new")
            (Path(beside) / "new").rename(folder)
        self._begin()
        return folder

    def close(self) -> None:
        """Remove what was not taken."""
        self._temporary.cleanup()

    def _files(self) -> list[Path]:
        return [file for file in self.folder.rglob("*") if file.is_file()]

    def _place(self, name: str) -> Path:
        """Where a file belongs: a browser says nothing about folders, measurements.toml may."""
        try:
            wanted = [entry for entry in self.named() if Path(entry).name == Path(name).name]
        except InputError:
            wanted = []
        path = self.folder / (wanted[0] if len(wanted) == 1 else name)
        inside = path.resolve().is_relative_to(self.folder.resolve())
        return path if inside else self.folder / Path(name).name
