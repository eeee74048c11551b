"""Uploaded files: names, types and sizes are checked before anything is written to a new folder."""

from __future__ import annotations

import io
import itertools
import re
import zipfile
from contextlib import ExitStack
from pathlib import Path, PurePosixPath

from flexviz.base import toml
from flexviz.base.errors import InputError
from flexviz.base.files import copy_tree, named_errors, temporary_folder, whole_folder, write_whole
from flexviz.content.session import SESSION_FILE, open_session
from flexviz.content.wording import plural
from flexviz.robot.robot import Robot
from flexviz.robot.urdf_checks import LARGEST_URDF

LARGEST_UPLOAD = 512 * 2**20  # bytes of one file from a browser
LARGEST_SET = 2 * 2**30  # bytes of all files of a set, unpacked
MAX_FILES = 500
LONGEST_NAME = 200  # characters of a file that a set names
KINDS = (
    ".toml", ".csv", ".parquet", ".urdf", ".xml", ".json", ".npz", ".stl", ".dae", ".obj", ".mtl", ".ply",
    ".glb", ".gltf", ".png", ".jpg", ".md", ".txt", ".tsv", ".dat", ".mat", ".jsonl", ".mcap", ".bag", ".db3",
)  # fmt: skip
LOGS = (
    ".csv",
    ".tsv",
    ".txt",
    ".dat",
    ".parquet",
    ".mat",
    ".npz",
    ".json",
    ".jsonl",
    ".mcap",
    ".bag",
    ".db3",
)
NO_LOGS = (".urdf", ".stl", ".dae", ".obj", ".mtl", ".ply", ".glb", ".gltf", ".png", ".jpg")
_MESH = re.compile(r"""<mesh\b[^>]*?\bfilename\s*=\s*["']([^"']+)["']""")
_NAME = re.compile(r"[^\w.+ -]", re.UNICODE)
MAIN = "measurements.toml"


def safe_name(name: str) -> str:
    """The last part of a file's name, without path characters."""
    last = re.split(r"[\\/]", name)[-1].strip()
    cleaned = _NAME.sub("_", last)[:120]
    if not cleaned.strip("._ ") or cleaned.startswith("."):
        raise InputError(f"{name[:60]!r} is not a file name")
    if Path(cleaned).suffix.lower() == ".xacro":
        raise InputError(f"{cleaned}: expected a URDF; xacro {cleaned} > {Path(cleaned).stem} makes one")
    if Path(cleaned).suffix.lower() not in (*KINDS, ".zip"):
        logs = ", ".join(LOGS)
        raise InputError(f"{cleaned}: a URDF, meshes, logs ({logs}) or a set can be uploaded")
    return cleaned


def new_folder(parent: Path, name: str) -> Path:
    """The path of a new folder in `parent`, named after `name`; it is not created."""
    stem = _NAME.sub("_", name).strip("._ ")[:60] or "uploaded"
    names = itertools.chain([stem], (f"{stem}-{number}" for number in itertools.count(2)))
    return next(parent / name for name in names if not (parent / name).exists())


def inside(archive: zipfile.ZipFile) -> list[tuple[zipfile.ZipInfo, PurePosixPath]]:
    """The files of a zip with their target paths, without a common top folder; InputError if it is no set."""
    entries: list[tuple[zipfile.ZipInfo, PurePosixPath]] = []
    total = 0
    for info in archive.infolist():
        if info.is_dir():
            continue
        path = PurePosixPath(info.filename.replace("\\", "/"))
        kind = info.external_attr >> 28
        if path.is_absolute() or ".." in path.parts or ":" in info.filename or "\0" in info.filename:
            raise InputError(f"{info.filename[:80]!r} leads out of the folder")
        if kind not in (0, 0o10):  # anything but a plain file: links, devices
            raise InputError(f"{info.filename[:80]!r} is not a plain file")
        if any(part.startswith((".", "__MACOSX")) for part in path.parts):
            continue
        if path.suffix.lower() not in KINDS:
            raise InputError(f"{info.filename[:80]!r}: {', '.join(KINDS)} can be uploaded")
        total += info.file_size
        entries.append((info, path))
    if len(entries) > MAX_FILES:
        raise InputError(f"{len(entries)} files; at most {MAX_FILES} are accepted")
    if total > LARGEST_SET:
        raise InputError(
            f"{total / 2**20:.0f} MB unpacked; at most {LARGEST_SET / 2**20:.0f} MB are accepted"
        )
    tops = {path.parts[0] for _, path in entries}
    if len(tops) == 1 and all(len(path.parts) > 1 for _, path in entries):
        entries = [(info, PurePosixPath(*path.parts[1:])) for info, path in entries]
    if len({str(path).lower() for _, path in entries}) < len(entries):
        raise InputError("two files have the same name")
    names = [str(path) for _, path in entries]
    if MAIN not in names and SESSION_FILE not in names and sum(n.endswith(".urdf") for n in names) != 1:
        raise InputError(f"there is neither {MAIN} nor {SESSION_FILE} in it, nor one robot's URDF")
    return entries


def unpack(name: str, content: bytes, parent: Path) -> Path:
    """Unpack a set into a new folder in `parent`; a failure leaves nothing behind."""
    folder = new_folder(parent, Path(safe_name(name)).stem)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive, whole_folder(folder) as new:
            for info, path in inside(archive):
                target = new / path
                target.parent.mkdir(parents=True, exist_ok=True)
                _copy(archive, info, target)
    except InputError:
        raise
    except Exception as error:  # whatever a damaged zip makes the library raise
        reason = getattr(error, "strerror", None)
        found = f"cannot be kept ({reason})" if reason else f"not a usable zip ({error})"
        raise InputError(found, file=safe_name(name)) from None
    return folder


