"""Values, images and site maps in records come back; foreign ones are refused."""

from __future__ import annotations

import base64
import json
import math
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.paper_lab import CLASSES
from tests.worlds.values import corridor
from uav_bt import types
from uav_bt.answers import Advance, Answer, Blocked, Done, FollowLeg, Rotate
from uav_bt.errors import InputError
from uav_bt.files import parse_json
from uav_bt.protocols import Advice
from uav_bt.record import messages
from uav_bt.record.channels import CHANNELS, Channel, CommandNote, SiteMapNote, TickNote
from uav_bt.record.images import decode_image, encode_image, fields, image_bytes, raw_image
from uav_bt.record.site_maps import note_of, site_map_of
from uav_bt.record.values import decode, dump, encode, json_schema
from uav_bt.types import Pose2D
from uav_bt.types.camera import FrameNote
from uav_bt.types.site_map import MapMark, MapMover, MapObject, SiteMap

WHOLE = st.integers(-(2**63) + 1, 2**63 - 1)  # as viewers write them
ANY = st.floats(allow_nan=False)
FINITE = st.floats(allow_nan=False, allow_infinity=False)

attitudes = st.builds(types.Attitude, roll_rad=ANY, pitch_rad=ANY, yaw_rad=ANY)
states = st.builds(
    types.DroneState,
    captured_s=ANY,
    flying=st.sampled_from(types.FlyingState),
    attitude=attitudes,
    velocity=st.builds(types.BodyVelocity, forward_mps=ANY, right_mps=ANY, down_mps=ANY),
    altitude_m=ANY,
    height_above_ground_m=ANY,
    battery=ANY,
    movement=st.none()
    | st.builds(types.MovementStatus, id=WHOLE, state=st.sampled_from(types.MovementState)),
    pilot_has_control=st.booleans(),
)
movements = st.one_of(
    st.builds(types.TakeOff),
    st.builds(types.Hover),
    st.builds(types.Land),
    st.builds(types.MoveBy, id=WHOLE, forward_m=FINITE, yaw_rad=FINITE),
    st.builds(types.Velocity, forward_mps=FINITE, yaw_rate_radps=FINITE),
)
commands = st.builds(
    types.Command,
    movement=movements,
    gimbal=st.none() | st.builds(types.GimbalTo, pitch_rad=st.floats(-1.5, 1.5)),
)
frames = st.builds(FrameNote, index=WHOLE, captured_s=ANY, gimbal_pitch_rad=ANY, attitude=attitudes)
notes = st.builds(CommandNote, decided=commands, sent=commands, proposed=movements | st.none())


def there_and_back(value: Any) -> Any:
    return decode(type(value), json.loads(dump(encode(value))))


@given(states | frames | notes)
def test_telemetry_and_commands_come_back_to_the_last_bit(value: object) -> None:
    assert there_and_back(value) == value


@pytest.mark.parametrize(
    "answer",
    [
        Advance(forward_m=0.7, free_m=0.9, reason="clear"),
        FollowLeg(yaw_rad=0.1, speed_mps=0.4),
        Rotate(yaw_rad=-2.0, reason="looks"),
        Blocked(yaw_rad=0.5, ground_ends=True),
        Done(reason="covered"),
    ],
)
def test_every_answer_comes_back(answer: Answer) -> None:
    given = Advice(
        frame_index=3,
        captured_s=0.3,
        x_m=0.1,
        y_m=0.0,
        yaw_rad=0.2,
        height_above_ground_m=1.5,
        gimbal_pitch_rad=-0.5,
        turning=0,
        full_turns=0,
        answer=answer,
        fresh=Blocked(yaw_rad=-0.5),
    )
    assert there_and_back(given) == given


