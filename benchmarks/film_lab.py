"""Film a simulated lab with a scripted pilot, as a person films a room with the drone.

    python -m benchmarks.film_lab depot --out runs/depot-video

The pilot flies by the drone's own commands on a round through the free places of each training
scene, turns once at every place with another pitch of the camera, and films the landing mark from
above. A second flight above all heads films people and carts. Each flight gives one MP4 file.
"""

from __future__ import annotations

import argparse
import math
from fractions import Fraction
from pathlib import Path
from typing import Final

import numpy as np

from sim_bridge.twin import TwinConfig
from sim_bridge.twin.drone import TwinDrone
from sim_bridge.twin.scene import Scene
from uav_bt.display.video.video_file import VideoFile
from uav_bt.errors import InputError
from uav_bt.lab.shipped import load_lab
from uav_bt.types import Command, GimbalTo, Land, Movement, TakeOff, Velocity
from uav_bt.types.pose import wrap_angle

Point = tuple[float, float]

TICK_S: Final = 0.1
CELL_M: Final = 0.25  # of the grid of places
ROOM_M: Final = 0.55  # from the drone's centre to objects and walls
ABOVE_M: Final = 2.4  # flight height above people and carts
PITCHES_DEG: Final = (-12.0, -28.0, -45.0)  # of the camera, place by place
TURN_RADPS: Final = 0.7
REACHED_M: Final = 0.15
GAIN: Final = 1.2  # 1/s, from distance to speed
SPEED_MPS: Final = 0.6
LEG_TIMEOUT_S: Final = 20.0


class Pilot:
    """A person who watches the drone and steers it by velocities; every frame is kept."""

    def __init__(self, drone: TwinDrone, film: VideoFile) -> None:
        self._drone, self._film, self._last = drone, film, -1

    def fly_to(self, point: Point, height_m: float) -> None:
        """Fly straight to a place of the drawing, looking ahead."""
        until_s = self._drone.clock.now() + LEG_TIMEOUT_S
        while self._drone.clock.now() < until_s:
            pose = self._drone.referee.truth().pose
            east_m, north_m = point[0] - pose.x_m, point[1] - pose.y_m
            up_m, away_m = height_m - pose.z_m, math.hypot(east_m, north_m)
            if away_m < REACHED_M and abs(up_m) < REACHED_M:
                break
            off = wrap_angle(math.atan2(north_m, east_m) - pose.yaw_rad) if away_m > 0.4 else 0.0
            pace = min(SPEED_MPS, GAIN * away_m) / max(away_m, 1e-6)
            pace = 0.0 if abs(off) > 0.6 else pace  # turns first
            cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
            self.send(
                Velocity(
                    forward_mps=pace * (cos * east_m + sin * north_m),
                    right_mps=pace * (sin * east_m - cos * north_m),
                    down_mps=-GAIN * up_m,
                    yaw_rate_radps=-GAIN * off,
                )
            )
        self.send(None, then_s=0.3 - TICK_S)

    def turn(self) -> None:
        """Turn once around."""
        for _ in range(round(2.0 * math.pi / TURN_RADPS / TICK_S)):
            self.send(Velocity(yaw_rate_radps=TURN_RADPS))

    def point_camera(self, pitch_deg: float) -> None:
        """Point the camera and wait until it has moved."""
        self.send(Velocity(), GimbalTo(pitch_rad=math.radians(pitch_deg)), then_s=0.5)

    def send(
        self, movement: Movement | None, gimbal: GimbalTo | None = None, then_s: float = 0.0
    ) -> None:
        """Send a command, and wait; keep the frames."""
        for tick in range(1 + round(then_s / TICK_S)):
            frame = self._drone.observe().frame
            if frame is not None and frame.index != self._last:
                self._film.write(frame.image, round(frame.captured_s / TICK_S))
                self._last = frame.index
            if movement is not None and tick == 0:
                self._drone.send(Command(movement=movement, gimbal=gimbal))
            self._drone.clock.sleep_until(self._drone.clock.now() + TICK_S)


class FreePlaces:
    """The places of a scene where a drone has room at a height."""

    def __init__(self, scene: Scene, height_m: float) -> None:
        self._scene, self._height_m = scene, height_m
        half_x, half_y = (side / 2 - ROOM_M for side in scene.ground.size_m)
        xs = np.arange(-half_x, half_x + 1e-9, CELL_M)
        ys = np.arange(-half_y, half_y + 1e-9, CELL_M)
        cells = [(float(x), float(y)) for x in xs for y in ys]
        self.points = [cell for cell in cells if self._is_free(cell)]
        if not self.points:
            raise InputError(f"scene '{scene.name}' has no room to fly at {height_m:g} m")

    def after(self, route: list[Point]) -> Point:
        """Return the place farthest from a route that a straight leg leads to from its end."""
        seen = [place for place in self.points if self._leg_is_free(route[-1], place)]
        return max(seen, key=lambda place: min(math.dist(place, other) for other in route))

    def _leg_is_free(self, begin: Point, end: Point) -> bool:
        count = max(2, round(math.dist(begin, end) / 0.1))
        return all(self._is_free((x, y)) for x, y in np.linspace(begin, end, count).tolist())

    def _is_free(self, point: Point) -> bool:
        return not any(
            block.base_m - ROOM_M < self._height_m < block.top_m + ROOM_M
            and block.footprint.distance_m(*point) < ROOM_M
            for item in self._scene.placed
            for block in item.standing.blocks
        )


def fly_round(pilot: Pilot, scene: Scene, height_m: float, count: int) -> None:
    """Take off, turn at every place, film the mark from above, and land."""
    places = FreePlaces(scene, height_m)
    mark = scene.pads[0].position_m if scene.pads else (0.0, 0.0)
    route = [min(places.points, key=lambda place: math.dist(mark, place))]
    pilot.send(TakeOff(), then_s=4.0)
    pilot.fly_to(route[0], height_m)
    for number in range(count):
        pilot.point_camera(PITCHES_DEG[number % len(PITCHES_DEG)])
        route.append(places.after(route))
        pilot.fly_to(route[-1], height_m)
        pilot.turn()
    for place in reversed(route):
        pilot.fly_to(place, height_m)
    for pitch_deg, lower_m in ((-60.0, height_m), (-90.0, height_m), (-90.0, 0.8)):
        pilot.point_camera(pitch_deg)
        pilot.fly_to(mark, lower_m)
    pilot.send(Land(), then_s=3.0)


def main() -> None:
    """Film the training scenes of a lab."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("lab")
    parser.add_argument("--places", type=int, default=8, help="where the pilot turns")
    parser.add_argument("--image-size", default="1280x720")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    lab = load_lab(given.lab)
    width_px, height_px = map(int, given.image_size.split("x"))
    size_px = (width_px, height_px)
    given.out.mkdir(parents=True, exist_ok=True)
    low = (lab.flight.flight_height_m or 1.5, given.places, 0)
    rounds = (low, (ABOVE_M, given.places // 2, 2))
    for scene in (str(path) for name, path in lab.scenes.items() if "train" in name):
        for seed, (height_m, places, movers) in enumerate(rounds):
            path = given.out / f"{Path(scene).stem}-{seed}.mp4"
            config = TwinConfig(scene=scene, seed=seed, image_size_px=size_px, movers=movers)
            drone = config.create()
            film = VideoFile(path, size_px=size_px, frames_per_s=Fraction(10))
            drone.connect()
            try:
                fly_round(Pilot(drone, film), drone.scene, height_m, places)
            finally:
                film.close()
                drone.disconnect()
            print(path)


if __name__ == "__main__":
    main()
