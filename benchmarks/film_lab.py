"""Film a simulated lab with a scripted pilot, as a person films a room with the drone.

    python -m benchmarks.film_lab depot --out runs/depot-video

The pilot flies by the drone's own commands on a round through the free places of each training
scene, turns once at every place with another pitch of the camera, and films the landing mark from
above. A second flight above all heads films people and carts. Each flight gives one MP4 file.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Final

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from sim_bridge.twin import TwinConfig
from sim_bridge.twin.drone import TwinDrone
from sim_bridge.twin.scene import Scene
from uav_bt.display.video.video_file import VideoFile
from uav_bt.errors import DroneError, InputError
from uav_bt.lab.shipped import load_lab
from uav_bt.types import Command, GimbalTo, Land, TakeOff, Velocity
from uav_bt.types.pose import Pose, wrap_angle

Point = tuple[float, float]

TICK_S: Final = 0.1
CELL_M: Final = 0.25  # of the grid that the round is planned on
ROOM_M: Final = 0.55  # from the drone's centre to objects and walls
ABOVE_M: Final = 2.4  # flight height above people and carts
PITCHES_DEG: Final = (-12.0, -28.0, -45.0)  # of the camera, place by place
TURN_RADPS: Final = 0.7
REACHED_M: Final = 0.15
GAIN: Final = 1.2  # 1/s, from distance to speed
SPEED_MPS: Final = 0.6
LEG_TIMEOUT_S: Final = 12.0


@dataclass(frozen=True, kw_only=True)
class Round:
    """A pilot's flight.

    Attributes:
        height_m: Flight height above the ground.
        places: Number of places where the pilot turns.
        movers: Number of people and carts.
    """

    height_m: float
    places: int
    movers: int = 0


class Pilot:
    """A person who watches the drone and steers it by velocities; every frame is kept."""

    def __init__(self, drone: TwinDrone, film: VideoFile) -> None:
        self._drone, self._film = drone, film
        self._last = -1

    def take_off(self) -> None:
        """Start and wait until the drone hovers."""
        self._tick(Command(movement=TakeOff()))
        self._wait(4.0)

    def fly_to(self, point: Point, height_m: float) -> None:
        """Fly straight to a place of the drawing, looking ahead."""
        until_s = self._drone.clock.now() + LEG_TIMEOUT_S
        while self._drone.clock.now() < until_s:
            pose = self._pose()
            east_m, north_m = point[0] - pose.x_m, point[1] - pose.y_m
            up_m = height_m - pose.z_m
            away_m = math.hypot(east_m, north_m)
            if away_m < REACHED_M and abs(up_m) < REACHED_M:
                break
            off = wrap_angle(math.atan2(north_m, east_m) - pose.yaw_rad) if away_m > 0.4 else 0.0
            pace = min(SPEED_MPS, GAIN * away_m) / max(away_m, 1e-6)
            if abs(off) > 0.6:
                pace = 0.0  # turns first
            cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
            self._tick(
                Command(
                    movement=Velocity(
                        forward_mps=pace * (cos * east_m + sin * north_m),
                        right_mps=pace * (sin * east_m - cos * north_m),
                        down_mps=-GAIN * up_m,
                        yaw_rate_radps=-GAIN * off,
                    )
                )
            )
        self._wait(0.3)

    def turn(self) -> None:
        """Turn once around."""
        for _ in range(round(2.0 * math.pi / TURN_RADPS / TICK_S)):
            self._tick(Command(movement=Velocity(yaw_rate_radps=TURN_RADPS)))

    def point_camera(self, pitch_deg: float) -> None:
        """Point the camera and wait until it has moved."""
        self._tick(Command(movement=Velocity(), gimbal=GimbalTo(pitch_rad=math.radians(pitch_deg))))
        self._wait(0.5)

    def land(self) -> None:
        """Descend here and wait."""
        self._tick(Command(movement=Land()))
        self._wait(3.0)

    def _pose(self) -> Pose:
        referee = self._drone.referee
        if referee is None:
            raise DroneError("the drone is not connected")
        return referee.truth().pose

    def _wait(self, time_s: float) -> None:
        for _ in range(round(time_s / TICK_S)):
            self._tick(None)

    def _tick(self, command: Command | None) -> None:
        frame = self._drone.observe().frame
        if frame is not None and frame.index != self._last:
            self._film.write(frame.image, round(frame.captured_s / TICK_S))
            self._last = frame.index
        if command is not None:
            self._drone.send(command)
        self._drone.clock.sleep_until(self._drone.clock.now() + TICK_S)


class FreePlaces:
    """The places of a scene where a drone has room at a height, and paths between them."""

    def __init__(self, scene: Scene, height_m: float) -> None:
        self._scene, self._height_m = scene, height_m
        half_x, half_y = (side / 2 - ROOM_M for side in scene.ground.size_m)
        xs = np.arange(-half_x, half_x + 1e-9, CELL_M)
        ys = np.arange(-half_y, half_y + 1e-9, CELL_M)
        cells = [(float(x), float(y)) for x in xs for y in ys]
        self.points = [cell for cell in cells if self._is_free(cell)]
        if not self.points:
            raise InputError(f"scene '{scene.name}' has no room to fly at {height_m:g} m")
        table = np.array(self.points)
        gaps = np.hypot(*(table[:, None] - table[None]).transpose(2, 0, 1))
        near = (gaps > 0.0) & (gaps < 1.5 * CELL_M)
        self._distance_m, self._before = dijkstra(
            coo_array(np.where(near, gaps, 0.0)), return_predecessors=True
        )

    def nearest(self, point: Point) -> int:
        """Return the index of the free place nearest to a point."""
        return int(np.argmin([math.dist(point, place) for place in self.points]))

    def spread(self, first: int, count: int) -> list[int]:
        """Return places far from each other that can be reached, in the order of a round."""
        reachable = np.isfinite(self._distance_m[first])
        chosen = [first]
        while len(chosen) < count + 1:
            away = self._distance_m[chosen].min(axis=0)
            chosen.append(int(np.where(reachable, away, -1.0).argmax()))
        tour, left = [first], set(chosen[1:])
        while left:
            tour.append(min(left, key=lambda place: self._distance_m[tour[-1], place]))
            left.remove(tour[-1])
        return tour[1:]

    def path(self, begin: int, end: int) -> list[Point]:
        """Return the corners of a path; each leg has room on all of its length."""
        cells = [end]
        while cells[-1] != begin:
            cells.append(int(self._before[begin, cells[-1]]))
        points = [self.points[cell] for cell in reversed(cells)]
        corners, at = [], 0
        while at < len(points) - 1:
            further = (
                to
                for to in range(len(points) - 1, at, -1)
                if to == at + 1 or self._leg_is_free(points[at], points[to])
            )
            at = next(further)
            corners.append(points[at])
        return corners

    def _leg_is_free(self, begin: Point, end: Point) -> bool:
        steps = max(2, round(math.dist(begin, end) / 0.1))
        shares = np.linspace(0.0, 1.0, steps)
        return all(
            self._is_free((begin[0] + s * (end[0] - begin[0]), begin[1] + s * (end[1] - begin[1])))
            for s in shares.tolist()
        )

    def _is_free(self, point: Point) -> bool:
        return not any(
            block.base_m - ROOM_M < self._height_m < block.top_m + ROOM_M
            and block.footprint.distance_m(*point) < ROOM_M
            for item in self._scene.placed
            for block in item.standing.blocks
        )


def film(scene: str, rounds: Sequence[Round], seed: int, size_px: Point, out: Path) -> list[Path]:
    """Fly the rounds in a scene and return the MP4 files.

    Args:
        scene: Name or path of the scene.
        rounds: The flights.
        seed: Seed of the first flight.
        size_px: Width and height of the video.
        out: Folder of the files.
    """
    files = []
    for number, plan in enumerate(rounds):
        path = out / f"{Path(scene).stem}-{number}.mp4"
        files.append(path)
        if path.exists():
            continue
        width_px, height_px = (round(side) for side in size_px)
        drone = TwinConfig(
            scene=scene,
            seed=seed + number,
            image_size_px=(width_px, height_px),
            movers=plan.movers,
        ).create()
        unfinished = path.with_name(f"unfinished-{path.name}")
        drone.connect()
        try:
            film_file = VideoFile(
                unfinished, size_px=(width_px, height_px), frames_per_s=Fraction(10)
            )
            try:
                fly_round(Pilot(drone, film_file), drone.scene, plan)
            finally:
                film_file.close()
            unfinished.rename(path)
        finally:
            drone.disconnect()
            unfinished.unlink(missing_ok=True)
    return files


def fly_round(pilot: Pilot, scene: Scene, plan: Round) -> None:
    """Take off, turn at every place, film the mark from above, and land."""
    places = FreePlaces(scene, plan.height_m)
    if scene.take_off.position_m is None and not scene.pads:
        raise InputError(f"scene '{scene.name}' states no take-off place")
    mark = scene.pads[0].position_m if scene.pads else (0.0, 0.0)
    here = places.nearest(mark)
    pilot.take_off()
    pilot.fly_to(mark, plan.height_m)
    for number, place in enumerate(places.spread(here, plan.places)):
        pilot.point_camera(PITCHES_DEG[number % len(PITCHES_DEG)])
        for corner in places.path(here, place):
            pilot.fly_to(corner, plan.height_m)
        pilot.turn()
        here = place
    home = places.nearest(mark)
    for corner in places.path(here, home):
        pilot.fly_to(corner, plan.height_m)
    for pitch_deg, height_m in ((-60.0, plan.height_m), (-90.0, plan.height_m), (-90.0, 0.8)):
        pilot.point_camera(pitch_deg)
        pilot.fly_to(mark, height_m)
    pilot.land()


def main() -> None:
    """Film the training scenes of a lab."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("lab")
    parser.add_argument("--scenes", default="", help="with commas; the training scenes if absent")
    parser.add_argument("--places", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--image-size", default="1280x720")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    lab = load_lab(options.lab)
    training = [str(path) for name, path in lab.scenes.items() if "train" in name]
    scenes = options.scenes.split(",") if options.scenes else training
    width, _, height = options.image_size.partition("x")
    options.out.mkdir(parents=True, exist_ok=True)
    height_m = lab.flight.flight_height_m or 1.5
    rounds = (
        Round(height_m=height_m, places=options.places),
        Round(height_m=ABOVE_M, places=options.places // 2, movers=2),
    )
    for scene in scenes:
        for path in film(scene, rounds, options.seed, (float(width), float(height)), options.out):
            print(path)


if __name__ == "__main__":
    main()
