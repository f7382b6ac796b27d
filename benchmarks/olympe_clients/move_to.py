# ruff: noqa: S101 - as a user of the SDK would write it
"""Fly to a place on earth, facing it; call a second trip off; then return home and land there."""

import os

import olympe
from olympe.messages import rth
from olympe.messages.ardrone3.GPSSettingsState import GPSFixStateChanged, HomeChanged
from olympe.messages.ardrone3.Piloting import TakeOff, moveBy, moveTo
from olympe.messages.ardrone3.PilotingState import (
    FlyingStateChanged,
    GpsLocationChanged,
    moveToChanged,
)
from olympe.messages.move import extended_move_to

METRE_DEG = 1.0 / 111_200.0  # of latitude

drone = olympe.Drone(os.environ.get("DRONE_IP", "127.0.0.1"))
assert drone.connect()
assert drone(GPSFixStateChanged(fixed=1, _timeout=5, _policy="check_wait")).wait().success()
assert drone(TakeOff() >> FlyingStateChanged(state="hovering", _timeout=10)).wait().success()
home = drone.get_state(HomeChanged)
north = home["latitude"] + 4.0 * METRE_DEG
there = drone(
    moveTo(north, home["longitude"], 2.0, "TO_TARGET", 0.0)
    >> moveToChanged(status="DONE", _policy="wait", _timeout=20)
).wait()
assert there.success(), there.explain()
here = drone.get_state(GpsLocationChanged)
assert abs(here["latitude"] - north) < 0.5 * METRE_DEG, here

trip = drone(
    extended_move_to(
        latitude=north,
        longitude=home["longitude"] + 20.0 * METRE_DEG,
        altitude=2.0,
        orientation_mode="heading_during",
        heading=90.0,
        max_horizontal_speed=2.0,
        max_vertical_speed=1.0,
        max_yaw_rotation_speed=60.0,
    )
    >> moveBy(0.0, 0.0, 0.0, 0.0, _no_expect=True)
    >> FlyingStateChanged(state="hovering", _timeout=5)
).wait(_timeout=15)
assert trip.success(), trip.explain()

returned = drone(
    rth.return_to_home()
    >> rth.state(state="available", reason="finished", _policy="wait", _timeout=60)
    >> FlyingStateChanged(state="landed", _timeout=60)
).wait()
assert returned.success(), returned.explain()
here = drone.get_state(GpsLocationChanged)
assert abs(here["latitude"] - home["latitude"]) < METRE_DEG, here
assert drone.disconnect()
