"""Our values to JSON and back without loss; foreign values are refused."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_bt import types
from uav_bt.answers import Advance, Answer, Blocked, Done, FollowLeg, Rotate
from uav_bt.errors import InputError
from uav_bt.protocols import Advice
from uav_bt.record.channels import CHANNELS, Channel, CommandNote, TickNote
from uav_bt.record.values import decode, dump, encode, json_schema
from uav_bt.types.camera import FrameNote

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


def there_and_back(value: Any) -> Any:
    return decode(type(value), json.loads(dump(encode(value))))


@given(states | frames)
def test_telemetry_comes_back_to_the_last_bit(value: types.DroneState | FrameNote) -> None:
    assert there_and_back(value) == value


@given(commands, commands, movements | st.none())
def test_commands_come_back_as_what_they_were(
    decided: types.Command, sent: types.Command, proposed: types.Movement | None
) -> None:
    note = CommandNote(decided=decided, sent=sent, proposed=proposed, proposed_by="Main/Land")
    assert there_and_back(note) == note


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
    corridor = types.Corridor(
        captured_s=1.0,
        free_distance_m=math.inf,
        nearest_m=-math.inf,
        nearest_side=None,
        time_to_impact_s=math.nan,
    )
    back = there_and_back(corridor)
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
def test_what_does_not_fit_is_refused_with_what_was_expected(
    kind: type[Any], damaged: object
) -> None:
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