def _copy(archive: zipfile.ZipFile, info: zipfile.ZipInfo, target: Path) -> None:
    """Write one file, at most as large as the zip declares."""
    left = info.file_size
    with archive.open(info) as source, target.open("xb") as sink:
        while chunk := source.read(min(2**20, left + 1)):
            left -= len(chunk)
            if left < 0:
                raise InputError(f"{info.filename[:80]!r} is larger than it says")
            sink.write(chunk)


def take(uploaded: Path, parent: Path) -> Path:
    """Copy an uploaded set into a new folder in `parent`, if it can be read; returns the folder."""
    if not (uploaded / MAIN).is_file():
        raise InputError(f"{MAIN} is missing, expected a session that carries its set")
    try:
        open_session(uploaded)
    except InputError as error:
        raise InputError(str(error).replace(f"{uploaded}/", "")) from None
    folder = new_folder(parent, uploaded.name)
    with named_errors(Path(uploaded.name), "kept"), whole_folder(folder) as new:
        copy_tree(uploaded, new)
    return folder


def describe_robot(urdf: Path) -> str:
    """Name and number of joints of an uploaded robot; InputError if it cannot be used."""
    try:
        robot = Robot.load(urdf)
    except InputError as error:
        raise InputError(str(error).replace(f"{urdf.parent}/", "")) from None
    return "; ".join([f"{robot.name}, {plural(robot.n, 'joint')}", *map(str, robot.notes)])


class UploadFolder:
    """Uploaded files in a temporary folder, until the set is complete."""

    def __init__(self) -> None:
        self._opened = ExitStack()
        self._root = self._opened.enter_context(temporary_folder("upload"))
        self.begin()

    def begin(self) -> None:
        """Start a new folder; the old one is kept, because it may hold the chosen robot."""
        self.folder = new_folder(self._root, "uploaded")
        self.folder.mkdir()

    @property
    def count(self) -> int:
        return len(self._files())

    @property
    def no_set(self) -> bool:
        return not (self.folder / MAIN).is_file() and not (self.folder / SESSION_FILE).is_file()

    def put(self, name: str, content: bytes) -> Path:
        """Store a file and return its path; InputError if it is not acceptable."""
        target = self._place(safe_name(name))
        others = [file for file in self._files() if file != target]
        if len(content) + sum(file.stat().st_size for file in others) > LARGEST_SET:
            raise InputError(f"more than {LARGEST_SET / 2**20:.0f} MB together")
        if len(others) >= MAX_FILES:
            raise InputError(f"more than {MAX_FILES} files")
        target.parent.mkdir(parents=True, exist_ok=True)
        with named_errors(Path(target.name), "kept"):
            write_whole(target, content)
        for file in self._files():  # files that arrived before measurements.toml
            place = self._place(file.relative_to(self.folder).as_posix())
            if place != file and not place.exists():
                place.parent.mkdir(parents=True, exist_ok=True)
                file.rename(place)
        return target

    def unpack(self, name: str, content: bytes) -> None:
        """Replace all files by those of a zip."""
        self.folder = unpack(name, content, self._root)

    def named(self) -> list[str]:
        """The files that a set's measurements.toml names."""
        file = self.folder / MAIN
        if not file.is_file():
            return []
        try:
            document = toml.read(file)
        except InputError as error:
            raise InputError(f"{MAIN}: {error.message}") from None
        groups = document.get("groups", [])
        found = [g.get("file") for g in groups if isinstance(g, dict)] if isinstance(groups, list) else []
        robot = document.get("robot")
        if isinstance(robot, str) and ":" not in robot:
            found.append(robot)
        names = [name for name in dict.fromkeys(found) if isinstance(name, str)]
        if long := [name for name in names if len(name) > LONGEST_NAME]:
            raise InputError(f"{MAIN}: {long[0][:60]!r}… is no file name")
        return names

    def missing(self) -> list[str]:
        """The missing files: measurements.toml, then the files it names.

        A session must carry its set: the path of another one is not followed.
        """
        if not (self.folder / MAIN).is_file():
            return [MAIN]
        return [name for name in self.named() if not (self.folder / name).is_file()]

    def urdf(self) -> Path | None:
        found = [file for file in self._files() if file.suffix.lower() == ".urdf"]
        return found[0] if len(found) == 1 else None

    def logs(self, made: str) -> list[Path]:
        """What may be logs, by name, but for a file called `made`."""
        found = (f for f in self._files() if f.suffix.lower() not in NO_LOGS and f.name != made)
        return sorted(found, key=lambda file: file.name)

    def close(self) -> None:
        """Remove the files that were not taken."""
        self._opened.close()

    def _files(self) -> list[Path]:
        return [file for file in self.folder.rglob("*") if file.is_file()]

    def _meshes(self) -> list[str]:
        """The meshes that URDFs name, as paths in the folder; the worker reads URDFs properly."""
        names: list[str] = []
        for urdf in self.folder.glob("*.urdf"):
            if urdf.stat().st_size <= LARGEST_URDF:
                text = urdf.read_text(encoding="utf-8", errors="replace")
                names += [name for name in _MESH.findall(text) if len(name) <= LONGEST_NAME]
        return list(dict.fromkeys(name.removeprefix("package://") for name in names))

    def _place(self, name: str) -> Path:
        """The path of a file: browsers send no folders, but measurements.toml and URDFs may name them."""
        try:
            named = self.named() or self._meshes()
        except InputError:
            named = []
        wanted = [entry for entry in named if Path(entry).name == Path(name).name]
        path = self.folder / (wanted[0] if len(wanted) == 1 else name)
        inside = path.resolve().is_relative_to(self.folder.resolve())
        return path if inside else self.folder / Path(name).name
