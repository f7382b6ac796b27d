"""Images of a lab: from videos, records and photographs, their list and their use."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest

from perception.segmentation.training.picks import read_picks
from sim_bridge.anafi import anafi_camera
from tests.uav_bt.learning.frames_world import (
    SIZE,
    blurred,
    view,
    walk,
    write_photograph,
    write_video,
)
from tests.worlds.footage import frame, write_record
from uav_bt.app.sources.video_source import VideoSource
from uav_bt.errors import FileError, InputError
from uav_bt.lab.lab_file import read_lab
from uav_bt.lab.shipped import write_lab
from uav_bt.learning.lab_frames import FramesSummary, take_frames, use_at
from uav_bt.learning.lab_material import LabMaterial


class Hall(LabMaterial):
    """A lab without images, and videos beside it."""

    def __init__(self, folder: Path) -> None:
        super().__init__(lab=read_lab(write_lab("hall", folder / "labs").parent))
        self.beside = folder

    def video(self, name: str, images: list[Any], **how: Any) -> Path:
        return write_video(self.beside / name, images, **how)

    def take(self, *paths: Path, **options: Any) -> FramesSummary:
        return take_frames(self.lab, paths, **options)

    def inside(self) -> list[str]:
        return sorted(path.name for path in self.frames.iterdir())


@pytest.fixture
def hall(tmp_path: Path) -> Hall:
    return Hall(tmp_path)


@pytest.mark.parametrize(("codec", "suffix"), [("libx264", ".mp4"), ("libx265", ".mkv")])
def test_the_sharpest_image_of_half_a_second_is_taken(hall: Hall, codec: str, suffix: str) -> None:
    images = [blurred(view(place / 5), 2.0) for place in range(20)]  # ten a second
    for sharp in (3, 5, 12, 19):
        images[sharp] = view(sharp / 5)
    times_s = [number / 10 for number in range(20)]
    video = hall.video(f"walk{suffix}", images, codec=codec, times_s=times_s)
    (summary,) = hall.take(video).sources
    frames = hall.read_frames()
    assert [one.time_s for one in frames] == pytest.approx([0.3, 0.5, 1.2, 1.9], abs=0.01)
    name = f"walk-{frames[0].content[:6]}"
    assert [one.image for one in frames] == [
        f"{name}-{time}.jpg" for time in ("00000.3", "00000.5", "00001.2", "00001.9")
    ]
    assert {one.source for one in frames} == {video.name}
    assert hall.inside() == sorted([*(one.image for one in frames), "frames.csv"])
    assert (summary.read, summary.kept, summary.for_check) == (20, 4, 1)


def test_blurred_blank_and_repeated_images_are_left_out(hall: Hall) -> None:
    images = [*walk(6), blurred(view(5)), np.zeros_like(view(0)), view(0.0), view(0.0)]
    (summary,) = hall.take(hall.video("a.mp4", images)).sources
    assert (summary.kept, summary.blurred, summary.alike, summary.surplus) == (6, 2, 2, 0)


def test_the_count_is_shared_by_duration(hall: Hall) -> None:
    videos = hall.video("long.mp4", walk(18)), hall.video("short.mp4", walk(6, begin=12))
    first, second = hall.take(*videos, count=8).sources
    assert (first.kept, second.kept, first.surplus) == (6, 2, 12)


def test_parts_of_the_time_are_for_checks() -> None:
    uses = [use_at(time_s / 10, 10.0) for time_s in range(101)]
    checks = [number for number, use in enumerate(uses) if use == "check"]
    assert checks == [*range(40, 50), *range(90, 101)]
    assert use_at(0.0, 0.0) == "train"


def test_frames_of_a_record(hall: Hall, tmp_path: Path) -> None:
    frames = [frame(image, number, 7.0 + 0.5 * number) for number, image in enumerate(walk(6))]
    hall.take(write_record(tmp_path / "flight.mcap", anafi_camera(*SIZE), frames, []))
    assert [one.time_s for one in hall.read_frames()] == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]


def test_photographs_of_a_folder(hall: Hall, tmp_path: Path) -> None:
    card = tmp_path / "card"
    for number, image in enumerate(walk(9)):
        write_photograph(card / f"{number}.jpg", image)
    large = np.kron(view(4.5), np.ones((14, 14, 1))).astype(np.uint8)
    others = {"9": large, "again": view(0), "black": np.zeros_like(view(0)), "small": view(0)[:90]}
    for name, image in others.items():
        write_photograph(card / f"{name}.png", image)
    for name in ("broken.jpg", "._0.jpg", "x.heic"):
        (card / name).write_bytes(b"no image")
    summary = hall.take(card)
    (found,) = summary.sources
    assert (found.kept, found.for_check, found.blurred, found.alike) == (10, 2, 1, 1)
    assert [note.partition(":")[0] for note in found.notes] == [
        str(card / name) for name in ("broken.jpg", "small.png")
    ]
    assert "1 of a format that is not read (heic): x.heic; convert" in summary.notes[0]
    (written,) = hall.frames.glob("9-*.jpg")
    reduced = cv2.imread(str(written))
    assert reduced is not None
    assert reduced.shape == (1080, 1920, 3)


def test_images_of_a_video_are_let_go(hall: Hall) -> None:
    """Without the garbage collector: a 4K video's images would fill gigabytes until it runs."""
    video = hall.video("a.mp4", walk(20))
    gc.collect()
    gc.disable()
    try:
        most = 0
        for _ in VideoSource(video).images():
            most = max(most, sum(type(one) is av.VideoFrame for one in gc.get_objects()))
    finally:
        gc.enable()
    assert 1 <= most < 8


