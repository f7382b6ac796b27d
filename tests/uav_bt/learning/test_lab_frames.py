"""Images of a lab from videos, records and photographs."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest

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
from uav_bt.learning import frame_sources
from uav_bt.learning.lab_frames import FramesSummary, take_frames, use_at
from uav_bt.learning.lab_material import LabMaterial
from uav_bt.types import CameraModel


@pytest.fixture
def material(tmp_path: Path) -> LabMaterial:
    return LabMaterial(lab=read_lab(write_lab("hall", tmp_path / "labs").parent))


def take(material: LabMaterial, *paths: Path, **options: Any) -> FramesSummary:
    return take_frames(material.lab, paths, **options)


def inside(material: LabMaterial) -> list[str]:
    return sorted(path.name for path in material.frames.iterdir())


# --- chosen images --------------------------------------------------------------------------------


@pytest.mark.parametrize(("codec", "suffix"), [("libx264", ".mp4"), ("libx265", ".mkv")])
def test_the_sharpest_image_of_each_half_second_is_taken(
    material: LabMaterial, tmp_path: Path, codec: str, suffix: str
) -> None:
    images = [blurred(view(place / 5), 2.0) for place in range(20)]  # ten a second
    for sharp in (3, 5, 12, 19):
        images[sharp] = view(sharp / 5)
    times_s = [number / 10 for number in range(20)]
    video = write_video(tmp_path / f"walk{suffix}", images, codec=codec, times_s=times_s)

    (summary,) = take(material, video).sources

    frames = material.read_frames()
    assert [one.time_s for one in frames] == pytest.approx([0.3, 0.5, 1.2, 1.9], abs=0.01)
    name = f"walk-{frames[0].content[:6]}"
    assert [one.image for one in frames] == [
        f"{name}-{time}.jpg" for time in ("00000.3", "00000.5", "00001.2", "00001.9")
    ]
    assert {one.source for one in frames} == {video.name}
    assert inside(material) == sorted([*(one.image for one in frames), "frames.csv"])
    assert (summary.read, summary.kept, summary.for_check) == (20, 4, 1)


def test_blurred_blank_and_repeated_images_are_left_out(
    material: LabMaterial, tmp_path: Path
) -> None:
    images = [*walk(6), blurred(view(5)), np.zeros_like(view(0)), view(0.0), view(0.0)]
    (summary,) = take(material, write_video(tmp_path / "a.mp4", images)).sources
    assert (summary.kept, summary.blurred, summary.alike, summary.surplus) == (6, 2, 2, 0)


def test_long_sides_are_at_most_1920_pixels(material: LabMaterial, tmp_path: Path) -> None:
    large = np.kron(view(0), np.ones((14, 14, 1))).astype(np.uint8)
    take(material, write_photograph(tmp_path / "a.png", large))
    written = cv2.imread(str(material.frames / inside(material)[0]))
    assert written is not None
    assert written.shape == (1080, 1920, 3)


def test_the_count_is_shared_by_duration(material: LabMaterial, tmp_path: Path) -> None:
    long = write_video(tmp_path / "long.mp4", walk(18))
    short = write_video(tmp_path / "short.mp4", walk(6, begin=12))
    first, second = take(material, long, short, count=8).sources
    assert (first.kept, second.kept) == (6, 2)
    assert first.surplus == 12


def test_parts_of_the_time_are_for_checks() -> None:
    uses = [use_at(time_s / 10, 10.0) for time_s in range(101)]
    checks = [number for number, use in enumerate(uses) if use == "check"]
    assert checks == [*range(40, 50), *range(90, 101)]
    assert use_at(0.0, 0.0) == "train"


def test_frames_of_a_record(material: LabMaterial, tmp_path: Path) -> None:
    width, height = SIZE
    model = CameraModel(
        width_px=width, height_px=height, fx_px=200.0, fy_px=200.0, cx_px=127.5, cy_px=71.5
    )
    frames = [frame(image, number, 7.0 + 0.5 * number) for number, image in enumerate(walk(6))]
    take(material, write_record(tmp_path / "flight.mcap", model, frames, []))
    assert [one.time_s for one in material.read_frames()] == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]


def test_photographs_of_a_folder(material: LabMaterial, tmp_path: Path) -> None:
    for number, image in enumerate(walk(10)):
        write_photograph(tmp_path / "card" / f"{number}.jpg", image)
    write_photograph(tmp_path / "card" / "again.png", view(0))
    write_photograph(tmp_path / "card" / "black.png", np.zeros_like(view(0)))
    write_photograph(tmp_path / "card" / "small.png", view(0)[:90])
    for name in ("broken.jpg", "._0.jpg", "x.heic"):
        (tmp_path / "card" / name).write_bytes(b"no image")
    summary = take(material, tmp_path / "card")
    (photographs,) = summary.sources
    assert (photographs.kept, photographs.for_check) == (10, 2)
    assert (photographs.blurred, photographs.alike) == (1, 1)
    assert [note.partition(":")[0] for note in photographs.notes] == [
        str(tmp_path / "card" / name) for name in ("broken.jpg", "small.png")
    ]
    assert "x.heic: a format that is not read" in summary.notes[0]


def test_images_of_a_video_are_let_go(tmp_path: Path) -> None:
    """Without the garbage collector: a 4K video's images would fill gigabytes until it runs."""
    video = write_video(tmp_path / "a.mp4", walk(20))
    gc.collect()
    gc.disable()
    try:
        most = 0
        for _ in VideoSource(video).images():
            most = max(most, sum(type(one) is av.VideoFrame for one in gc.get_objects()))
    finally:
        gc.enable()
    assert 1 <= most < 8


