"""Pictures from files, folders and cameras; reactions to unreadable ones."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from tests.uav_bt.learning.frames_world import write_video
from tests.worlds.footage import frame, write_record
from uav_bt.app.sources.by_name import CameraSource, FolderSource, open_source
from uav_bt.app.sources.video_source import VideoSource
from uav_bt.clock import ManualClock
from uav_bt.errors import FileError, InputError, ShapeError
from uav_bt.types import CameraModel

RED = (200, 30, 40)


def image(path: Path, colour: tuple[int, int, int] = RED, size: tuple[int, int] = (32, 18)) -> None:
    bgr = np.full((size[1], size[0], 3), colour[::-1], dtype=np.uint8)
    assert cv2.imwrite(str(path), bgr)


encoded = partial(write_video, codec="mpeg4", rate=10)


def marked() -> NDArray[np.uint8]:
    """Return an image of 64x36 pixels whose upper left quarter is red."""
    one = np.full((36, 64, 3), 90, np.uint8)
    one[:18, :32] = RED
    return one


def noise(count: int) -> list[NDArray[np.uint8]]:
    return list(np.random.default_rng(0).integers(0, 255, (count, 36, 64, 3), dtype=np.uint8))


def test_a_folders_images_come_ten_a_second_by_name_and_number(tmp_path: Path) -> None:
    for name in ("view_10.png", "view_9.png", "1\u00b23.png", "b.jpg"):  # no number: 1\u00b23
        image(tmp_path / name)
    (tmp_path / "notes.txt").write_text("no image")
    source = open_source(str(tmp_path))
    names = ["1\u00b23.png", "b.jpg", "view_9.png", "view_10.png"]
    assert [(one.name, one.time_s) for one in source.images()] == [
        (name, pytest.approx(0.1 * place)) for place, name in enumerate(names)
    ]
    assert (source.total, list(source.skipped)) == (4, [])
    timed = open_source(str(tmp_path), times_s=[0.0, 0.3, 0.9, 1.0])
    assert [one.time_s for one in timed.images(every=2)] == [0.0, 0.9]
    with pytest.raises(ShapeError, match="2, as many as the telemetry has entries, got 4"):
        open_source(str(tmp_path), times_s=[0.0, 0.3])
    (first,) = FolderSource(tmp_path / "view_9.png").images()
    assert tuple(first.pixels()[0, 0]) == RED
    assert first.pixels().shape == (18, 32, 3)


def test_unreadable_images_are_named_and_left_out(tmp_path: Path) -> None:
    image(tmp_path / "a.png")
    (tmp_path / "b.png").write_bytes(b"no image")
    (tmp_path / "c.png").touch()
    (tmp_path / "e.png").mkdir()
    image(tmp_path / "f.png")
    source = FolderSource(tmp_path)
    assert [one.index for one in source.images()] == [0, 4]
    told = "\n".join(source.skipped)
    assert "b.png: is not a readable image" in told
    assert "c.png: is not a readable image" in told
    assert "e.png: cannot be read: Is a directory" in told


def test_formats_that_are_not_read_are_named(tmp_path: Path) -> None:
    image(tmp_path / "a.png")
    for name in ("1.avif", "2.heic", "3.heic", "4.heic"):
        (tmp_path / name).touch()
    (line,) = FolderSource(tmp_path).skipped
    assert "4 of a format that is not read (avif, heic): 1.avif, 2.heic, 3.heic and 1 more" in line
    (tmp_path / "a.png").unlink()
    with pytest.raises(FileError, match=r"holds no images .*; it holds 4 of a format"):
        FolderSource(tmp_path)
    source = open_source(str(tmp_path / "2.heic"))
    assert list(source.images()) == []
    assert "convert them to PNG" in source.skipped[0]


def test_twelve_bits_in_a_sixteen_bit_file_are_scaled(tmp_path: Path) -> None:
    deep = np.full((18, 32, 3), (160, 480, 3200), np.uint16)  # blue, green, red of 4095
    assert cv2.imwrite(str(tmp_path / "deep.png"), deep)
    (one,) = FolderSource(tmp_path).images()
    assert one.pixels()[0, 0].tolist() == [200, 30, 10]


# --- video files ----------------------------------------------------------------------------------


def test_a_videos_images_come_with_their_times(tmp_path: Path) -> None:
    source = open_source(str(encoded(tmp_path / "flight.mp4", noise(6))))
    images = list(source.images())
    assert [one.time_s for one in images] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])
    assert images[0].pixels().shape == (36, 64, 3)
    assert (source.total, source.rate_per_s) == (6, pytest.approx(10.0))
    third = source.images(every=3)
    assert [(one.index, round(one.time_s, 3)) for one in third] == [(0, 0.0), (3, 0.3)]


@pytest.mark.parametrize(
    ("matrix", "stored"),
    [
        ((-1, 0, 0, -1), np.rot90(marked(), 2)),
        ((0, 1, -1, 0), np.rot90(marked())),  # a player turns it clockwise
        ((-1, 0, 0, 1), marked()[:, ::-1]),
    ],
    ids=["half a turn", "quarter", "mirrored"],
)
def test_images_are_turned_as_players_turn_them(
    tmp_path: Path, matrix: tuple[int, ...], stored: NDArray[np.uint8]
) -> None:
    path = encoded(tmp_path / "drone.mp4", [np.ascontiguousarray(stored)] * 3)
    content = bytearray(path.read_bytes())
    a, b, c, d = (65536 * number for number in matrix)  # 16.16 fixed point
    place = content.index(b"tkhd") + 4 + 40  # the matrix follows 40 bytes after the box's type
    content[place : place + 36] = struct.pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)
    path.write_bytes(content)
    first = next(VideoSource(path).images())
    assert first.pixels().shape == (36, 64, 3)
    assert first.pixels()[4, 4] == pytest.approx(RED, abs=25)
    assert first.pixels()[30, 60] == pytest.approx((90, 90, 90), abs=25)
    assert not first.orientation.upright


def boxes(content: bytes) -> list[tuple[bytes, bytes]]:
    """Return type and whole bytes of the boxes of an mp4 file."""
    found, place = [], 0
    while place < len(content):
        size, kind = struct.unpack_from(">I4s", content, place)
        found.append((kind, content[place : place + size]))
        place += size
    return found


def test_a_cover_picture_before_the_video_is_no_video(tmp_path: Path) -> None:
    """Some drones write the cover ahead of the tracks, which makes it the first stream."""
    path = encoded(tmp_path / "drone.mp4", noise(6), cover=np.full((18, 32, 3), 9, np.uint8))
    content = path.read_bytes()
    (movie,) = (box for kind, box in boxes(content) if kind == b"moov")
    order = {b"mvhd": 0, b"udta": 1}
    inside = sorted(boxes(movie[8:]), key=lambda box: order.get(box[0], 2))
    path.write_bytes(content.replace(movie, movie[:8] + b"".join(box for _, box in inside)))
    images = list(VideoSource(path).images())
    assert len(images) == 6
    assert images[0].pixels().shape == (36, 64, 3)


def test_times_go_on_where_two_recordings_are_joined(tmp_path: Path) -> None:
    part = encoded(tmp_path / "part.ts", noise(6)).read_bytes()
    (tmp_path / "joined.ts").write_bytes(part + part)
    times_s = [one.time_s for one in VideoSource(tmp_path / "joined.ts").images()]
    assert len(times_s) >= 11  # the packet at the joint may be reported as damaged
    assert times_s[-1] == pytest.approx(1.1, abs=0.11)
    assert (np.diff(times_s) > 0.0).all()


def test_damaged_images_are_left_out_and_counted(tmp_path: Path) -> None:
    path = encoded(tmp_path / "radio.ts", noise(30))
    content = bytearray(path.read_bytes())
    for place in range(len(content) // 3, len(content) // 2, 97):
        content[place] ^= 0xFF
    path.write_bytes(content)
    source = VideoSource(path)
    images = list(source.images())
    (line,) = source.skipped
    count = int(line.split()[0])
    assert count > 0
    assert "damaged images" in line
    assert len(images) <= 30 - count
    assert max(one.time_s for one in images) <= 2.9  # no time stamp of a damaged packet


@pytest.mark.parametrize("name", ["2026-11-26T12:00:00.mp4", "file:drone.mp4"])
def test_a_colon_in_a_videos_name_is_no_protocol(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    encoded(tmp_path / "drone.mp4", noise(2)).rename(tmp_path / name)
    monkeypatch.chdir(tmp_path)
    assert len(list(open_source(name).images())) == 2


def coloured(
    path: Path,
    *,
    size: tuple[int, int] = (1280, 720),
    colorspace: int = 2,
    color_trc: int = 2,
    aspect: Fraction = Fraction(1),
) -> Path:
    """Write a video of one red, stored by BT.709, with such tags."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=2, options={"crf": "4"})
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        codec = stream.codec_context
        codec.colorspace, codec.color_trc, codec.sample_aspect_ratio = colorspace, color_trc, aspect
        codec.color_range = 1
        picture = av.VideoFrame(*size, "yuv420p")
        for plane, level in zip(picture.planes, (73, 115, 202), strict=True):  # Y, Cb, Cr of RED
            plane.update(bytes([level]) * plane.buffer_size)
        for number in range(3):
            picture.pts, picture.time_base = number, Fraction(1, 2)
            picture.colorspace, picture.color_range = colorspace, 1
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
    return path