def test_a_further_run_adds_new_videos_only(hall: Hall) -> None:
    old = hall.video("old.mp4", walk(5))
    hall.take(old)
    stages = set[str]()
    summary = hall.take(
        *(old, hall.video("new.mp4", walk(5, begin=6))), advance=lambda stage, *_: stages.add(stage)
    )
    assert stages == {"seconds of video, new.mp4"}
    assert [(one.kept, one.earlier) for one in summary.sources] == [(5, True), (5, False)]
    assert summary.total == len(hall.read_frames()) == 10
    (hall.frames / hall.read_frames()[2].image).unlink()  # it stays deleted
    assert hall.take(old).total == 9


def test_a_stopped_run_keeps_whole_sources(hall: Hall) -> None:
    videos = [hall.video(f"{number}.mp4", walk(5, begin=3 * number)) for number in range(2)]

    def stop(stage: str, _done: int, _total: int) -> None:
        if stage.endswith("1.mp4"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        hall.take(*videos, advance=stop)
    frames = hall.read_frames()
    assert {one.source for one in frames} == {"0.mp4"}
    assert hall.inside() == sorted([*(one.image for one in frames), "frames.csv"])
    assert hall.take(*videos).total == 10


def test_images_that_a_killed_run_left_are_used(hall: Hall) -> None:
    video = hall.video("a.mp4", walk(5))
    hall.take(video)
    names = hall.inside()
    hall.list_file.unlink()  # the images were moved, but the list was not written
    (hall.frames / ".candidates-x").mkdir()
    (hall.frames / ".candidates-x" / "0.jpg").touch()
    own = hall.frames / names[0]
    own.write_bytes(b"edited")
    hall.take(video)
    assert hall.inside() == names
    assert own.read_bytes() == b"edited"


def test_another_recording_of_the_same_name_is_read(hall: Hall, tmp_path: Path) -> None:
    """Cameras count from 1 on each memory card; the order of the names means nothing."""
    days = [tmp_path / day for day in ("monday", "tuesday")]
    for begin, day in zip((0, 6), days, strict=True):
        hall.video(f"{day.name}/Gang: Süd (2)?.mp4", walk(4, begin=begin))
        write_photograph(day / "IMG_0001.JPG", view(begin + 3))
    for day in days:
        assert not any(one.earlier for one in hall.take(day, day).sources)
    listed = hall.read_frames()
    assert {one.source for one in listed} == {"Gang: Süd (2)?.mp4", "IMG_0001.JPG"}
    assert {one.image[:8] for one in listed} == {"Gang-Süd", "IMG_0001"}
    assert len({one.content for one in listed}) == 4
    assert all(one.earlier for one in hall.take(*reversed(days)).sources)
    assert hall.read_frames() == listed


@pytest.mark.parametrize(
    ("images", "words"),
    [
        ([blurred(image, 12.0) for image in walk(4)], "none of its images can be used: 0 are dark"),
        ([np.full_like(view(0), 9)] * 4, "none of its images can be used: 4 are dark"),
        ([view(0)] * 4, r"all its images look alike \(4 were compared\)"),
        ([view(0)[:100]], "the images must have at least 224x112 pixels, got 256x100"),
    ],
    ids=["blurred", "dark", "alike", "small"],
)
def test_a_video_without_a_good_image_is_refused_and_costs_no_good_one(
    hall: Hall, images: list[Any], words: str
) -> None:
    bad = hall.video("a.mp4", images)
    with pytest.raises(FileError, match=f"a.mp4: {words}") as refused:
        hall.take(bad)
    assert not hall.frames.exists()
    summary = hall.take(bad, hall.video("good.mp4", walk(4)))
    assert (summary.total, summary.refused) == (4, (str(refused.value),))


def test_what_could_be_read_of_a_cut_video_is_used(hall: Hall) -> None:
    video = hall.video("a.mkv", walk(30))
    video.write_bytes(video.read_bytes()[: video.stat().st_size // 2])
    (summary,) = hall.take(video).sources
    assert 5 < summary.kept < 25


def test_the_labs_own_images_and_foreign_formats_are_no_source(hall: Hall, tmp_path: Path) -> None:
    hall.take(hall.video("a.mp4", walk(2)))
    with pytest.raises(FileError, match="is among the lab's own images"):
        hall.take(hall.frames)
    for name in "ab":
        (tmp_path / f"{name}.png").write_text(f"no image {name}")
    with pytest.raises(FileError, match=r"none of its images can be used.*a\.png.*b\.png"):
        hall.take(tmp_path / "a.png", tmp_path / "b.png")
    (tmp_path / "a.heic").touch()
    with pytest.raises(InputError, match=r"a format that is not read \(heic\): a\.heic; convert"):
        hall.take(tmp_path / "a.heic")


# --- the list of the images -----------------------------------------------------------------------


def _add_images(hall: Hall, count: int) -> None:
    hall.frames.mkdir(exist_ok=True)
    for number in range(count):
        cv2.imwrite(str(hall.frames / f"{number:02d}.png"), np.zeros((4, 6, 3), np.uint8))


def test_images_that_were_copied_keep_their_use(hall: Hall) -> None:
    _add_images(hall, 10)
    first = hall.uses()
    assert [name for name, use in first.items() if use == "check"] == ["04.png", "09.png"]
    hall.keep_uses(first)  # as training does
    for name in ("A_extra.png", "._00.png"):
        cv2.imwrite(str(hall.frames / name), np.zeros((4, 6, 3), np.uint8))
    (hall.frames / "02.png").unlink()
    kept = {name: use for name, use in first.items() if name != "02.png"}
    assert hall.uses() == {"A_extra.png": "train", **kept}


def test_a_byte_order_mark_and_empty_lines_are_no_fault(hall: Hall) -> None:
    _add_images(hall, 1)
    text = "\ufeffimage,source,time_s,sharpness,use\n00.png,a.mp4,0.0,1.0,check\n\n\n"
    hall.list_file.write_text(text, encoding="utf-8")
    assert hall.uses() == {"00.png": "check"}
    text = "\ufeffimage,x,y,class,origin\n00.png,1,2,FLOOR,hand\n\n\n"
    floor = hall.lab.classes.names[hall.lab.classes.ground]
    hall.picks.write_text(text.replace("FLOOR", floor), encoding="utf-8")
    (pick,) = read_picks(hall.picks, hall.lab.classes)
    assert (pick.x, pick.y) == (1, 2)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("a.png,v.mp4,0.0,1.0", "column use: Field required"),
        ("../a.png,v.mp4,0.0,1.0,train", "column image: .*, got '../a.png'"),
        ("a.png,v.mp4,0.0,1.0,test", "column use: .* 'train' or 'check', got 'test'"),
        ("a.png,v.mp4,nan,1.0,train", "column time_s: .* finite number, got 'nan'"),
    ],
)
def test_a_malformed_list_names_the_line(hall: Hall, line: str, words: str) -> None:
    _add_images(hall, 1)
    hall.list_file.write_text(f"image,source,time_s,sharpness,use\n{line}\n")
    with pytest.raises(FileError, match=words) as caught:
        hall.uses()
    assert str(caught.value).startswith(f"{hall.list_file}:2")
