"""`python -m benchmarks.pictures`, without a browser: its options, and the animation's file format."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest

from benchmarks.pictures import __main__ as command
from benchmarks.pictures.animation import Frame, webp
from benchmarks.pictures.walk import LENGTH, MOST, SMALL


def still(image: Any, size: tuple[int, int], colour: tuple[int, int, int]) -> bytes:
    file = io.BytesIO()
    image.new("RGB", size, colour).save(file, "WEBP", lossless=True)
    return file.getvalue()


def test_pictures_are_written_where_they_are_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = []

    def pictures(animated: bool) -> list[tuple[str, bytes]]:
        asked.append(animated)
        return [("app.png", b"x" * 2000)]

    monkeypatch.setattr(command, "pictures", pictures)
    assert command.main(["--out", str(tmp_path / "new"), "--no-animation"]) == 0
    assert command.main(["--out", str(tmp_path / "new")]) == 0
    assert asked == [False, True]
    assert (tmp_path / "new" / "app.png").stat().st_size == 2000 and "2 kB" in capsys.readouterr().out
    assert command.FOLDER.parts[-2:] == ("docs", "images")
    monkeypatch.setattr(command, "FOLDER", tmp_path / "usual")
    assert command.main([]) == 0 and (tmp_path / "usual" / "app.png").is_file()
    assert command.main(["--colour"]) == 2 and "--colour" in capsys.readouterr().err


def test_an_animation_changes_parts_of_its_picture() -> None:
    image = pytest.importorskip("PIL.Image")
    red, blue = (255, 0, 0), (0, 0, 255)
    file = webp(
        (30, 20),
        [
            Frame(0, 0, 30, 20, 200, still(image, (30, 20), red)),
            Frame(4, 6, 5, 3, 400, still(image, (5, 3), blue)),
        ],
    )
    read = image.open(io.BytesIO(file))
    assert read.size == (30, 20) and read.n_frames == 2 and read.info["loop"] == 0
    read.seek(0)
    assert read.convert("RGB").getcolors() == [(600, red)] and read.info["duration"] == 200
    read.seek(1)
    second = read.convert("RGB")
    assert sorted(second.getcolors()) == [(15, blue), (585, red)] and read.info["duration"] == 400
    assert second.crop((4, 6, 9, 9)).getcolors() == [(15, blue)]


def test_the_animation_in_the_documents_is_as_described() -> None:
    image = pytest.importorskip("PIL.Image")
    file = command.FOLDER / "app.webp"
    read = image.open(file)
    total = 0.0
    for number in range(read.n_frames):
        read.seek(number)
        read.load()
        total += read.info["duration"]
    assert read.size == SMALL and total == 1000 * LENGTH and file.stat().st_size <= MOST
