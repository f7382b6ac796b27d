"""Errors of the map's objects against those of a scene.

    python -m benchmarks.map_objects --flights 2
    python -m benchmarks.map_objects --profile harsh --seconds 150

The survey flies without images (`--drone plain`). An object of the map is right if its class is
that of a true object within 0.5 m; of two such objects the second one is a duplicate.

position, size  of the objects at the end, the size as the length of the longer side: median of the
                absolute error, and its 95th percentile
height          of those with a height on the map; the roofs of the others are above the camera
one id          share of the ticks after an object's first one in which it has its most frequent id:
                the smallest of all objects, and the number of objects below 95 %
false           objects of the map at the end without a true one, and the same in the worst tick
duplicates      likewise
"""

from __future__ import annotations

import argparse
import math
from collections import Counter, defaultdict
from dataclasses import dataclass, field

import numpy as np

from benchmarks.mission_text import cover_or_turn, explore_and_come_home
from uav_bt import app
from uav_bt.app.assembly import Flight
from uav_bt.board import SITE_MAP
from uav_bt.errors import UavBtError
from uav_bt.mission.judge import JudgeConfig
from uav_bt.mission.map_alignment import MapAlignment, MapPlacement
from uav_bt.mission.map_check import FOUND_M
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.protocols import Drone
from uav_bt.types.ground import Standing
from uav_bt.types.site_map import MapObject

SCENES = "train-a,train-b,train-c,train-d"
SAME_ID = 0.95


@dataclass(kw_only=True)
class Errors:
    """Errors of the map at the end of one or more flights.

    Attributes:
        position_m: Distances of the objects from their true places.
        size_m: Errors of the longer sides.
        height_m: Errors of the heights that the map has.
        one_id: Share of the ticks in which an object has its most frequent id, for each object.
        missing: Number of true objects without an object of the map.
        without_height: Number of objects of unknown height.
        false: Number of objects of the map without a true one.
        duplicates: Number of further objects of the map for a true one.
        worst_false: The same in the worst tick.
        worst_duplicates: The same in the worst tick.
    """

    position_m: list[float] = field(default_factory=list)
    size_m: list[float] = field(default_factory=list)
    height_m: list[float] = field(default_factory=list)
    one_id: list[float] = field(default_factory=list)
    missing: int = 0
    without_height: int = 0
    false: int = 0
    duplicates: int = 0
    worst_false: int = 0
    worst_duplicates: int = 0

    def add(self, other: Errors) -> None:
        """Add the errors of further flights."""
        for name, value in vars(other).items():
            mine = getattr(self, name)
            setattr(self, name, max(mine, value) if name.startswith("most_") else mine + value)


