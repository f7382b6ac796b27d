"""The film of a flight, and the mp4 writer."""

import math
from contextlib import closing
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.paper_lab import CLASSES
from tests.uav_bt.display.display_world import World, facts, has
from uav_bt.display.canvas import PANEL
from uav_bt.display.shown import phase_colours
from uav_bt.display.video import video_file
from uav_bt.display.video.video import FlightVideo, open_film
from uav_bt.display.video.video_file import VideoFile
from uav_bt.errors import FileError, MissingDependencyError, ValueRangeError
from uav_bt.mission.tick import TickRecord
from uav_bt.types import Pose
from uav_bt.types.flight_results import EventKind, FlightEvent


def panes_of(world: World, **changes: Any) -> FlightVideo:
    nowhere: Any = None
    return FlightVideo(nowhere, world.board, facts(**changes))


def drawn(video: FlightVideo, record: TickRecord) -> NDArray[np.uint8]:
    video._flown.add(record)
    return video.draw(record)


def fly(video: FlightVideo, world: World, ticks: int, after_s: float = 0.1) -> None:
    for index in range(ticks):
        world.see()
        pose = Pose(x_m=0.05 * index, y_m=0.0, z_m=1.5, yaw_rad=0.0)
        video.on_tick(world.tick(pose=pose, after_s=after_s))


def decoded(path: Path) -> list[tuple[float, NDArray[np.uint8]]]:
    with av.open(str(path)) as container:
        return [
            (float(image.time), image.to_ndarray(format="rgb24"))
            for image in container.decode(video=0)
        ]


def times_of(path: Path) -> list[float]:
    return [time_s for time_s, _ in decoded(path)]


@pytest.mark.parametrize(
    ("speed", "pauses_s", "times_s"),
    [
        (2.0, [0.1] * 6, [0.0, 0.05, 0.1, 0.15, 0.2, 0.25]),
        (1.0, [1 / 30] * 9, [0.0, 0.1, 0.2]),
        (1.0, [0.1, 1.1, 0.1], [0.0, 0.1, 1.2]),
    ],
    ids=["speed", "ticks faster than the video", "a pause"],
)
def test_images_lie_where_their_ticks_were(
    tmp_path: Path, speed: float, pauses_s: list[float], times_s: list[float]
) -> None:
    world = World()
    with closing(open_film(tmp_path / "flight.mp4", speed)) as file:
        video = FlightVideo(file, world.board, facts())
        for after_s in pauses_s:
            fly(video, world, 1, after_s)
    assert times_of(tmp_path / "flight.mp4") == pytest.approx(times_s)


def test_the_four_panes_show_what_is_on_the_board() -> None:
    world = World()
    world.see()
    panes = panes_of(world)
    with_map = drawn(panes, world.tick())
    assert with_map.shape == (720, 1280, 3)
    assert (with_map[560:720, :638] == CLASSES.colours[1]).all(), "the class map alone"
    assert len(np.unique(with_map[:438, 642:].reshape(-1, 3), axis=0)) > 10, "the map"
    world.clock.advance(5.0)
    without = drawn(panes, world.tick(frame=False))
    for words in (without[:359, :639], without[361:, :639]):  # no image yet, a stale class map
        assert tuple(words[300, 300]) == PANEL
        assert len(np.unique(words.reshape(-1, 3), axis=0)) > 1, "a text"


def test_an_event_stays_in_the_film_for_a_while() -> None:
    world = World()
    video, images = panes_of(world), []
    video._file = Mock()
    happens = FlightEvent(time_s=0.1, kind=EventKind.INFO, text="gives way to a mover")
    for events, after_s in (((), 0.1), ((happens,), 0.1), ((), 6.0), ((), 0.1)):
        video.on_tick(replace(world.tick(after_s=after_s), events=events))
        images.append(video._last[285:315, :640])
    assert [bool((one != images[0]).any()) for one in images] == [False, True, True, False]


