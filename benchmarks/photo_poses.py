"""How exact the poses of photographs are, and how many sides of objects are photographed.

    python benchmarks/photo_poses.py --scenes test-a,test-b --flights 2 --profile lab

Flies `inspect_objects` and compares each photograph's pose with the true one at its capture, both
relative to the take-off pose. The sides are the view points that the map has room for.
"""

from __future__ import annotations

import argparse
import bisect
import math
from dataclasses import dataclass, field, replace

import numpy as np

from behaviours.fly.objects import ViewPoints
from uav_bt import app
from uav_bt.app.assembly import Flight
from uav_bt.errors import UavBtError
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.protocols import Drone
from uav_bt.types import Pose, TakeOff
from uav_bt.types.flight_results import Photo


@dataclass
class TrueWay:
    """Notes the true poses of a flight and the view points of its objects."""

    view_points: list[ViewPoints]
    begin_s: float | None = None  # of the take-off command
    start: Pose | None = None
    times_s: list[float] = field(default_factory=list)
    poses: list[Pose] = field(default_factory=list)
    sides: dict[str, int] = field(default_factory=dict)  # by object: places with room and view

    def on_tick(self, record: TickRecord) -> None:
        """Note a tick."""
        if record.truth is None:
            return
        if self.begin_s is None and isinstance(record.command.movement, TakeOff):
            self.begin_s, self.start = record.time_s, record.truth.pose
        self.times_s.append(record.time_s)
        self.poses.append(record.truth.pose)
        for leaf in self.view_points:
            count, _, of = leaf.feedback_message.partition(" places around ")
            if count.isdigit():
                self.sides[of] = int(count)

    def error_of(self, photo: Photo) -> tuple[float, float] | None:
        """Return the error of a photograph's pose, metres and degrees; None without a pose."""
        if photo.pose is None or self.begin_s is None or self.start is None:
            return None
        index = bisect.bisect_left(self.times_s, self.begin_s + photo.time_s - 1e-6)
        pose, start = self.poses[min(index, len(self.poses) - 1)], self.start
        cos, sin = math.cos(start.yaw_rad), math.sin(start.yaw_rad)
        x_m, y_m = pose.x_m - start.x_m, pose.y_m - start.y_m
        ahead_m, right_m = cos * x_m + sin * y_m, sin * x_m - cos * y_m
        heading_deg = math.degrees(start.yaw_rad - pose.yaw_rad)
        return (
            math.dist((ahead_m, right_m), (photo.pose.x_m, photo.pose.y_m)),
            abs(math.remainder(photo.pose.heading_deg - heading_deg, 360.0)),
        )


def fly(scene: str, seed: int, given: argparse.Namespace) -> tuple[TrueWay, tuple[Photo, ...]]:
    """Fly the inspection once, and return its true way and photographs."""
    ways: list[TrueWay] = []

    def listen(flight: Flight[Drone]) -> list[TickListener]:
        points = [leaf for leaf in flight.mission.leaves() if isinstance(leaf, ViewPoints)]
        ways.append(TrueWay(points))
        return [ways[0]]

    options = app.FlightOptions(
        scene=scene,
        seed=seed,
        profile=given.profile,
        drone=given.drone,
        exact_masks=given.exact_masks,
    )
    if given.drone == "twin":
        options = replace(options, image_size_px=(320, 180))
    flown = app.fly("inspect_objects", options, listeners=[listen])
    return ways[0], tuple(flown.photos)


def main() -> None:
    """Fly, and print errors and shares."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scenes", default="val-a,val-b")
    parser.add_argument("--flights", type=int, default=1, help="in each scene")
    parser.add_argument("--seed-from", type=int, default=0)
    parser.add_argument("--profile", default="lab")
    parser.add_argument("--drone", default="twin")
    parser.add_argument("--exact-masks", action="store_true")
    given = parser.parse_args()
    errors: list[tuple[float, float]] = []
    sides = photographed = 0
    for scene in given.scenes.split(","):
        for seed in range(given.seed_from, given.seed_from + given.flights):
            try:
                way, photos = fly(scene, seed, given)
            except UavBtError as error:
                parser.exit(2, f"{error}\n")
            errors += [found for found in map(way.error_of, photos) if found is not None]
            sides += sum(way.sides.values())
            photographed += len(photos)
            print(f"{scene} {seed}: {len(photos)} photographs, {sum(way.sides.values())} sides")
    off_m, off_deg = np.array(errors).reshape(-1, 2).T
    print(f"{photographed} photographs of {sides} sides; pose errors, median (95 %):")
    print(f"{np.median(off_m):.3f} ({np.percentile(off_m, 95):.3f}) m")
    print(f"{np.median(off_deg):.1f} ({np.percentile(off_deg, 95):.1f}) degrees")


if __name__ == "__main__":
    main()