def test_untagged_colours_of_high_definition_are_those_of_bt_709(tmp_path: Path) -> None:
    for name, tag in (("tagged.mp4", 1), ("untagged.mp4", 2)):
        source = VideoSource(coloured(tmp_path / name, colorspace=tag))
        first = next(source.images())
        assert first.pixels()[300, 300] == pytest.approx(RED, abs=4), name
        assert first.pixels((64, 36))[9, 9] == pytest.approx(RED, abs=4), name
        assert not source.warnings


def test_a_video_in_hdr_has_a_warning_and_wide_pixels_are_widened(tmp_path: Path) -> None:
    for transfer, name in ((16, "PQ"), (18, "HLG")):
        path = tmp_path / f"{name}.mp4"
        wide = {"size": (120, 90), "aspect": Fraction(4, 3)}
        source = VideoSource(coloured(path, color_trc=transfer, **wide))
        (line,) = source.warnings
        assert f"the video is HDR ({name})" in line
        first = next(source.images())
        assert (first.size_px, first.pixels().shape) == ((160, 90), (90, 160, 3))


@pytest.mark.parametrize("name", ["a.png", "a.jpg"])
def test_exif_data_turn_image_and_camera(tmp_path: Path, name: str) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6  # a quarter clockwise
    Image.fromarray(marked()).save(tmp_path / name, exif=exif, quality=98)
    (one,) = FolderSource(tmp_path / name).images()
    assert np.abs(one.pixels().astype(int) - np.rot90(marked(), -1)).mean() < 12.0
    assert one.orientation.transpose


