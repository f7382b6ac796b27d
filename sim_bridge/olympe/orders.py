"""Commands to an ANAFI as the SDK has them: full name and arguments."""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

from sim_bridge.olympe.config import OlympeConfig
from uav_bt.types import MoveBy


class Order(NamedTuple):
    """A command to the drone, which nothing waits for."""

    name: str
    args: dict[str, Any] = {}  # noqa: RUF012  # never changed


TAKE_OFF: Final = Order("ardrone3.Piloting.TakeOff")
LANDING: Final = Order("ardrone3.Piloting.Landing")
EMERGENCY: Final = Order("ardrone3.Piloting.Emergency")  # stops the motors in flight
# A movement by zero ends the present one, with any firmware.
HALT: Final = Order("ardrone3.Piloting.moveBy", {"dX": 0.0, "dY": 0.0, "dZ": 0.0, "dPsi": 0.0})
TAKE_PHOTO: Final = Order("camera.take_photo", {"cam_id": 0})
# A remote control forwards this program's commands instead of its sticks, or uses its sticks again.
TAKE_STICKS: Final = Order("skyctrl.CoPiloting.setPilotingSource", {"source": "Controller"})
GIVE_STICKS: Final = Order("skyctrl.CoPiloting.setPilotingSource", {"source": "SkyController"})


def camera_mode(mode: str) -> Order:
    """Return the command for a mode of the camera: `photo` or `recording`."""
    return Order("camera.set_camera_mode", {"cam_id": 0, "value": mode})


def point(pitch_rad: float) -> Order:
    """Return the command for a pitch of the camera: 0 level, negative down."""
    target = {
        "gimbal_id": 0,
        "control_mode": "position",
        "yaw_frame_of_reference": "none",
        "yaw": 0.0,
        "pitch_frame_of_reference": "absolute",
        "pitch": math.degrees(pitch_rad),
        "roll_frame_of_reference": "none",
        "roll": 0.0,
    }
    return Order("gimbal.set_target", target)


def move_by(move: MoveBy) -> Order:
    """Return a relative movement, which replaces the one before; older firmware has only this."""
    parts = {"dX": move.forward_m, "dY": move.right_m, "dZ": move.down_m, "dPsi": move.yaw_rad}
    return Order("ardrone3.Piloting.moveBy", parts)


def move_at_speed(move: MoveBy, config: OlympeConfig) -> Order:
    """Return a relative movement within the speed limits, which replaces the one before."""
    parts = {
        "d_x": move.forward_m,
        "d_y": move.right_m,
        "d_z": move.down_m,
        "d_psi": move.yaw_rad,
        "max_horizontal_speed": config.speed_limit_mps,
        "max_vertical_speed": config.climb_limit_mps,
        "max_yaw_rotation_speed": math.degrees(config.yaw_rate_limit_radps),
    }
    return Order("move.extended_move_by", parts)
