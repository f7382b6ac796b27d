"""The same seed and the same commands give the same flight, to the byte."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest

from sim_bridge.twin import TwinConfig
from tests.sim_bridge.twin.lab_world import MakeTwin, fly
from uav_bt.types import Command, GimbalTo, MoveBy, TakeOff


def flight_digest(seed: int, *, looks: int = 1, pause: Callable[[], object] = bool) -> str:
    """Fly six seconds; return a digest of all frames, states, ids, depths and truths."""
    drone = TwinConfig(seed=seed, image_size_px=(160, 90), scene="train-c").create()
    drone.connect()
    digest = hashlib.sha256()
    for tick in range(60):
        for _ in range(looks):
            seen = drone.observe()
        digest.update(repr((seen.state, drone.referee.truth())).encode())
        if seen.frame is not None:
            digest.update(seen.frame.image.tobytes())
            digest.update(drone.referee.class_ids(seen.frame, 64, 36).tobytes())
            digest.update(drone.referee.depth(seen.frame, 64, 36).tobytes())
        movement = TakeOff() if tick < 40 else MoveBy(id=1, forward_m=0.6, yaw_rad=0.5)
        drone.send(Command(movement=movement, gimbal=GimbalTo(pitch_rad=-0.45)))
        pause()
        drone.clock.sleep_until(0.1 * (tick + 1))
    drone.disconnect()
    return digest.hexdigest()


@pytest.fixture(scope="module")
def first() -> str:
    return flight_digest(5)


def test_a_flight_repeats_in_another_process_and_another_seed_is_another_flight(first: str) -> None:
    """The flight is independent of the process, of hashing and of earlier flights."""
    code = f"from {__name__} import flight_digest; print(flight_digest(5), flight_digest(6))"
    environment = {"PYTHONPATH": os.pathsep.join(sys.path), "PYTHONHASHSEED": "7"}
    told = subprocess.check_output(  # noqa: S603  (code of this test)
        [sys.executable, "-c", code], text=True, env={**os.environ, **environment}
    )
    same, other = told.split()
    assert same == first != other


def test_more_looks_and_another_twin_change_nothing(make_twin: MakeTwin, first: str) -> None:
    """Independent of the wall clock, and of another twin that flies and renders in between."""
    other = make_twin(profile="lab", seed=9, image_size_px=(320, 180), scene="val-a")
    assert flight_digest(5, looks=3, pause=lambda: fly(other, TakeOff(), 0.1)) == first


@pytest.mark.parametrize("late_s", [2.1, 2.37])
def test_a_frame_drawn_ahead_is_the_one_drawn_on_demand(make_twin: MakeTwin, late_s: float) -> None:
    """After steady observations the next frame is drawn ahead; a late observation skips it."""
    frames = []
    for observed_s in ((1.8, 1.9, 2.0, late_s), (late_s,)):
        drone = make_twin(seed=5, profile="lab", scene="train-c")
        drone.send(Command(movement=TakeOff()))
        for time_s in observed_s:
            drone.clock.sleep_until(time_s)
            frame = drone.observe().frame
        frames.append(frame)
    assert frames[0].index == frames[1].index
    assert np.array_equal(frames[0].image, frames[1].image)
