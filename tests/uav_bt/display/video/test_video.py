"""The video of a flight."""

from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.paper_lab import CLASSES
from tests.uav_bt.display.display_world import World, facts, has
from uav_bt.display.canvas import ACCENT, PANEL
from uav_bt.display.shown import FlownPath, phase_colours
from uav_bt.display.video.video import FlightVideo, Panes, Timeline, draw_legend
from uav_bt.errors import FileError, ValueRangeError
from uav_bt.types import ClassMap, DepthMap, Frame, Pose


def panes_of(world: World, **changes: Any) -> Panes:
    return Panes(world.board, facts(**changes))


def video_of(world: World, path: Path, **changes: Any) -> FlightVideo:
    video = FlightVideo(path, **changes)
    video.begin(world.board, facts())
    return video


def fly(video: FlightVideo, world: World, ticks: int, after_s: float = 0.1) -> None:
    for index in range(ticks):
        world.see()
        pose = Pose(x_m=0.05 * index, y_m=0.0, z_m=1.5, yaw_rad=0.0)
        video.on_tick(world.tick(pose=pose, after_s=after_s))


def decoded(path: Path) -> tuple[tuple[int, int], list[float]]:
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        size_px = (stream.codec_context.width, stream.codec_context.height)
        times = [float(image.time) for image in container.decode(video=0)]
    return size_px, times


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
    video = video_of(world, tmp_path / "flight.mp4", speed=speed)
    for after_s in pauses_s:
        fly(video, world, 1, after_s)
    video.file.close()
    size_px, times = decoded(tmp_path / "flight.mp4")
    assert size_px == (1280, 720)
    assert times == pytest.approx(times_s)


def test_the_four_panes_show_what_is_on_the_board() -> None:
    world = World()
    world.see()
    panes = panes_of(world)
    with_map = panes.draw(world.tick(), FlownPath())
    assert with_map.shape == (720, 1280, 3)
    assert (with_map[560:720, :638] == CLASSES.colours[1]).all(), "the class map alone"
    assert len(np.unique(with_map[:438, 642:].reshape(-1, 3), axis=0)) > 10, "the map"
    world.clock.advance(5.0)
    without = panes.draw(world.tick(), FlownPath())
    assert tuple(without[700, 300]) != tuple(CLASSES.colours[1]), "stale"


@pytest.mark.parametrize("asked", [True, False], ids=["asked for", "seen"])
def test_depth_and_corridor_share_the_quarter_of_the_class_map(*, asked: bool) -> None:
    world = World()
    panes = panes_of(world, makes_depth=asked)
    if not asked:
        world.see_depth()
        panes.draw(world.tick(), FlownPath())
        world.clock.advance(5.0)  # the panes stay when the depth is stale
    world.see()
    before = panes.draw(world.tick(), FlownPath())
    assert tuple(before[530, 100]) == tuple(CLASSES.colours[1]), "class map"
    assert tuple(before[370, 330]) == PANEL, "no depth"
    assert tuple(before[550, 10]) == PANEL, "no corridor"
    world.see_depth()
    after = panes.draw(world.tick(), FlownPath())
    assert tuple(after[500, 330]) != PANEL
    assert tuple(after[650, 10]) != PANEL


def test_what_intrudes_is_marked_only_in_the_picture_it_was_found_in() -> None:
    world = World()
    asked: list[DepthMap] = []

    def everything(frame: Frame, class_map: ClassMap, depth: DepthMap) -> NDArray[np.bool_]:
        asked.append(depth)
        return np.ones(class_map.ids.shape, dtype=bool)

    panes = panes_of(world, makes_depth=True, intruding=everything)
    world.see()
    world.see_depth()
    world.clock.advance(0.1)
    late = panes.draw(world.tick(), FlownPath())
    assert asked == []
    world.see()
    world.see_depth()
    marked = panes.draw(world.tick(), FlownPath())
    assert len(asked) == 1
    red = marked[600, 100].astype(int) - late[600, 100]
    assert red[0] > red[2] + 20


