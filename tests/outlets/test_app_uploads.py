"""Files from a browser: what comes in, and what does not."""

from __future__ import annotations

import io
import resource
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from flexviz.base.errors import InputError
from flexviz.content.session import Session, save_session
from flexviz.data.measurements import read_set
from flexviz.outlets.app import uploads
from flexviz.outlets.app.uploads import UploadFolder, new_folder, safe_name, take, unpack
from flexviz.robot.robot_files import resolve_mesh
from tests.robot.test_bad_robots import chain
from tests.small_set import write_small_set


def zip_of(files: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def set_files(folder: Path) -> dict[str, bytes]:
    return {str(f.relative_to(folder)): f.read_bytes() for f in folder.rglob("*") if f.is_file()}


def test_a_zip_becomes_a_set(tmp_path: Path) -> None:
    files = set_files(write_small_set(tmp_path / "small"))
    for prefix in ("", "outer/"):
        content = zip_of({prefix + name: data for name, data in files.items()} | {prefix + ".DS_Store": b"x"})
        folder = unpack("../../mine.zip", content, tmp_path / "in")
        assert folder.parent == tmp_path / "in" and folder.name.startswith("mine")
        assert len(read_set(folder).groups) == 3 and not (folder / ".DS_Store").exists()
    assert sorted(p.name for p in (tmp_path / "in").iterdir()) == ["mine", "mine-2"]


@pytest.mark.parametrize(
    "name, why",
    [
        ("../out.csv", "leads out"),
        ("/etc/x.csv", "leads out"),
        ("a/../../out.csv", "leads out"),
        ("..\\out.csv", "leads out"),
        ("C:\\out.csv", "leads out"),
        ("run.sh", "can be uploaded"),
        ("bad.py", "can be uploaded"),
        ("A.CSV", "same name"),
    ],
)
def test_a_zip_cannot_leave_its_folder(tmp_path: Path, name: str, why: str) -> None:
    content = zip_of({"measurements.toml": b"", "a.csv": b"", name: b"x"})
    with pytest.raises(InputError, match=why):
        unpack("s.zip", content, tmp_path / "in")
    assert not list(tmp_path.rglob("*.csv")) and not list((tmp_path).glob("in/*"))


def test_links_bombs_and_rubbish(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    link = zipfile.ZipInfo("a.csv")
    link.external_attr = 0o120777 << 16
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("measurements.toml", "")
        archive.writestr(link, "/etc/passwd")
    with pytest.raises(InputError, match="plain file"):
        unpack("s.zip", buffer.getvalue(), tmp_path)
    with pytest.raises(InputError, match="usable zip"):
        unpack("s.zip", b"PK rubbish", tmp_path)
    for files in ({"a.csv": b""}, {"a.urdf": b"", "b.urdf": b""}):
        with pytest.raises(InputError, match=r"neither measurements\.toml nor session\.json"):
            unpack("s.zip", zip_of(files), tmp_path)
    monkeypatch.setattr(uploads, "LARGEST_SET", 1000)
    with pytest.raises(InputError, match="MB unpacked"):
        unpack("s.zip", zip_of({"measurements.toml": b"x" * 2000}), tmp_path)
    monkeypatch.setattr(uploads, "MAX_FILES", 1)
    with pytest.raises(InputError, match="files; at most"):
        unpack("s.zip", zip_of({"measurements.toml": b"", "a.csv": b""}), tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_not_called_a_broken_zip(
    tmp_path: Path, incoming: UploadFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    complete = write_small_set(tmp_path / "small")
    content = zip_of(set_files(complete))
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limit[1]))
    try:
        for keep in (incoming.unpack, incoming.put):
            with pytest.raises(InputError, match=r"^mine.zip: cannot be kept \(File too large\)$"):
                keep("mine.zip", content)
        assert not list(incoming.folder.rglob("*"))
        with pytest.raises(InputError, match=r"^small: cannot be kept \(.*File too large.*\)$"):
            take(complete, tmp_path / "in")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    assert not list((tmp_path / "in").iterdir())


@pytest.mark.parametrize("name", ["", "..", "/", "a/", ".hidden.csv", "x.exe", "noend"])
def test_bad_names(name: str) -> None:
    with pytest.raises(InputError):
        safe_name(name)


def test_good_names(tmp_path: Path) -> None:
    assert safe_name("../../etc/ä b.csv") == "ä b.csv" and safe_name("C:\\x\\y.TOML") == "y.TOML"
    (tmp_path / "x").mkdir()
    assert new_folder(tmp_path, "x").name == "x-2" and new_folder(tmp_path, "../..").parent == tmp_path


@pytest.fixture
def incoming() -> Iterator[UploadFolder]:
    one = UploadFolder()
    yield one
    one.close()
    assert not one.folder.exists()


def test_files_one_by_one_in_any_order(tmp_path: Path, incoming: UploadFolder) -> None:
    folder = write_small_set(tmp_path / "small")
    assert incoming.missing() == ["measurements.toml"] and incoming.no_set
    for name in ("sub/c.csv", "measurements.toml", "a.csv", "b.parquet"):  # a browser sends no folder
        incoming.put(name, (folder / name).read_bytes())
    assert (incoming.folder / "sub" / "c.csv").is_file() and incoming.missing() == ["robot.urdf"]
    incoming.put("robot.urdf", (folder / "robot.urdf").read_bytes())
    assert not incoming.missing() and incoming.count == 5
    there = take(incoming.folder, tmp_path / "in")
    incoming.begin()
    assert len(read_set(there).groups) == 3 and incoming.count == 0
    assert [entry.name for entry in (tmp_path / "in").iterdir()] == [there.name]
    incoming.put("measurements.toml", b"[[")
    with pytest.raises(InputError, match=r"measurements\.toml"):
        incoming.missing()


def test_a_zip_without_its_robot_waits_for_it(tmp_path: Path, incoming: UploadFolder) -> None:
    files = set_files(write_small_set(tmp_path / "small"))
    urdf = files.pop("robot.urdf")
    incoming.unpack("mine.zip", zip_of(files))
    assert incoming.missing() == ["robot.urdf"] and not incoming.no_set
    incoming.put("robot.urdf", urdf)
    assert not incoming.missing() and take(incoming.folder, tmp_path / "in").name == "mine"


def test_a_session_cannot_name_a_set_elsewhere(tmp_path: Path, incoming: UploadFolder) -> None:
    measurements = read_set(write_small_set(tmp_path / "private"))
    folder = save_session(Session.of(measurements), measurements, tmp_path / "kept")
    incoming.unpack("mine.zip", zip_of(set_files(folder)))
    assert incoming.missing() == ["measurements.toml"]
    with pytest.raises(InputError, match=r"measurements\.toml is missing, expected a session that carries"):
        take(incoming.folder, tmp_path / "in")


def test_what_cannot_be_read_is_not_taken(tmp_path: Path, incoming: UploadFolder) -> None:
    files = set_files(write_small_set(tmp_path / "small")) | {"a.csv": b"time\n0\n"}
    incoming.unpack("mine.zip", zip_of(files))
    with pytest.raises(InputError, match=r"^a\.csv"):
        take(incoming.folder, tmp_path / "in")
    assert not (tmp_path / "in").exists()


def test_a_robot_of_thousands_of_joints_is_not_taken(tmp_path: Path, incoming: UploadFolder) -> None:
    files = set_files(write_small_set(tmp_path / "small")) | {"robot.urdf": chain(5000).encode()}
    incoming.unpack("mine.zip", zip_of(files))
    with pytest.raises(InputError, match=r"robot\.urdf: 5001 links, expected at most 1000"):
        take(incoming.folder, tmp_path / "in")
    assert not (tmp_path / "in").exists()


def test_a_name_in_the_set_cannot_lead_out(tmp_path: Path, incoming: UploadFolder) -> None:
    incoming.put("measurements.toml", b"format = 1\nrobot = '../../out.urdf'\n")
    file = incoming.put("out.urdf", b"<robot/>")
    assert file.parent == incoming.folder and incoming.missing() == ["../../out.urdf"]


def test_an_endless_name_is_none(incoming: UploadFolder) -> None:
    incoming.put("measurements.toml", f"format = 1\nrobot = '{'9' * 5000}.urdf'\n".encode())
    with pytest.raises(InputError, match=r"measurements\.toml: '999.* is no file name"):
        incoming.missing()


def test_an_incoming_has_limits(monkeypatch: pytest.MonkeyPatch, incoming: UploadFolder) -> None:
    monkeypatch.setattr("flexviz.outlets.app.uploads.LARGEST_SET", 10)
    with pytest.raises(InputError, match="together"):
        incoming.put("a.csv", b"x" * 11)
    monkeypatch.setattr("flexviz.outlets.app.uploads.MAX_FILES", 1)
    incoming.put("a.csv", b"")
    with pytest.raises(InputError, match="more than 1 files"):
        incoming.put("b.csv", b"")
    assert incoming.urdf() is None


def test_meshes_go_where_the_urdf_looks_for_them(incoming: UploadFolder) -> None:
    incoming.put("arm.stl", b"solid")
    names = ("package://arm_description/meshes/arm.stl", "visual/hand.stl", "../../out.stl")
    meshes = "".join(f"<mesh filename='{name}' />" for name in names)
    urdf = incoming.put("arm.urdf", f"<robot>{meshes}</robot>".encode())
    for name in ("hand.stl", "out.stl"):
        incoming.put(name, b"solid")
    assert resolve_mesh(names[0], urdf) == urdf.parent / "arm_description/meshes/arm.stl"
    assert resolve_mesh(names[1], urdf) == urdf.parent / "visual/hand.stl"
    assert sorted(p.name for p in incoming.folder.iterdir()) == [
        "arm.urdf",
        "arm_description",
        "out.stl",
        "visual",
    ]