@pytest.mark.parametrize("asked", [True, False], ids=["asked for", "seen"])
def test_depth_and_corridor_share_the_quarter_of_the_class_map(*, asked: bool) -> None:
    world = World()
    panes = panes_of(world, makes_depth=asked)
    if not asked:
        world.see_depth()
        drawn(panes, world.tick())
        world.clock.advance(5.0)  # the panes stay when the depth is stale
    world.see()
    before = drawn(panes, world.tick())
    assert tuple(before[530, 100]) == tuple(CLASSES.colours[1]), "class map"
    assert tuple(before[370, 330]) == PANEL, "no depth"
    assert tuple(before[550, 10]) == PANEL, "no corridor"
    world.see_depth()
    after = drawn(panes, world.tick())
    assert tuple(after[500, 330]) != PANEL
    assert tuple(after[650, 10]) != PANEL


def test_the_outcome_stays_at_the_end(tmp_path: Path) -> None:
    world = World()
    with closing(open_film(tmp_path / "flight.mp4")) as file:
        video = FlightVideo(file, world.board, facts())
        fly(video, world, 2)
        video.conclude("success", ["landed"])
    times = times_of(tmp_path / "flight.mp4")
    assert len(times) == 2 + 20
    assert times[-1] == pytest.approx(2.1)


class FullDisk:
    """Replaces the stream of the encoder."""

    def encode(self, image: object) -> None:
        del image
        raise OSError(28, "No space left on device")


def test_a_full_disk_ends_no_flight_and_closing_says_so(tmp_path: Path) -> None:
    world, file = World(), open_film(tmp_path / "flight.mp4")
    video = FlightVideo(file, world.board, facts())
    fly(video, world, 1)
    file._stream = FullDisk()
    fly(video, world, 3)
    with pytest.raises(FileError, match="No space left"):
        file.close()
    assert list(tmp_path.iterdir()) == []


def test_a_wrong_name_or_speed_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"must end in \.mp4"):
        open_file(tmp_path / "flight.avi")
    with pytest.raises(FileError, match="does not exist"):
        open_file(tmp_path / "nowhere" / "flight.mp4")
    with pytest.raises(ValueRangeError, match=r"0\.1 to 100 times"):
        open_film(tmp_path / "flight.mp4", speed=0.0)
    assert list(tmp_path.iterdir()) == []


def test_of_many_phases_the_last_ones_are_named_in_their_colours() -> None:
    world = World()
    video = panes_of(world)
    many = [f"phase {number}" for number in range(9)]
    image = [drawn(video, world.tick(phase=each)) for each in many][-1]
    colours = phase_colours(many)
    assert [has(image[664:684, 641:], colours[each]) for each in many] == [False] * 3 + [True] * 6
    assert (image[664:, 1270:] == PANEL).all()


@pytest.mark.parametrize(
    ("now_s", "limit_s", "span_s"),
    [
        (15.0, 300.0, 30.0),
        (40.0, 300.0, 60.0),
        (250.0, 300.0, 300.0),
        (300.1, 300.0, 300.1),
        (1000.0, math.inf, 1920.0),
    ],
)
def test_the_time_bar_has_the_phases_on_a_scale_that_doubles_up_to_the_limit(
    now_s: float, limit_s: float, span_s: float
) -> None:
    world, phases = World(), ("take-off", "search")
    video = panes_of(world, limit_s=limit_s)
    for time_s, phase in zip((0.0, 6.0, now_s), (*phases, "search"), strict=True):
        world.clock.advance(time_s - world.clock.now())
        bar = drawn(video, world.tick(phase=phase, after_s=0.0))[664 + 29, 641:]
    for phase, (start_s, end_s) in zip(phases, ((0.0, 6.0), (6.0, now_s)), strict=True):
        columns = np.flatnonzero((bar == phase_colours(phases)[phase]).all(axis=1))
        ends = [18 + 603 * time_s / span_s for time_s in (start_s, end_s)]
        assert [columns.min(), columns.max() + 1] == pytest.approx(ends, abs=0.51)


# --- the writer: its files are readable, and complete or absent -----------------------------------

SIZE_PX = (64, 48)


def open_file(path: Path, **changes: Any) -> VideoFile:
    return VideoFile(path, **{"size_px": SIZE_PX, "frames_per_s": Fraction(20), **changes})


def plain(colour: int | tuple[int, int, int]) -> NDArray[np.uint8]:
    return np.full((48, 64, 3), colour, dtype=np.uint8)


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


def test_a_missing_encoder_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video_file, "_CODEC", "no_such_encoder")
    with pytest.raises(MissingDependencyError, match="pip install"):
        open_file(tmp_path / "flight.mp4")
    assert list(tmp_path.iterdir()) == []