def test_the_outcome_stays_at_the_end(tmp_path: Path) -> None:
    world = World()
    video = video_of(world, tmp_path / "flight.mp4")
    fly(video, world, 2)
    video.conclude("success", ["landed"])
    video.file.close()
    times = decoded(tmp_path / "flight.mp4")[1]
    assert len(times) == 2 + 20
    assert times[-1] == pytest.approx(2.1)


def test_an_outcome_without_a_flight_writes_nothing(tmp_path: Path) -> None:
    video = video_of(World(), tmp_path / "flight.mp4")
    video.conclude("aborted", [])
    video.file.close()
    assert list(tmp_path.iterdir()) == []


class FullDisk:
    """Replaces the stream of the encoder."""

    def encode(self, image: object) -> None:
        del image
        raise OSError(28, "No space left on device")


def test_a_full_disk_is_an_error_of_the_tick_and_leaves_no_file(tmp_path: Path) -> None:
    world = World()
    video = video_of(world, tmp_path / "flight.mp4")
    fly(video, world, 1)
    video.file._stream = FullDisk()
    with pytest.raises(FileError, match="No space left"):
        fly(video, world, 1)
    video.file.close()
    video.file.close()
    assert list(tmp_path.iterdir()) == []


def test_a_speed_that_makes_no_video_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueRangeError):
        FlightVideo(tmp_path / "flight.mp4", speed=0.0)
    assert list(tmp_path.iterdir()) == []


TIMELINE_PX = (636, 56)
BAR_ROW = 29


def flown(until_s: float, limit_s: float | None = None) -> Timeline:
    """Return the timeline of a flight that searches from 6 s on."""
    timeline = Timeline(limit_s)
    for tenth in range(round(10 * until_s) + 1):
        timeline.add(tenth / 10, "search" if tenth >= 60 else "take-off")
    return timeline


def columns(image: NDArray[np.uint8], colour: tuple[int, int, int]) -> NDArray[np.int64]:
    return np.flatnonzero((image[BAR_ROW] == np.array(colour)).all(axis=1))


@pytest.mark.parametrize(
    ("now_s", "limit_s", "span_s"),
    [
        (0.0, 300.0, 30.0),
        (30.0, 300.0, 30.0),
        (30.1, 300.0, 60.0),
        (200.0, 300.0, 240.0),
        (250.0, 300.0, 300.0),
        (300.1, 300.0, 300.1),
        (10.0, 20.0, 20.0),
        (1000.0, None, 1920.0),
    ],
)
def test_the_scale_doubles_with_the_flight_up_to_its_limit(
    now_s: float, limit_s: float | None, span_s: float
) -> None:
    timeline = Timeline(limit_s)
    timeline.add(now_s, "search")
    assert timeline.span_s == span_s


def test_phases_lie_where_they_were_flown_and_the_cursor_is_now() -> None:
    image = flown(15.0).draw(TIMELINE_PX)
    colours = phase_colours(["take-off", "search"])
    first, second = columns(image, colours["take-off"]), columns(image, colours["search"])
    # 30 s are 600 pixels wide, 20 per second, and start at the margin of 18.
    assert (first.min(), first.max()) == (18, 18 + 6 * 20 - 1)
    assert second.min() == 18 + 6 * 20
    (cursor,) = {round(float(columns(image, ACCENT).mean()))}
    assert abs(cursor - (18 + 15 * 20)) <= 1


def test_the_end_of_the_scale_says_when_it_is_the_limit() -> None:
    long, short = (
        flown(20.0, limit_s=300.0).draw(TIMELINE_PX),
        flown(20.0, limit_s=30.0).draw(TIMELINE_PX),
    )
    assert (long[:40] == short[:40]).all()
    assert (long[40:, -90:] != short[40:, -90:]).any()


def test_a_legend_that_is_too_long_keeps_its_last_phases() -> None:
    many = [f"phase {number}" for number in range(7)]
    image = np.zeros((30, 300, 3), dtype=np.uint8)
    draw_legend(image, phase_colours(many))
    assert (image[:, 290:] == 0).all()
    assert has(image, phase_colours(many)["phase 6"])
