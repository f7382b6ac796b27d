"""Measure metric depth as a flight has it: telemetry's errors, the memory of obstacles, and all.

    python benchmarks/depth_flight.py TREE --scene val-a val-b
    python benchmarks/depth_flight.py TREE --masks exact      # quicker, without a segmentation net
    python benchmarks/depth_flight.py TREE --lab depot --scene depot-test-a

TREE is any mission file with EstimateDepth. "Cut off" are boxes whose lower end is below the image;
"distances" asks what `uav-bt net evaluate depth` asks of single images: points at 0.3 to 5 m,
evenly of obstacles and ground, each frame's as many.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perception.depth.evaluation.scores import (
    MeasuredPoints,
    draw_points,
    ranges_at,
    summarise_errors,
)
from uav_bt import app
from uav_bt.board import CAMERA, CORRIDOR, FRAME, METRIC_DEPTH
from uav_bt.board.context import MissionContext
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Drone
from uav_bt.types import ClassMap

NEAR_M = 5.0
FLYING_M = 1.0  # lower than this it takes off or lands


class Comparison:
    """Compares every n-th frame's depth with the truth."""

    def __init__(self, every: int) -> None:
        self._every = every
        self._last = -1
        self._drone: Drone | None = None
        self._mission: MissionContext | None = None
        self.errors: dict[str, list[NDArray[Any]]] = defaultdict(list)
        self.free_m: list[float] = []
        self.points: list[MeasuredPoints] = []
        self.ranges_m: list[NDArray[np.float64]] = []  # as the flight has them, of these points

    def follow(self, flight: app.Flight[Drone]) -> Sequence[Comparison]:
        """Become a listener of a flight."""
        self._drone, self._mission, self._last = flight.drone, flight.context, -1
        return (self,)

    def on_tick(self, record: TickRecord) -> None:
        """Compare the tick's depth, if it is a new one."""
        del record
        if self._drone is None or self._mission is None or self._drone.referee is None:
            return
        board, referee = self._mission.board, self._drone.referee
        depth, frame = board.read(METRIC_DEPTH).value, board.read(FRAME).value
        if depth is None or frame is None or depth.captured_s != frame.captured_s:
            return
        low = frame.height_above_ground_m < FLYING_M
        if low or frame.index == self._last or frame.index % self._every:
            return
        self._last = frame.index
        height_px, width_px = depth.depth.shape
        ids = referee.class_ids(frame, width_px, height_px)
        true = referee.depth(frame, width_px, height_px)
        classes = self._mission.classes
        boxes = classes.standing
        cut = np.isin(ids, [box for box in boxes if (ids[-1] == box).any()])
        sides = np.isin(ids, boxes) & (true < NEAR_M)
        error = depth.depth - true
        for name, where in (
            ("sides, standing", sides & ~cut),
            ("sides, cut off", sides & cut),
            ("ground", classes.is_ground(ids)),
        ):
            self.errors[name].append(error[where])
        exact = ClassMap(ids=ids, classes=classes, captured_s=frame.captured_s)
        self._measure(exact, true, depth.depth)
        corridor = board.read(CORRIDOR).value
        if corridor is not None and corridor.captured_s == depth.captured_s:
            self.free_m.append(corridor.free_distance_m)

    def _measure(
        self, exact: ClassMap, true: NDArray[np.float32], depth: NDArray[np.float32]
    ) -> None:
        """Ask for the distances of some points."""
        camera = None if self._mission is None else self._mission.board.read(CAMERA).value
        if camera is None:
            return
        camera = camera.resized(exact.ids.shape[1], exact.ids.shape[0])
        generator = np.random.default_rng((0, self._last))
        points = draw_points(exact, true, camera, generator)
        self.points.append(points)
        self.ranges_m.append(ranges_at(depth, points, camera))

    def show(self) -> None:
        """Print the results."""
        for name, pieces in self.errors.items():
            error = np.concatenate(pieces)
            known = error[np.isfinite(error)]
            if not known.size:
                print(f"  {name:<16} nothing known of {error.size} px")
                continue
            print(
                f"  {name:<16} median {np.median(np.abs(known)):.3f} m  "
                f"mean {np.abs(known).mean():.3f} m  p95 {np.percentile(np.abs(known), 95):.3f} m  "
                f"bias {known.mean():+.3f} m  known {known.size / error.size:6.1%}"
            )
        estimated, obstacle = np.concatenate(self.ranges_m), [p.obstacle for p in self.points]
        truth, on_obstacles = np.concatenate([p.range_m for p in self.points]), np.hstack(obstacle)
        for name, asked in (
            ("distances", np.full(len(truth), True)),
            ("  of obstacles", on_obstacles),
            ("  of the ground", ~on_obstacles),
        ):
            found = summarise_errors(estimated[asked], truth[asked])
            print(
                f"  {name:<16} median {found.median_m:.3f} m  mean {found.mean_m:.3f} m  "
                f"p95 {found.p95_m:.3f} m  max {found.max_m:.2f} m  "
                f"known {found.coverage:.1%} of {found.total}"
            )
        if self.free_m:
            none = float(np.mean(np.array(self.free_m) == 0.0))
            print(f"  corridor: nothing free for sure in {none:.1%} of {len(self.free_m)} frames")


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tree")
    parser.add_argument("--lab", help="the paper's if not given")
    parser.add_argument("--scene", nargs="+", default=["val-a", "val-b"])
    parser.add_argument("--image-size", type=int, nargs=2, default=(640, 360))
    parser.add_argument("--masks", choices=("exact", "unet"), default="unet")
    parser.add_argument("--seed", nargs="+", type=int, default=[3])
    parser.add_argument("--every", type=int, default=5, help="compare each n-th frame")
    arguments = parser.parse_args()
    comparison = Comparison(arguments.every)
    for scene, seed in product(arguments.scene, arguments.seed):
        options = app.FlightOptions(
            lab=arguments.lab,
            scene=scene,
            seed=seed,
            image_size_px=tuple(arguments.image_size),
            exact_masks=arguments.masks == "exact",
        )
        report = app.fly(arguments.tree, options, listeners=[comparison.follow])
        times = {name: p and p.p50 for name, p in report.perception_ms.items()}
        print(f"{scene}, {arguments.masks} masks, seed {seed}: {report.outcome}; ms: {times}")
    print(f"all flights, each {arguments.every}th frame:")
    comparison.show()


if __name__ == "__main__":
    main()
