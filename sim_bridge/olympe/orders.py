"""What an ANAFI is ordered to do, in the SDK's terms."""

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
    """Sends orders to a drone; none of them waits for its effect.

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
        """Send a command by its full name."""
        self._drone()(self._sdk.message(name)(**args))

    def take_sticks(self) -> None:
        """Make a remote control pass our commands on in place of its sticks."""
        self.send("skyctrl.CoPiloting.setPilotingSource", source="Controller")

    def give_sticks(self) -> None:
        """Make a remote control's sticks fly the drone again."""
        self.send("skyctrl.CoPiloting.setPilotingSource", source="SkyController")

    def take_off(self) -> None:
        """Start the motors and climb."""
        self.send("ardrone3.Piloting.TakeOff")

    def land(self) -> None:
        """Descend and stop the motors."""
        self.send("ardrone3.Piloting.Landing")
        self.let_go()  # after the landing was sent: it may fail

    def cut_motors(self) -> None:
        """Stop the motors in flight."""
        self.send("ardrone3.Piloting.Emergency")

    def move(self, move: MoveBy, *, at_speed: bool) -> None:
        """Start a relative movement; it ends the one before.

        Args:
            move: the movement.
            at_speed: keep within the configuration's speeds, which older firmware cannot.
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
        """End the movement under way: a movement by nothing replaces it, on any firmware."""
        self.send("ardrone3.Piloting.moveBy", dX=0.0, dY=0.0, dZ=0.0, dPsi=0.0)

    def steer(self, sticks: Sticks) -> None:
        """Hold these stick positions until the next ones, for `sticks_hold_s` at most."""
        self._steering = True
        drone = self._drone()
        if not drone.piloting(
            sticks.roll, sticks.pitch, sticks.yaw, sticks.climb, self._config.sticks_hold_s
        ):
            raise DroneError(f"{self._config.where} does not take stick positions any more")

    def centre(self) -> None:
        """Centre the sticks, if they are held."""
        if self._steering:
            self._drone().piloting(0, 0, 0, 0, 0.0)

    def let_go(self) -> None:
        """Send no more stick positions."""
        if self._steering:
            self._steering = False
            drone = self._drone()
            drone.piloting(0, 0, 0, 0, 0.0)
            drone.stop_piloting()

    def point(self, pitch_rad: float) -> None:
        """Point the camera: rad from the horizon, negative down."""
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
