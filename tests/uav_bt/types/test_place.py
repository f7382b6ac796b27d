"""Places as tree files write them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_bt.errors import ValueRangeError
from uav_bt.types.place import Place, PlaceFrame, parse_places


def test_a_place_ahead_of_the_take_off() -> None:
    assert Place.parse("start:2,-0.5") == Place(frame=PlaceFrame.START, x_m=2.0, y_m=-0.5)


def test_height_and_heading_are_optional() -> None:
    place = Place.parse(" start: 2, 0, 1.2 @ -90 ")
    assert place.height_m == 1.2
    assert place.heading_rad == pytest.approx(-math.pi / 2)


@pytest.mark.parametrize("text", ["mark", "mark@90", "object:3", "object:12@-45"])
def test_the_mark_and_objects_have_names(text: str) -> None:
    assert str(Place.parse(text)) == text


@pytest.mark.parametrize(
    "text",
    [
        *("", "2,0", "start:2", "start:2;0", "start:a,b", "start:nan,0", "start:1e9,0"),
        *(
            "mark:1,0",
            "object:",
            "object:box_3",
            "object:-1",
            "world:1,2",
            "start:2,0@",
            "object:3,1",
        ),
    ],
)
def test_other_texts_are_refused_with_an_example(text: str) -> None:
    with pytest.raises(ValueRangeError, match="expected"):
        Place.parse(text)


@pytest.mark.parametrize(
    ("text", "words"), [("start:2000,0", "a coordinate of -1000"), ("body:0,0,99", "a height of")]
)
def test_a_number_out_of_range_is_named(text: str, words: str) -> None:
    with pytest.raises(ValueRangeError, match=words):
        Place.parse(text)


def test_a_list_keeps_its_order() -> None:
    places = parse_places("start:1,0; mark ;lab:0.5,0.5@180;")
    assert [place.frame.value for place in places] == ["start", "mark", "lab"]


def test_an_empty_list_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="empty list"):
        parse_places(" ; ")


@given(
    frame=st.sampled_from(["start", "body", "lab"]),
    x_cm=st.integers(-99_999, 99_999),
    y_cm=st.integers(-99_999, 99_999),
    heading_deg=st.none() | st.integers(-179, 179),
)
def test_a_place_is_read_as_it_is_written(
    frame: str, x_cm: int, y_cm: int, heading_deg: int | None
) -> None:
    place = Place(
        frame=PlaceFrame(frame),
        x_m=x_cm / 100,
        y_m=y_cm / 100,
        heading_rad=None if heading_deg is None else math.radians(heading_deg),
    )
    again = Place.parse(str(place))
    assert (again.x_m, again.y_m) == pytest.approx((place.x_m, place.y_m))
    assert (again.heading_rad is None) == (place.heading_rad is None)
    if again.heading_rad is not None and place.heading_rad is not None:
        assert again.heading_rad == pytest.approx(place.heading_rad)