# --- further runs ---------------------------------------------------------------------------------


def test_a_further_run_adds_new_videos_only(
    material: LabMaterial, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = write_video(tmp_path / "old.mp4", walk(5))
    take(material, old)
    before = {name: (material.frames / name).stat().st_mtime_ns for name in inside(material)[1:]}
    watched = []
    watch = frame_sources.watch
    monkeypatch.setattr(
        frame_sources, "watch", lambda one, *rest: watched.append(one.name) or watch(one, *rest)
    )
    summary = take(material, old, write_video(tmp_path / "new.mp4", walk(5, begin=6)))
    assert watched == ["new.mp4"]
    assert [(one.kept, one.earlier) for one in summary.sources] == [(5, True), (5, False)]
    assert summary.total == len(material.read_frames()) == 10
    for name, changed in before.items():
        assert (material.frames / name).stat().st_mtime_ns == changed
    (material.frames / material.read_frames()[2].image).unlink()  # it stays deleted
    assert take(material, old).total == 9


def test_a_stopped_run_keeps_whole_sources(material: LabMaterial, tmp_path: Path) -> None:
    videos = [write_video(tmp_path / f"{n}.mp4", walk(5, begin=3 * n)) for n in range(2)]

    def stop(stage: str, _done: int, _total: int) -> None:
        if stage.endswith("1.mp4"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        take(material, *videos, advance=stop)
    frames = material.read_frames()
    assert {one.source for one in frames} == {"0.mp4"}
    assert inside(material) == sorted([*(one.image for one in frames), "frames.csv"])
    assert take(material, *videos).total == 10


def test_images_that_a_killed_run_left_are_used(material: LabMaterial, tmp_path: Path) -> None:
    video = write_video(tmp_path / "a.mp4", walk(5))
    take(material, video)
    names = inside(material)
    material.list_file.unlink()  # the images were moved, but the list was not written
    (material.frames / ".candidates-x").mkdir()
    (material.frames / ".candidates-x" / "0.jpg").touch()
    own = material.frames / names[0]
    own.write_bytes(b"edited")
    take(material, video)
    assert inside(material) == names
    assert own.read_bytes() == b"edited"


def test_another_recording_of_the_same_name_is_read(material: LabMaterial, tmp_path: Path) -> None:
    """Cameras count from 1 on each memory card; the order of the names means nothing."""
    days = [tmp_path / day for day in ("monday", "tuesday")]
    for begin, day in zip((0, 6), days, strict=True):
        write_video(day / "DJI_0001.MP4", walk(4, begin=begin))
        write_photograph(day / "IMG_0001.JPG", view(begin + 3))
    for day in days:
        assert not any(one.earlier for one in take(material, day).sources)
    listed = material.read_frames()
    assert {one.source for one in listed} == {"DJI_0001.MP4", "IMG_0001.JPG"}
    assert len({one.content for one in listed}) == 4
    assert all(one.earlier for one in take(material, *reversed(days)).sources)
    assert material.read_frames() == listed


def test_a_video_that_states_no_duration_is_not_cut_short(
    material: LabMaterial, tmp_path: Path
) -> None:
    video = write_video(tmp_path / "raw" / "tello.h264", walk(8))
    (summary,) = take(material, video.parent).sources
    assert (summary.read, summary.notes) == (8, ())


# --- names ----------------------------------------------------------------------------------------


def test_sources_with_the_same_name_do_not_collide(material: LabMaterial, tmp_path: Path) -> None:
    videos = [
        write_video(tmp_path / name, walk(3, begin=3 * number))
        for number, name in enumerate(("1/a.mp4", "2/a.mp4", "2/A.mov", "..Gang: Süd (2)?.mp4"))
    ]
    for _ in range(2):
        assert take(material, *videos, videos[0]).total == 12
    stems = {one.source: one.image.split("-")[:-2] for one in material.read_frames()}
    assert stems == {"a.mp4": ["a"], "A.mov": ["A"], "..Gang: Süd (2)?.mp4": ["Gang", "Süd", "2"]}


# --- bad input ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("images", "words"),
    [
        ([blurred(image, 12.0) for image in walk(4)], "none of its images can be used: 0 are dark"),
        ([np.full_like(view(0), 9)] * 4, "none of its images can be used: 4 are dark"),
        ([view(0)] * 4, r"all its images look alike \(4 were compared\)"),
        (
            [image[:100] for image in walk(2)],
            "the images must have at least 224x112 pixels, got 256x100",
        ),
    ],
    ids=["blurred", "dark", "alike", "small"],
)
def test_a_video_without_a_good_image_is_refused(
    material: LabMaterial, tmp_path: Path, images: list[Any], words: str
) -> None:
    video = write_video(tmp_path / "a.mp4", images)
    with pytest.raises(FileError, match=f"a.mp4: {words}"):
        take(material, video)
    assert not material.frames.exists()


def test_a_bad_video_costs_no_good_one(material: LabMaterial, tmp_path: Path) -> None:
    bad = write_video(tmp_path / "bad.mp4", [view(0)] * 4)
    summary = take(material, bad, write_video(tmp_path / "good.mp4", walk(4)))
    assert summary.total == 4
    assert "bad.mp4: all its images look alike" in summary.refused[0]


def test_what_could_be_read_of_a_cut_video_is_used(material: LabMaterial, tmp_path: Path) -> None:
    video = write_video(tmp_path / "a.mkv", walk(30))
    video.write_bytes(video.read_bytes()[: video.stat().st_size // 2])
    (summary,) = take(material, video).sources
    assert 5 < summary.kept < 25


def test_the_labs_own_images_are_no_source(material: LabMaterial, tmp_path: Path) -> None:
    take(material, write_video(tmp_path / "a.mp4", walk(2)))
    with pytest.raises(FileError, match="is in the folder of the lab's images"):
        take(material, material.frames)


def test_a_format_that_is_not_read_is_named(material: LabMaterial, tmp_path: Path) -> None:
    (tmp_path / "a.heic").touch()
    with pytest.raises(InputError, match=r"a\.heic: a format that is not read; convert"):
        take(material, tmp_path / "a.heic")