def test_what_json_has_no_number_for_comes_back() -> None:
    back = there_and_back(corridor(math.inf, nearest_m=-math.inf, impact_s=math.nan))
    assert (back.free_distance_m, back.nearest_m) == (math.inf, -math.inf)
    assert math.isnan(back.time_to_impact_s)
    assert json.loads(dump(encode({"a": [math.inf, 1.5]}))) == {"a": ["Infinity", 1.5]}


@pytest.mark.parametrize("count", [0, 3])
def test_points_keep_their_shape_even_when_there_are_none(count: int) -> None:
    points = np.random.default_rng(1).normal(size=(count, 2))
    back = there_and_back(types.NearObstacles(points_m=points, captured_s=2.5))
    assert back.points_m.shape == (count, 2)
    assert np.array_equal(back.points_m, points)
    assert back.assumed_m.shape == (0, 2)


def test_a_field_that_a_record_lacks_has_its_default() -> None:
    plain = encode(TickNote(index=1, time_s=0.5, tree_status="RUNNING", word="look"))
    del plain["word"]
    assert decode(TickNote, plain) == TickNote(index=1, time_s=0.5, tree_status="RUNNING")


STATE: dict[str, Any] = {"captured_s": 1.0, "flying": "landed"}


@pytest.mark.parametrize(
    ("kind", "damaged"),
    [
        *((types.DroneState, damaged) for damaged in ({}, [], None)),
        (types.DroneState, STATE | {"captured_s": "soon"}),
        (types.DroneState, STATE | {"flying": "swimming"}),
        (types.DroneState, STATE | {"pilot_has_control": "yes"}),
        *(
            (FrameNote, {"index": index, "captured_s": 0.0})
            for index in (True, 0.5, "7", None, [0])
        ),
        *(
            (FrameNote, {"index": 0, "captured_s": number})
            for number in ("Infinite", "1.5", True, None, [1.0], {})
        ),
        (types.Command, {"movement": {"type": "Somersault"}}),
        (CommandNote, {"sent": {}, "decided": {}, "override": "mutiny"}),
    ],
    ids=str,
)
def test_what_does_not_fit_is_refused(kind: type[Any], damaged: object) -> None:
    with pytest.raises(InputError, match=f"expected the fields of {kind.__name__}"):
        decode(kind, damaged)


@pytest.mark.parametrize("channel", CHANNELS.values(), ids=lambda channel: channel.topic)
def test_every_channel_has_a_schema_that_viewers_can_read(channel: Channel) -> None:
    messages, encoding, data = channel.schema()
    if isinstance(channel.content, str):
        assert messages == encoding == "protobuf"
        assert str(channel.content).encode() in data
    else:
        assert (messages, encoding) == ("json", "jsonschema")
        assert json.loads(data)["type"] == "object"
    schema = json.loads(json_schema(CommandNote))
    movement = schema["properties"]["sent"]["properties"]["movement"]
    assert "MoveBy" in movement["properties"]["type"]["enum"]
    assert "forward_m" in movement["properties"]


# --- images ---------------------------------------------------------------------------------------


def noise(height: int, width: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 1000))
def test_a_lossless_image_comes_back_bit_for_bit(height: int, width: int, seed: int) -> None:
    image = noise(height, width, seed)
    message = messages.camera_image(image, 1_234_567_890_123, "lossless")
    assert np.array_equal(decode_image(image_bytes(message)), image)


def test_a_small_image_is_much_smaller_and_nearly_the_same() -> None:
    rows, columns = np.mgrid[0:90, 0:160]
    image = np.stack([rows * 2, columns, rows + columns], axis=-1).astype(np.uint8)
    data, name = encode_image(image, "high")
    assert name == "jpeg"
    assert len(data) < image.nbytes / 10
    assert np.abs(decode_image(data).astype(int) - image).mean() < 2.0  # red stays red


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"no image at all",
        b"\xff\xd8\xff\xff\xff\xff",
        encode_image(noise(9, 9), "high")[0][:20],
    ],
)
def test_what_is_no_image_is_refused(data: bytes) -> None:
    with pytest.raises(InputError, match="expected a PNG or JPEG image"):
        decode_image(data)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_raw_pixels_come_back_exactly(dtype: type) -> None:
    array = (np.random.default_rng(3).random((7, 5)) * 200).astype(dtype)
    back = raw_image(messages.raw(array, 5))
    assert back.dtype == dtype
    assert np.array_equal(back, array)


