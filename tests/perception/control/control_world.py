"""Helpers for tests of the control student: a tiny network, and flights in a made-up lab.

A picture of that lab is dark where the way is blocked, and the side to turn to is the bright one:
a network of any size can learn it.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from perception.control.ego_state import ControlNetConfig
from perception.control.training.samples import ControlFlight, advised_flight
from uav_bt.answers import Advance, Answer, Blocked
from uav_bt.protocols import Advice

TINY = ControlNetConfig(
    width_px=32, height_px=16, channels=(4, 8), bottleneck=4, embedding=12, hidden=8
)
TURN_RAD = 0.5


def picture(
    answer: Answer, rng: np.random.Generator, net: ControlNetConfig = TINY
) -> NDArray[np.uint8]:
    """Return an image of a path to which the rule gives this answer."""
    rgb = rng.integers(90, 110, (net.height_px, net.width_px, 3)).astype(np.uint8)
    if isinstance(answer, Blocked):
        half = net.width_px // 2
        rgb[:, half:] = 220 if answer.yaw_rad > 0.0 else 20
        rgb[:, :half] = 20 if answer.yaw_rad > 0.0 else 220
    return rgb


def advice(index: int, answer: Answer, **changed: object) -> Advice:
    """Return advice on a view, ten of them a second, the drone moving ahead at 0.4 m/s."""
    values: dict[str, object] = {
        "frame_index": index,
        "captured_s": 0.1 * index,
        "x_m": 0.04 * index,
        "y_m": 0.0,
        "yaw_rad": 0.0,
        "height_above_ground_m": 1.5,
        "gimbal_pitch_rad": -0.5,
        "turning": 0,
        "full_turns": 0,
        "answer": answer,
        "fresh": answer,
    }
    return Advice(**{**values, **changed})  # type: ignore[arg-type]  # by name


def made_up_flight(
    seed: int = 0, views: int = 60, net: ControlNetConfig = TINY, **changed: object
) -> ControlFlight:
    """Return a flight whose views are free or blocked at random."""
    rng = np.random.default_rng(seed)
    answers = (
        Advance(forward_m=0.8, free_m=1.0)
        if rng.random() < 0.5
        else Blocked(yaw_rad=TURN_RAD * rng.choice([-1.0, 1.0]), free_m=0.1)
        for _ in range(views)
    )
    return flight_of(answers, rng, net, **changed)


def flight_of(
    answers: Iterable[Answer],
    rng: np.random.Generator,
    net: ControlNetConfig = TINY,
    **changed: object,
) -> ControlFlight:
    """Return a flight of pictures to which the rule gives these answers."""
    flight = advised_flight(
        (picture(answer, rng, net), advice(index, answer, **changed))
        for index, answer in enumerate(answers)
    )
    assert flight is not None
    return flight
