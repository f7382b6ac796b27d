"""The site mapper: each view first corrects the drone's pose on the map, then extends the map.

A `View` passes through the layers in one direction: recent obstacles, registration, landmarks,
movers, the grid of the ground.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from perception.mapping.ground_grid import CELL_M, GroundGrid
from perception.mapping.known_objects import KnownObjects
from perception.mapping.landmarks import Landmarks, drop_missed, find_free, merge
from perception.mapping.mark_place import MarkPlace
from perception.mapping.movers import (
    ALONG_BEARING_M,
    HIDDEN_M,
    HIDDEN_MPS,
    LIFE_S,
    SETTLES_S,
    MoverTracker,
    are_of_known,
    find_arrivals,
    hidden_arrival,
)
from perception.mapping.objects import find_objects
from perception.mapping.recent import RecentLayer
from perception.mapping.registration import Contradiction, Registration
from perception.mapping.view import View
from uav_bt.lab.classes import OUTSIDE, LabClasses
from uav_bt.types import CameraModel, ClassMap, Frame, MarkFix, Pose2D
from uav_bt.types.arrays import Floats, Ids
from uav_bt.types.dead_reckoning import MotionEstimate
from uav_bt.types.site_map import MapObject, SiteMap

# The odometry counts as telemetry alone when it has followed no ground for longer. Chosen.
_TRACKED_S: Final = 0.6
_DISPLACED_M: Final = 0.03  # a view with a larger residual adds no points; chosen
_LOST_M: Final = 0.05  # in a view with a larger residual no movers are searched; chosen
# Below this height nothing is judged to move, because the error of the height makes standing
# obstacles slide; nothing that has arrived is judged to stand, either. Chosen.
_LOW_M: Final = 1.2
_SETTLED_S: Final = 1.0  # points known for this long correct the drone's pose; chosen
_RESIDUAL_VIEWS: Final = 200  # number of views in the mean of the residual; chosen
_OBJECTS_S: Final = 0.5  # interval between two searches for objects; chosen


class SiteMapper:
    """Makes one map of the views of a mission.

    Args:
        classes: classes of the lab.
        mark_m: radius of the landing mark; 0 without one.
    """

    def __init__(self, classes: LabClasses, *, mark_m: float = 0.0) -> None:
        self._classes, self._mark_m = classes, mark_m
        self._on_legs = classes.legs_m > 0.0
        self._restarts = 0  # number of times that the map was restarted
        self._motion: MotionEstimate | None = None
        self._start: Pose2D | None = None  # take-off pose in the dead-reckoned frame
        self._captured_s = -math.inf
        self._recent = RecentLayer()
        self._known_objects = KnownObjects()
        self._movers = MoverTracker()
        self._begin()

    def _begin(self) -> None:
        self._grid = GroundGrid()
        self._registration = Registration()
        self._bases, self._edges = Landmarks.none(), Landmarks.none()
        self._mark = MarkPlace()
        self._contradiction = Contradiction(self._captured_s)
        self._objects: tuple[MapObject, ...] = ()
        self._objects_s = -math.inf
        self._residual_m, self._matched = 0.0, 0

    def look(
        self, class_map: ClassMap, frame: Frame, camera: CameraModel, motion: MotionEstimate
    ) -> None:
        """Add the class map of a frame, with the motion that saw it and the camera at its size."""
        view = View.of(class_map, frame, camera, motion.seen)
        self.follow(motion)
        if view is None:
            self._recent.pass_over(frame.captured_s)
        else:
            self.add(view)

    def follow(self, motion: MotionEstimate) -> None:
        """Update the drone's motion; call it before each view with the motion up to it."""
        pose = motion.pose
        self._registration.predict(pose, tracked=motion.untracked_s <= _TRACKED_S)
        self._motion = motion
        if self._start is None:
            self._start = Pose2D(x_m=pose.x_m, y_m=pose.y_m, yaw_rad=pose.yaw_rad)
        here = self._registration.corrected(pose)
        self._grid.fly_over(here.x_m, here.y_m)
        self._recent.expire(pose.time_s)

    def restart(self) -> None:
        """Begin the map anew; objects keep their numbers."""
        self._restarts += 1
        self._known_objects.restart(self._registration.correction)
        self._begin()
        self._movers.restart()
        self._recent.forget()  # its points were placed by the abandoned map

    def add(self, view: View) -> None:
        """Add a view, whose pose is dead-reckoned."""
        time_s = self._captured_s = view.captured_s
        view = self._without_mark(view)
        self._recent.add(view)
        off_m = self._registration.match(view, *self._settled(time_s))
        if off_m is not None:
            self._matched = min(self._matched + 1, _RESIDUAL_VIEWS)
            self._residual_m += (off_m - self._residual_m) / self._matched
        placed = view.at(self._registration.corrected(view.pose))
        self._drop_missed(placed)
        if self._contradiction.is_certain(time_s):
            self.restart()
            return
        self._add_points(placed, 0.0 if off_m is None else off_m)
        if off_m is None or off_m <= _LOST_M:
            self._meet_hidden(placed)
        self._known_objects.measure(placed)
        self._grid.add(placed)
        self._grid.note_moving(self._movers.may_move_m(time_s), time_s)
        self._movers.forget_free(self._grid.shown_at(self._movers.places_m(), time_s), time_s)
        # Bases of a mover are kept for as long as the map keeps the mover.
        trails_m = self._movers.trails_m()
        trails_m[:, :2] = self._registration.correction.points_to_body(trails_m[:, :2])
        self._recent.forget_trails(time_s + LIFE_S, trails_m)
        if time_s - self._objects_s >= _OBJECTS_S:
            classes, self._objects_s = self._classes, time_s
            found = find_objects(self._bases, classes.standing, classes.legs_m)
            self._objects = self._known_objects.named(found)

    def _without_mark(self, view: View) -> View:
        """Return a view without the bases on a tag: a tag that is seen has nothing on it.

        Class maps of little training take parts of it for obstacles.
        """
        mark = self._mark.mark
        if mark is None or mark.yaw_rad is None:
            return view
        x_m, y_m = self._registration.correction.to_body(mark.x_m, mark.y_m)
        return view.without(Pose2D(x_m=x_m, y_m=y_m, yaw_rad=0.0), self._mark_m)

    def see_mark(self, fix: MarkFix) -> None:
        """Add a sighting of the landing mark, relative to the drone's present pose."""
        if self._motion is not None:
            self._mark.add(fix, self._motion.pose, self._registration, self._grid)

    def map(self, motion: MotionEstimate) -> SiteMap:
        """Return the map with the pose of a motion that is not earlier than the newest view."""
        grid, window = self._grid, self._grid.window()
        pose = self._registration.corrected(motion.pose)
        return SiteMap(
            classes=self._classes,
            pose=pose,
            corner_m=grid.corner_m(window),
            cell_m=CELL_M,
            seen_s=grid.seen_s[window].copy(),
            free=grid.free[window].copy(),
            outside=grid.outside(window),
            passed=grid.passed[window].copy(),
            obstacles_m=self._obstacles_m(),
            edges_m=self._edges.xy_m,
            captured_s=self._captured_s,
            movers=self._movers.movers(max(motion.pose.time_s, self._captured_s)),
            moved_s=self._movers.moved_s,
            lanes_m=grid.lanes_m(self._captured_s),
            objects=self._objects,
            mark=self._mark.mark,
            correction=self._registration.correction,
            residual_m=self._residual_m,
            contradicted_s=self._contradiction.lasts_s(self._captured_s),
            restarts=self._restarts,
            full=grid.full,
            untracked_s=motion.untracked_s,
            start=self._start or pose,
            near=self._recent.near(motion.pose),
        )

    def _obstacles_m(self) -> Floats:
        """Return the bases of obstacles, (N, 2), without those on a tag."""
        xy_m, mark = self._bases.xy_m, self._mark.mark
        if mark is None or mark.yaw_rad is None:
            return xy_m
        beside = np.hypot(*(xy_m - (mark.x_m, mark.y_m)).T) > self._mark_m
        return np.asarray(xy_m[beside])

    def _settled(self, time_s: float) -> tuple[Floats, Ids]:
        """Return points known for long enough to correct the drone's pose: (M, 2), and classes."""
        tables = self._bases, self._edges
        settled = [time_s - each.first_s >= _SETTLED_S for each in tables]
        xy_m = [each.xy_m[rows] for each, rows in zip(tables, settled, strict=True)]
        ids = [each.ids[rows] for each, rows in zip(tables, settled, strict=True)]
        return np.vstack(xy_m), np.concatenate(ids)

    def _drop_missed(self, view: View) -> None:
        """Count points that a view shows to be ground, and drop those missed too often."""
        kept, counts = [], np.zeros(2, dtype=int)
        for known in (self._bases, self._edges):
            in_view, free = find_free(known, view, self._on_legs)
            counts += (in_view.sum(), free.sum())
            kept.append(drop_missed(known, free))
        self._bases, self._edges = kept
        self._contradiction.add(view.captured_s, int(counts[0]), int(counts[1]))

    def _add_points(self, view: View, off_m: float) -> None:
        """Add standing bases and edges to the map; let the tracker follow arrivals.

        The view is placed in the map's frame; `off_m` is its residual against the map.
        """
        bases = Landmarks.of(view, view.bases.xy_m, view.bases.ids)
        edge_ids = np.full(len(view.edges_m), OUTSIDE, dtype=np.uint8)
        edges = Landmarks.of(view, view.edges_m, edge_ids)
        if off_m <= _LOST_M:
            bases = self._standing_bases(view, bases)
            known = self._bases
            self._bases = known.take(~self._movers.passed_over(known.xy_m, known.first_s))
        self._bases = merge(self._bases, bases, adds=off_m <= _DISPLACED_M)
        self._edges = merge(self._edges, edges, adds=off_m <= _DISPLACED_M)

    def _meet_hidden(self, view: View) -> None:
        """Add a mover where an obstacle with a hidden base covers ground that was free."""
        time_s, hidden_m = view.captured_s, self._recent.unplaced_m
        if not len(hidden_m) or view.height_m < _LOW_M:
            return
        sides_m = [each.outline_m(ALONG_BEARING_M) for each in self._objects]
        known_m = np.vstack([self._obstacles_m(), *sides_m])
        ahead = hidden_arrival(hidden_m, view.pose, self._grid, known_m)
        if ahead is None:
            return
        place_m = np.array([view.pose.x_m, view.pose.y_m]) + HIDDEN_M * ahead
        if not self._movers.may_be_at(place_m, time_s):
            self._movers.meet(place_m, -HIDDEN_MPS * ahead, time_s)

    def _standing_bases(self, view: View, bases: Landmarks) -> Landmarks:
        """Pass the bases that have arrived to the mover tracker; return those that stand."""
        self._movers.predict(view.captured_s)
        on_ground = self._grid.was_ground(bases.xy_m)
        owned = self._movers.owns(bases.xy_m)
        arrived = find_arrivals(bases, self._bases, on_ground, owned)
        # Ground shows around a leg before the leg is near enough for the map.
        arrived &= ~self._on_legs[bases.ids]
        stands, moved = ~arrived, bases.take(arrived)
        stands[arrived] = self._movers.follow(
            moved.xy_m,
            np.array([view.lens.x_m, view.lens.y_m]),
            view.captured_s,
            cut=view.is_cut(arrived)[arrived],
            tall=view.bases.tall[arrived] & ~are_of_known(moved, self._bases, view.captured_s),
            judges=view.height_m >= _LOW_M,
        )
        settled_s = bases.settled_s + np.where(on_ground, SETTLES_S, 0.0)
        return replace(bases, settled_s=settled_s).take(stands)