@given(st.binary(max_size=60))
def test_bytes_of_any_kind_are_read_or_refused(data: bytes) -> None:
    with suppress(InputError):
        assert all(number >= 0 for number in fields(data))


def test_an_image_without_data_is_refused() -> None:
    with pytest.raises(InputError, match="CompressedImage with data"):
        image_bytes(b"")
    with pytest.raises(InputError, match="RawImage"):
        raw_image(b"")


# --- site maps ------------------------------------------------------------------------------------

RANDOM = np.random.default_rng(0)
SHAPE = (31, 42)
PLACE = {"x_m": 1.0, "y_m": -0.5, "x_mps": 0.2, "y_mps": -0.4, "std_m": 0.05, "std_mps": 0.1}
MOVER = MapMover(**PLACE, id=3, radius_m=0.25, first_s=9.0, seen_s=12.4)
BOX = MapObject(class_id=5, x_m=1.5, y_m=2.0, size_m=0.4, std_m=0.1, seen_s=12.0)


def site_map() -> SiteMap:
    def some() -> np.ndarray:
        return RANDOM.random(SHAPE) < 0.3

    return SiteMap(
        classes=CLASSES,
        pose=Pose2D(x_m=0.1, y_m=1 / 3, yaw_rad=-2.0),
        corner_m=(-1.5, 0.7),
        cell_m=0.1,
        seen_s=np.where(some(), 7.0, -np.inf),
        free=some(),
        outside=some(),
        passed=some(),
        obstacles_m=RANDOM.normal(size=(9, 2)),
        edges_m=RANDOM.normal(size=(5, 2)),
        captured_s=12.5,
        objects=(BOX, replace(BOX, class_id=4, id=3, points=7, height_m=0.8, height_std_m=0.02)),
        mark=MapMark(x_m=0.0, y_m=0.1, std_m=0.02, seen_s=3.0),
        movers=(MOVER,),
        contradicted_s=0.5,
        restarts=2,
        full=True,
        untracked_s=math.inf,  # the ground was never tracked
    )


def test_a_map_comes_back() -> None:
    kept = site_map()
    plain = parse_json(dump(encode(note_of(kept))))
    back = site_map_of(decode(SiteMapNote, plain), CLASSES)
    for grid in ("ground", "free", "outside", "passed"):
        assert np.array_equal(getattr(back, grid), getattr(kept, grid)), grid
    for points in ("obstacles_m", "edges_m"):
        assert getattr(back, points) == pytest.approx(getattr(kept, points), abs=6e-4), points
    names = ("pose", "corner_m", "cell_m", "captured_s", "objects", "mark", "movers", "correction")
    for name in (*names, "contradicted_s", "restarts", "full", "untracked_s"):
        assert getattr(back, name) == getattr(kept, name), name


def test_a_map_is_small() -> None:
    blank = np.zeros((120, 120), dtype=np.bool_)
    blank[20:90, 20:90] = True
    seen_s = np.where(blank, 1.0, -np.inf)
    large = replace(site_map(), seen_s=seen_s, free=blank, outside=~blank, passed=blank)
    assert len(dump(encode(note_of(large)))) < 4_000


@pytest.mark.parametrize("cells_png", ["no image", base64.b64encode(b"no PNG").decode()])
def test_cells_that_are_no_image_are_refused(cells_png: str) -> None:
    with pytest.raises((InputError, ValueError)):
        site_map_of(replace(note_of(site_map()), cells_png=cells_png), CLASSES)
