"""Films of a simulated lab by a scripted pilot, as a person films a room with the drone.

The pilot flies by the drone's own commands on a round through the free ground of a scene, turns
once at every place with another pitch of the camera, and films the landing mark from above. With
movers a second flight films people and carts, above their heads where the room is high enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from behaviours.path.fastest import Cell, fastest_paths
from sim_bridge.twin import TwinConfig
from sim_bridge.twin.drone import TwinDrone
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene, shipped_scenes
from uav_bt.app.options import FlightOptions
from uav_bt.app.place import lab_of
from uav_bt.campaign.planning import planned_scenes
from uav_bt.display.video.video_file import VideoFile
from uav_bt.errors import InputError
from uav_bt.files import check_empty_folder, writing
from uav_bt.lab.lab import Lab
from uav_bt.mission.covered_ground import CELL_M, GroundCells
from uav_bt.protocols import Advance, silent
from uav_bt.types import Command, GimbalTo, Land, Movement, TakeOff, Velocity
from uav_bt.types.arrays import Floats
from uav_bt.types.ground import Standing
from uav_bt.types.pose import wrap_angle

Point = tuple[float, float]

TICK_S: Final = 0.1
ROOM_M: Final = 0.55  # from the drone's centre to objects, movers and walls
WIDE_M: Final = 1.2  # room from which a turn shows most
HEIGHT_M: Final = 1.5  # of the flight in a lab that states none
ABOVE_M: Final = 2.4  # of the flight above people and carts
CEILING_M: Final = 0.5  # from the drone to the ceiling
OVER_MARK_M: Final = 0.8  # of the last views of the mark
PITCHES_DEG: Final = (-12.0, -28.0, -45.0)  # of the camera, place by place
TURN_RADPS: Final = 0.7
REACHED_M: Final = 0.15
GAIN: Final = 1.2  # 1/s, from distance to speed
SPEED_MPS: Final = 0.6
LEG_TIMEOUT_S: Final = 20.0


def film_lab(
    lab: Lab,
    folder: Path,
    *,
    scenes: Sequence[str] = (),
    movers: int = 0,
    places: int = 8,
    image_size_px: tuple[int, int] = (1280, 720),
    advance: Advance = silent,
) -> Iterator[Path]:
    """Film scenes of a lab, by default all, and yield each video when it is complete."""
    check_empty_folder(folder, "lab film")
    options, rounds = FlightOptions(lab=lab), dict[Path, tuple[TwinDrone, FreeGround]]()
    ceiling_m = (lab.flight.limits or {}).get("ceiling_m", math.inf)
    shipped = (name for name in shipped_scenes() if load_scene(name).lab == lab.name)
    own = tuple(lab.scenes) or tuple(shipped)
    for file in planned_scenes(scenes or own or None, options):
        scene = load_scene(file.path)
        lab_of(options, scene)  # refuses one of another lab
        kinds = scene.room.objects.values()  # a lab without any has printed movers
        moves = movers > 0 and (not kinds or any(kind.moves for kind in kinds))
        for count in (0, movers) if moves else (0,):
            config = TwinConfig(scene=scene, seed=count, image_size_px=image_size_px, movers=count)
            drone = config.create()
            height_m = ABOVE_M if count else lab.flight.flight_height_m or HEIGHT_M
            height_m = min(height_m, ceiling_m, scene.room_size_m[2] - CEILING_M)
            path = folder / f"{Path(file.path).stem}{'-movers' if count else ''}.mp4"
            rounds[path] = drone, FreeGround(drone.scene, height_m)
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    for path, (drone, ground) in rounds.items():
        video = VideoFile(path, size_px=image_size_px, frames_per_s=Fraction(round(1 / TICK_S)))
        try:
            drone.connect()
            Pilot(drone, video).fly_round(ground, places, partial(advance, path.stem))
        except BaseException:
            video.discard()
            raise
        finally:
            video.close()
            drone.disconnect()
        yield path


class Pilot:
    """A person who watches the drone and steers it by velocities; every frame is kept."""

    def __init__(self, drone: TwinDrone, video: VideoFile) -> None:
        self._drone, self._video, self._last = drone, video, -1

    def fly_round(
        self, ground: FreeGround, count: int, advance: Callable[[int, int], None]
    ) -> None:
        """Take off, turn at every place, film the mark from above, and land on it or at the start.

        Without a mark the place of the take-off counts as one.
        """
        motion, pads = self._drone.simulation.motion, self._drone.scene.pads
        start, height_m = (motion.x_m, motion.y_m), ground.height_m
        goal, top_m = (pads[0].position_m, pads[0].size_m[2]) if pads else (start, 0.0)
        self.send(TakeOff(), then_s=4.0)
        self.fly_to(start, height_m)
        cell, route = ground.cell_near(start), [start]
        for number in range(count):
            advance(number, count)
            self.point_camera(PITCHES_DEG[number % len(PITCHES_DEG)])
            begin, cell = cell, ground.farthest_cell(cell, route)
            self._follow(ground, begin, cell)
            self.turn()
            route.append(ground.point(cell))
            # Early, too: `lab frames` keeps the middle and the end of a video for checks.
            if number in {(count - 1) // 4, count - 1}:
                begin, cell = cell, ground.cell_near(goal, cell)
                self._follow(ground, begin, cell)
                low_m = min(height_m, top_m + OVER_MARK_M)
                for pitch_deg, over_m in ((-60.0, height_m), (-90.0, height_m), (-90.0, low_m)):
                    self.point_camera(pitch_deg)
                    self.fly_to(goal, over_m)
                self.fly_to(goal, height_m)
        self.send(Land(), then_s=4.0)
        advance(count, count)

    def _follow(self, ground: FreeGround, begin: Cell, end: Cell) -> None:
        for corner in ground.way(begin, end):
            self.fly_to(corner, ground.height_m)

    def fly_to(self, point: Point, height_m: float) -> None:
        """Fly straight to a place of the drawing, looking ahead."""
        until_s = self._drone.clock.now() + LEG_TIMEOUT_S
        while self._drone.clock.now() < until_s:
            pose = self._drone.simulation.motion
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
                self._video.write(frame.image, round(frame.captured_s / TICK_S))
                self._last = frame.index
            if movement is not None and tick == 0:
                self._drone.send(Command(movement=movement, gimbal=gimbal))
            self._drone.clock.sleep_until(self._drone.clock.now() + TICK_S)


class FreeGround:
    """Where a drone has room in a scene at a height, in cells of 5 cm."""

    def __init__(self, scene: Scene, height_m: float) -> None:
        self.height_m = height_m
        solid = [
            Standing(footprint=block.footprint, height_m=block.top_m)
            for item in scene.placed
            for block in item.standing.blocks
            if block.base_m - ROOM_M < height_m < block.top_m + ROOM_M
        ]
        self._cells = GroundCells(replace(scene.ground, standing=tuple(solid)))
        inside = np.pad(self._cells.free, 1).astype(np.uint8)  # beyond the edge there is no room
        away = cv2.distanceTransform(inside, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
        self._room_m = np.asarray(away, dtype=np.float64) * CELL_M
        self._free = self._room_m > ROOM_M
        self._ones = np.ones(self._free.shape)
        for mover in scene.movers:
            if height_m < mover.size_m[2] + ROOM_M:
                for row, column in np.argwhere(self._free).tolist():
                    at_m = self.point((row, column))
                    self._free[row, column] = mover.distance_m(*at_m) > ROOM_M
        if not self._free.any():
            raise InputError(
                f"scene '{scene.name}' has no room to film at {height_m:g} m: a place must be "
                f"{ROOM_M:g} m away from objects, paths of movers, and the edge of the ground"
            )

    def point(self, cell: Cell) -> Point:
        """Return the middle of a cell in the drawing."""
        return float(self._cells.x_m[cell[1]]), float(self._cells.y_m[cell[0]])

    def cell_near(self, point: Point, begin: Cell | None = None) -> Cell:
        """Return the free cell nearest to a place, among those that a cell is connected with."""
        return self._best(-self._away_m(point), begin)

    def farthest_cell(self, begin: Cell, places: Sequence[Point]) -> Cell:
        """Return the cell farthest from all places, among those that a cell is connected with.

        Room counts twice up to a distance, as a corner shows little but its walls.
        """
        away_m = np.min([self._away_m(place) for place in places], axis=0)
        return self._best(away_m + 2.0 * np.minimum(self._room_m, WIDE_M), begin)

    def way(self, begin: Cell, end: Cell) -> Iterator[Point]:
        """Yield the corners of the shortest path between two cells, both included."""
        path, at = fastest_paths(self._free, self._ones, begin).to(end), 0
        yield self.point(begin)
        while at < len(path) - 1:
            ahead = range(len(path) - 1, at + 1, -1)
            at = next((n for n in ahead if self._is_straight(path[at], path[n])), at + 1)
            yield self.point(path[at])

    def _is_straight(self, begin: Cell, end: Cell) -> bool:
        """Return whether a straight leg stays on free cells."""
        count = 2 + 2 * round(math.dist(begin, end))
        rows, columns = np.rint(np.linspace(begin, end, count)).astype(int).T
        return bool(self._free[rows, columns].all())

    def _away_m(self, point: Point) -> Floats:
        return np.asarray(np.hypot(*np.moveaxis(self._cells.middles_m - point, -1, 0)))

    def _best(self, worth: Floats, begin: Cell | None) -> Cell:
        free = self._free
        if begin is not None:
            free = np.isfinite(fastest_paths(free, self._ones, begin).time_s)
        row, column = divmod(int(np.argmax(np.where(free, worth, -np.inf))), worth.shape[1])
        return row, column