class ObjectLog:
    """Compares the objects of the map with the true ones in every tick.

    Args:
        flight: The flight, of a drone with a referee.
    """

    def __init__(self, flight: Flight[Drone]) -> None:
        referee = flight.drone.referee
        standing = () if referee is None else referee.ground().standing
        self._true = [each for each in standing if each.class_id is not None]
        self._board = flight.context.board
        self._alignment = MapAlignment()
        self._ids: defaultdict[int, Counter[int]] = defaultdict(Counter)  # by true object
        self._ticks = 0  # with a map
        self._first: dict[int, int] = {}  # tick in which a true object was first on the map
        self._newest: dict[int, tuple[float, MapObject]] = {}  # the same: distance, and object
        self._false = self._duplicates = self._worst_false = self._worst_duplicates = 0

    def on_tick(self, record: TickRecord) -> None:
        """Compare."""
        site_map = self._board.read(SITE_MAP).value
        if record.truth is None:
            return
        yaw_rad = record.observation.state.attitude.yaw_rad
        self._alignment.add(record.time_s, record.truth.pose, yaw_rad, site_map)
        placement = self._alignment.placement
        if site_map is None or placement is None:
            return
        self._ticks += 1
        self._newest.clear()
        self._false = self._duplicates = 0
        for item in site_map.objects:
            distance_m, index = self._nearest(item, placement)
            if distance_m > FOUND_M:
                self._false += 1
                continue
            self._duplicates += index in self._newest
            self._newest[index] = min(
                (distance_m, item), self._newest.get(index, (math.inf, item)), key=lambda it: it[0]
            )
            self._first.setdefault(index, self._ticks)
            self._ids[index][item.id] += 1
        self._worst_false = max(self._worst_false, self._false)
        self._worst_duplicates = max(self._worst_duplicates, self._duplicates)

    def _nearest(self, item: MapObject, placement: MapPlacement) -> tuple[float, int]:
        """Return distance and index of the nearest true object of the same class."""
        x_m, y_m = placement.to_world(np.array([[item.x_m, item.y_m]]))[0]
        apart_m = [
            (math.hypot(each.footprint.x_m - x_m, each.footprint.y_m - y_m), index)
            for index, each in enumerate(self._true)
            if each.class_id == item.class_id
        ]
        return min(apart_m, default=(math.inf, -1))

    def errors(self) -> Errors:
        """Return the errors of the flight."""
        pairs = [(self._true[index], item) for index, (_, item) in self._newest.items()]
        heights_m = [
            (each.height_m, item.height_m) for each, item in pairs if item.height_m is not None
        ]
        return Errors(
            position_m=[distance_m for distance_m, _ in self._newest.values()],
            size_m=[item.size_m - _longer_side_m(each) for each, item in pairs],
            height_m=[height_m - true_m for true_m, height_m in heights_m],
            one_id=[
                max(ids.values()) / (self._ticks - self._first[index] + 1)
                for index, ids in self._ids.items()
            ],
            missing=len(self._true) - len(pairs),
            without_height=len(pairs) - len(heights_m),
            false=self._false,
            duplicates=self._duplicates,
            worst_false=self._worst_false,
            worst_duplicates=self._worst_duplicates,
        )


def _longer_side_m(standing: Standing) -> float:
    return 2.0 * max(standing.footprint.half_x_m, standing.footprint.half_y_m)


def fly(scene: str, seed: int, profile: str, seconds: float) -> Errors:
    """Fly the survey for a time and return the errors of its map."""
    text = explore_and_come_home(
        explore=cover_or_turn(), explore_s=int(seconds), home="<ReturnToBase/>", gimbal_deg=-42
    )
    options = app.FlightOptions(
        scene=scene,
        seed=seed,
        profile=profile,
        drone="plain",
        judge=JudgeConfig(time_limit_s=seconds),
    )
    logs: list[ObjectLog] = []

    def listen(flight: Flight[Drone]) -> list[TickListener]:
        logs.append(ObjectLog(flight))
        return [logs[0]]

    app.fly(text, options, listeners=[listen])
    return logs[0].errors()


def report(errors: Errors) -> str:
    """Return the errors as a table."""
    columns = {"position": errors.position_m, "size": errors.size_m, "height": errors.height_m}
    lines = [
        f"{name:10s} median {np.median(np.abs(values)):.3f} m, "
        f"95 % {np.percentile(np.abs(values), 95):.3f} m, {len(values)} objects"
        for name, values in columns.items()
        if values
    ]
    least = min(errors.one_id, default=math.nan)
    rare = sum(share < SAME_ID for share in errors.one_id)
    return "\n".join(
        [
            *lines,
            f"one id     at least {100 * least:.1f} %, {rare} objects below {100 * SAME_ID:.0f} %",
            f"missing    {errors.missing}; without height {errors.without_height}",
            f"false      {errors.false} (worst tick {errors.worst_false})",
            f"duplicates {errors.duplicates} (worst tick {errors.worst_duplicates})",
        ]
    )


def main() -> None:
    """Fly, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", default=SCENES)
    parser.add_argument("--flights", type=int, default=2, help="seeds of each scene, from 0")
    parser.add_argument("--profile", default="lab")
    parser.add_argument("--seconds", type=float, default=90.0, help="of each flight")
    given = parser.parse_args()
    errors = Errors()
    for scene in given.scenes.split(","):
        for seed in range(given.flights):
            try:
                errors.add(fly(scene, seed, given.profile, given.seconds))
            except UavBtError as error:
                parser.exit(2, f"{error}\n")
    print(report(errors))


if __name__ == "__main__":
    main()
