"""The timeline of a film."""

import numpy as np
import pytest
from numpy.typing import NDArray

from uav_bt.display.canvas import ACCENT
from uav_bt.display.lab_map import phase_colours
from uav_bt.display.video.timeline import Timeline

SIZE_PX = (636, 56)
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
    image = flown(15.0).draw(SIZE_PX)
    colours = phase_colours(["take-off", "search"])
    first, second = columns(image, colours["take-off"]), columns(image, colours["search"])
    # 30 s are 600 pixels wide, 20 per second, and start at the margin of 18.
    assert (first.min(), first.max()) == (18, 18 + 6 * 20 - 1)
    assert second.min() == 18 + 6 * 20
    (cursor,) = {round(float(columns(image, ACCENT).mean()))}
    assert abs(cursor - (18 + 15 * 20)) <= 1


def test_the_end_of_the_scale_says_when_it_is_the_limit() -> None:
    long, short = flown(20.0, limit_s=300.0).draw(SIZE_PX), flown(20.0, limit_s=30.0).draw(SIZE_PX)
    assert (long[:40] == short[:40]).all()
    assert (long[40:, -90:] != short[40:, -90:]).any()
