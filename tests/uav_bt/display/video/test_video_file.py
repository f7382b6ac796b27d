"""The mp4 writer: its files are readable, and complete or absent."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from uav_bt.display.video import video_file
from uav_bt.display.video.video_file import VideoFile
from uav_bt.errors import FileError, MissingDependencyError

SIZE_PX = (64, 48)


def open_file(path: Path, **changes: Any) -> VideoFile:
    return VideoFile(path, **{"size_px": SIZE_PX, "frames_per_s": Fraction(20), **changes})


def plain(colour: int | tuple[int, int, int]) -> NDArray[np.uint8]:
    return np.full((48, 64, 3), colour, dtype=np.uint8)


def decoded(path: Path) -> list[tuple[float, NDArray[np.uint8]]]:
    with av.open(str(path)) as container:
        return [
            (float(image.time), image.to_ndarray(format="rgb24"))
            for image in container.decode(video=0)
        ]


def test_pictures_come_back_with_their_times_and_colours(tmp_path: Path) -> None:
    file = open_file(tmp_path / "flight.mp4")
    colours = [(200, 30, 30), (30, 200, 30), (30, 30, 200)]
    for colour, slot in zip(colours, (None, None, 10), strict=True):
        file.write(plain(colour), slot)
    file.close()
    images = decoded(file.path)
    assert [time for time, _ in images] == pytest.approx([0.0, 0.05, 0.5])
    for (_, image), colour in zip(images, colours, strict=True):
        assert np.abs(image.reshape(-1, 3).mean(axis=0) - colour).max() < 8


def test_the_name_appears_only_when_the_file_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "flight.mp4"
    path.write_bytes(b"the one before")
    file = open_file(path)
    file.write(plain(10))
    assert path.read_bytes() == b"the one before"
    file.close()
    file.close()
    assert len(decoded(path)) == 1
    assert list(tmp_path.iterdir()) == [path], "nothing else is left"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nowhere/flight.mp4", "does not exist"),
        ("taken/flight.mp4", "is a file and no folder"),
        ("flight.avi", "must end in .mp4"),
        ("folder.mp4", "is a folder"),
    ],
)
def test_a_file_that_cannot_be_written_is_refused_and_nothing_is_left(
    tmp_path: Path, name: str, message: str
) -> None:
    (tmp_path / "taken").write_text("a file")
    (tmp_path / "folder.mp4").mkdir()
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(FileError, match=message):
        open_file(tmp_path / name)
    assert sorted(tmp_path.rglob("*")) == before


def test_without_an_encoder_the_message_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(video_file, "_CODEC", "no_such_encoder")
    with pytest.raises(MissingDependencyError, match="pip install"):
        open_file(tmp_path / "flight.mp4")
    assert list(tmp_path.iterdir()) == []