def test_a_records_frames_keep_their_times(tmp_path: Path) -> None:
    model = CameraModel(width_px=32, height_px=18, fx_px=25.0, fy_px=25.0, cx_px=15.5, cy_px=8.5)
    images = np.zeros((3, 18, 32, 3), np.uint8)
    frames = [frame(image, 3 * place, 0.2 * place) for place, image in enumerate(images)]
    source = open_source(str(write_record(tmp_path / "flight.mcap", model, frames, [])))
    assert source.rate_per_s == pytest.approx(5.0)
    assert (source.total, source.rate_per_s) == (3, pytest.approx(5.0))
    assert [one.time_s for one in source.images(every=2)] == [0.0, 0.4]


# --- cameras --------------------------------------------------------------------------------------


class Device:
    """Replaces OpenCV's camera: returns some images, some of them broken, then stops."""

    def __init__(self, whole: Sequence[bool], *, opens: bool = True) -> None:
        self.clock, self.whole, self.opens = ManualClock(), list(whole), opens
        self.grabbed, self.released = -1, False
        self.isOpened = lambda: opens
        self.set = lambda *_: True

    def grab(self) -> bool:
        self.clock.advance(0.05)
        self.grabbed += 1
        return self.grabbed < len(self.whole)

    def retrieve(self) -> tuple[bool, NDArray[np.uint8] | None]:
        image = np.full((18, 32, 3), RED[::-1], np.uint8)
        return self.whole[self.grabbed], image if self.whole[self.grabbed] else None

    def release(self) -> None:
        self.released = True


def camera(device: Device, monkeypatch: pytest.MonkeyPatch) -> CameraSource:
    monkeypatch.setattr(cv2, "VideoCapture", lambda _: device)
    return CameraSource(0, device.clock)


def test_a_camera_sends_until_it_stops_or_nobody_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    device = Device([True, False, True])
    source = camera(device, monkeypatch)
    images = list(source.images())
    assert [one.time_s for one in images] == pytest.approx([0.05, 0.15])
    assert tuple(images[0].pixels()[0, 0]) == RED
    assert source.skipped == ["image 1: did not arrive whole", "the camera stopped after 3 images"]
    assert device.released
    device = Device([True] * 5)
    more = camera(device, monkeypatch).images()
    next(more)
    more.close()
    assert device.released


def test_a_camera_is_named_by_its_number_and_sends_images(monkeypatch: pytest.MonkeyPatch) -> None:
    assert open_source("camera:2").name == "camera:2"
    for opens, words in (
        (False, "camera 0 does not open; is it plugged in, and free"),
        (True, "camera 0 opens, but sends no images"),
    ):
        device = Device([], opens=opens)
        with pytest.raises(InputError, match=words):
            next(camera(device, monkeypatch).images())
        assert device.released
