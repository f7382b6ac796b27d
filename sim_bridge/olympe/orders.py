"""Commands to an ANAFI through the SDK."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.sdk import Sdk
from sim_bridge.olympe.speed import Sticks
from uav_bt.errors import DroneError
from uav_bt.types import MoveBy


class Orders:
    """Sends commands to a drone without waiting for their effect.

    Args:
        sdk: the SDK.
        config: the limits.
        drone: returns the SDK's object of the connected drone, or raises `DroneError`.
    """

    def __init__(self, sdk: Sdk, config: OlympeConfig, drone: Callable[[], Any]) -> None:
        self._sdk = sdk
        self._config = config
        self._drone = drone
        self._steering = False

    def send(self, name: str, **args: Any) -> None:
        """Send a command, given by its full name."""
        self._drone()(self._sdk.message(name)(**args))

    def take_sticks(self) -> None:
        """Make a remote control forward this program's commands instead of its sticks."""
        self.send("skyctrl.CoPiloting.setPilotingSource", source="Controller")

    def give_sticks(self) -> None:
        """Make a remote control use its sticks again."""
        self.send("skyctrl.CoPiloting.setPilotingSource", source="SkyController")

    def take_off(self) -> None:
        """Start the motors and climb."""
        self.send("ardrone3.Piloting.TakeOff")

    def land(self) -> None:
        """Descend and stop the motors."""
        self.send("ardrone3.Piloting.Landing")
        self.let_go()  # after the landing, because it may fail

    def cut_motors(self) -> None:
        """Stop the motors in flight."""
        self.send("ardrone3.Piloting.Emergency")

    def move(self, move: MoveBy, *, at_speed: bool) -> None:
        """Start a relative movement; it replaces the one before.

        Args:
            move: the movement.
            at_speed: keep the speed limits of the configuration; older firmware cannot.
        """
        self.let_go()
        if not at_speed:
            self.send(
                "ardrone3.Piloting.moveBy",
                dX=move.forward_m,
                dY=move.right_m,
                dZ=move.down_m,
                dPsi=move.yaw_rad,
            )
            return
        self.send(
            "move.extended_move_by",
            d_x=move.forward_m,
            d_y=move.right_m,
            d_z=move.down_m,
            d_psi=move.yaw_rad,
            max_horizontal_speed=self._config.speed_limit_mps,
            max_vertical_speed=self._config.climb_limit_mps,
            max_yaw_rotation_speed=math.degrees(self._config.yaw_rate_limit_radps),
        )

    def halt(self) -> None:
        """End the present movement: a movement by zero replaces it, with any firmware."""
        self.send("ardrone3.Piloting.moveBy", dX=0.0, dY=0.0, dZ=0.0, dPsi=0.0)

    def steer(self, sticks: Sticks) -> None:
        """Hold stick positions until the next ones, for at most `sticks_hold_s`."""
        self._steering = True
        drone = self._drone()
        if not drone.piloting(
            sticks.roll, sticks.pitch, sticks.yaw, sticks.climb, self._config.sticks_hold_s
        ):
            raise DroneError(f"{self._config.where} no longer accepts stick positions")

    def centre(self) -> None:
        """Centre the sticks, if they are held."""
        if self._steering:
            self._drone().piloting(0, 0, 0, 0, 0.0)

    def let_go(self) -> None:
        """Stop sending stick positions."""
        if self._steering:
            self._steering = False
            drone = self._drone()
            drone.piloting(0, 0, 0, 0, 0.0)
            drone.stop_piloting()

    def camera_mode(self, mode: str) -> None:
        """Change the camera's mode: `photo` or `recording`."""
        self.send("camera.set_camera_mode", cam_id=0, value=mode)

    def take_photo(self) -> None:
        """Take a photograph with the camera, which is in the mode for it."""
        self.send("camera.take_photo", cam_id=0)

    def point(self, pitch_rad: float) -> None:
        """Set the pitch of the camera: 0 level, negative down."""
        self.send(
            "gimbal.set_target",
            gimbal_id=0,
            control_mode="position",
            yaw_frame_of_reference="none",
            yaw=0.0,
            pitch_frame_of_reference="absolute",
            pitch=math.degrees(pitch_rad),
            roll_frame_of_reference="none",
            roll=0.0,
        )
