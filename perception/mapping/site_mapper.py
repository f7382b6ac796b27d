"""The site mapper: each view first corrects the drone's pose on the map, then extends the map.

A `View` passes through the layers in one direction: recent obstacles, registration, landmarks,
movers, the grid of the ground.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from perception.mapping.arrivals import (
    HIDDEN_M,
    HIDDEN_MPS,
    SETTLES_S,
    STEP_M,
    find_arrivals,
    hidden_arrival,
)
from perception.mapping.contradiction import Contradiction, ContradictionConfig
from perception.mapping.ground_grid import GroundGrid, GroundGridConfig
from perception.mapping.known_objects import KnownObjectConfig, KnownObjects
from perception.mapping.landmarks import (
    LandmarkConfig,
    Landmarks,
    bases_of,
    drop_missed,
    edges_of,
    find_free,
    merge,
)
from perception.mapping.mark_place import MarkPlace, MarkPlaceConfig
from perception.mapping.movers import LIFE_S, MoverTracker
from perception.mapping.objects import find_objects
from perception.mapping.recent import RecentLayer, RecentLayerConfig
from perception.mapping.registration import Registration, RegistrationConfig
from perception.mapping.view import View, ViewConfig
from uav_bt.lab.classes import LabClasses
from uav_bt.types import CameraModel, ClassMap, Frame, MarkFix, Pose2D
from uav_bt.types.arrays import Floats
from uav_bt.types.dead_reckoning import MotionEstimate
from uav_bt.types.site_map import MapObject, SiteMap


@dataclass(frozen=True, kw_only=True)
class SiteMapperConfig:
    """How the map is kept."""

    # The odometry counts as telemetry alone when it has followed no ground for longer. Chosen.
    tracked_s: float = 0.6
    displaced_m: float = 0.03  # a view with a larger residual adds no points. Chosen.
    lost_m: float = 0.05  # in a view with a larger residual no movers are searched. Chosen.
    # Below this height nothing is judged to move, because the error of the height makes standing
    # obstacles slide; nothing that has arrived is judged to stand, either. Chosen.
    low_m: float = 1.2
    settled_s: float = 1.0  # points known for this long correct the drone's pose. Chosen.
    # Number of views in the mean of the residual. Chosen.
    residual_views: int = 200
    objects_s: float = 0.5  # interval between two searches for objects. Chosen.
    view: ViewConfig = field(default_factory=ViewConfig)
    grid: GroundGridConfig = field(default_factory=GroundGridConfig)
    recent: RecentLayerConfig = field(default_factory=RecentLayerConfig)
    landmarks: LandmarkConfig = field(default_factory=LandmarkConfig)
    registration: RegistrationConfig = field(default_factory=RegistrationConfig)
    contradiction: ContradictionConfig = field(default_factory=ContradictionConfig)
    mark: MarkPlaceConfig = field(default_factory=MarkPlaceConfig)
    objects: KnownObjectConfig = field(default_factory=KnownObjectConfig)


class SiteMapper:
    """Makes one map of the views of a mission.

    Args:
        classes: classes of the lab.
        config: how the map is kept.
        mark_m: radius of the landing mark; 0 without one.
    """

    def __init__(
        self,
        classes: LabClasses,
        config: SiteMapperConfig | None = None,
        *,
        mark_m: float = 0.0,
    ) -> None:
        self._classes, self._mark_m = classes, mark_m
        self._on_legs = classes.legs_m > 0.0
        self.config = config or SiteMapperConfig()
        self.restarts = 0  # number of times that the map was restarted
        self._motion: MotionEstimate | None = None
        self._start: Pose2D | None = None  # take-off pose in the dead-reckoned frame
        self._captured_s = -math.inf
        self._recent = RecentLayer(self.config.recent)
        self._known_objects = KnownObjects(self.config.objects)
        self._movers = MoverTracker()
        self._begin()

    def _begin(self, *, agreed_s: float = -math.inf) -> None:
        cfg = self.config
        self._grid = GroundGrid(cfg.grid)
        self._registration = Registration(cfg.registration)
        self._bases, self._edges = Landmarks.none(), Landmarks.none()
        self._mark = MarkPlace(cfg.mark)
        self._contradiction = Contradiction(cfg.contradiction, agreed_s=agreed_s)
        self._objects: tuple[MapObject, ...] = ()
        self._objects_s = -math.inf
        self._residual_m, self._matched = 0.0, 0

    def view(
        self, class_map: ClassMap, frame: Frame, camera: CameraModel, pose: Pose2D
    ) -> View | None:
        """Return the view of a frame, for `add`; None when the camera looks too far down.

        Args:
            class_map: class map of `frame`.
            frame: its gimbal pitch and height place its points.
            camera: intrinsics at the class map's size.
            pose: dead-reckoned pose of the body at the frame's capture.
        """
        return View.of(class_map, frame, camera, pose, self.config.view)

    def follow(self, motion: MotionEstimate) -> None:
        """Update the drone's motion; call it before each view with the motion up to it."""
        tracked = motion.untracked_s <= self.config.tracked_s
        self._registration.predict(motion.pose, motion.pose.time_s, tracked=tracked)
        self._motion = motion
        if self._start is None:
            begin = motion.pose
            self._start = Pose2D(x_m=begin.x_m, y_m=begin.y_m, yaw_rad=begin.yaw_rad)
        here = self._registration.corrected(motion.pose)
        self._grid.fly_over(here.x_m, here.y_m)
        self._recent.expire(motion.pose.time_s)

    def restart(self) -> None:
        """Begin the map anew; objects keep their numbers."""
        self.restarts += 1
        self._known_objects.restart(self._registration.correction)
        self._begin(agreed_s=self._captured_s)
        self._movers.restart()
        self._recent.forget()  # its points were placed by the abandoned map

    def pass_over(self, captured_s: float) -> None:
        """Record a frame in which nothing can be placed."""
        self._recent.pass_over(captured_s)

    def add(self, view: View) -> None:
        """Add a view, whose pose is dead-reckoned."""
        cfg, time_s = self.config, view.captured_s
        self._captured_s = time_s
        view = self._without_mark(view)
        self._recent.add(view)
        off_m = self._registration.match(view, *self._settled(time_s))
        if off_m is not None:
            self._matched = min(self._matched + 1, cfg.residual_views)
            self._residual_m += (off_m - self._residual_m) / self._matched
        placed = view.at(self._registration.corrected(view.pose))
        self._drop_missed(placed)
        if self._contradiction.is_certain(time_s):
            self.restart()
            return
        self._add_points(placed, 0.0 if off_m is None else off_m)
        if off_m is None or off_m <= cfg.lost_m:
            self._meet_hidden(placed)
        self._grid.add(placed)
        self._grid.note_moving(self._movers.may_move_m(time_s), time_s)
        self._movers.forget_free(self._grid.shown_at(self._movers.places_m(), time_s), time_s)
        # Bases of a mover are kept for as long as the map keeps the mover.
        self._recent.forget_trails(time_s + LIFE_S, self._trails_m())
        if time_s - self._objects_s >= cfg.objects_s:
            self._objects = self._known_objects.named(
                find_objects(self._bases, self._classes.standing, legs_m=self._classes.legs_m)
            )
            self._objects_s = time_s

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
        """Return the map with the drone's present pose.

        Args:
            motion: the newest motion, not earlier than the newest view.
        """
        grid, window = self._grid, self._grid.window()
        return SiteMap(
            classes=self._classes,
            pose=self._registration.corrected(motion.pose),
            corner_m=grid.corner_m(window),
            cell_m=grid.config.cell_m,
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
            restarts=self.restarts,
            full=grid.full,
            untracked_s=motion.untracked_s,
            start=self._start or self._registration.corrected(motion.pose),
            near=self._recent.near(motion.pose),
        )

    def _obstacles_m(self) -> Floats:
        """Return the bases of obstacles, (N, 2), without those on a tag."""
        xy_m, mark = self._bases.xy_m, self._mark.mark
        if mark is None or mark.yaw_rad is None:
            return xy_m
        beside = np.hypot(*(xy_m - (mark.x_m, mark.y_m)).T) > self._mark_m
        return np.asarray(xy_m[beside])

    def _trails_m(self) -> Floats:
        """Return recent positions of movers in the dead-reckoned frame, and radii, (K, 3)."""
        trails_m = self._movers.trails_m()
        trails_m[:, :2] = self._registration.correction.points_to_body(trails_m[:, :2])
        return trails_m

    def _settled(self, time_s: float) -> tuple[Floats, NDArray[np.uint8]]:
        """Return points known for long enough to correct the drone's pose: (M, 2), and classes."""
        xy_m, ids = [], []
        for known in (self._bases, self._edges):
            settled = time_s - known.first_s >= self.config.settled_s
            xy_m.append(known.xy_m[settled])
            ids.append(known.ids[settled])
        return np.concatenate(xy_m), np.concatenate(ids)

    def _drop_missed(self, view: View) -> None:
        """Count points that a view shows to be ground, and drop those missed too often."""
        cfg, kept, counts = self.config.landmarks, [], np.zeros(2, dtype=int)
        for known in (self._bases, self._edges):
            in_view, free = find_free(known, view, cfg, self._on_legs)
            counts += (in_view.sum(), free.sum())
            kept.append(drop_missed(known, free, cfg))
        self._bases, self._edges = kept
        self._contradiction.add(view.captured_s, int(counts[0]), int(counts[1]))

    def _add_points(self, view: View, off_m: float) -> None:
        """Add standing bases and edges to the map; let the tracker follow arrivals.

        Args:
            view: placed in the map's frame.
            off_m: residual of the view against the map.
        """
        cfg = self.config
        bases, edges = bases_of(view, cfg.landmarks), edges_of(view, cfg.landmarks)
        self._known_objects.see_edges(bases.xy_m, bases.ids, view.base_heights_m)
        if off_m <= cfg.lost_m:
            bases = self._standing_bases(view, bases)
            known = self._bases
            self._bases = known.take(~self._movers.passed_over(known.xy_m, known.first_s))
        adds = off_m <= cfg.displaced_m
        self._bases = merge(self._bases, bases, cfg.landmarks, adds=adds)
        self._edges = merge(self._edges, edges, cfg.landmarks, adds=adds)

    def _meet_hidden(self, view: View) -> None:
        """Add a mover where an obstacle with a hidden base covers ground that was free.

        Args:
            view: placed in the map's frame.
        """
        time_s, hidden_m = view.captured_s, self._recent.unplaced_m
        if not len(hidden_m) or view.height_m < self.config.low_m:
            return
        sides_m = [each.outline_m(STEP_M) for each in self._objects]
        known_m = np.vstack([self._obstacles_m(), *sides_m])
        ahead = hidden_arrival(hidden_m, view.pose, self._grid, known_m)
        if ahead is None:
            return
        place_m = np.array([view.pose.x_m, view.pose.y_m]) + HIDDEN_M * ahead
        if not self._movers.may_be_at(place_m, time_s):
            self._movers.meet(place_m, -HIDDEN_MPS * ahead, time_s)

    def _standing_bases(self, view: View, bases: Landmarks) -> Landmarks:
        """Pass the bases that have arrived to the mover tracker; return those that stand."""
        cfg, time_s = self.config, view.captured_s
        self._movers.predict(time_s)
        on_ground = self._grid.was_ground(bases.xy_m)
        owned = self._movers.owns(bases.xy_m)
        arrived = find_arrivals(bases, self._bases, on_ground, owned)
        # Ground shows around a leg before the leg is near enough for the map.
        arrived &= ~self._on_legs[bases.ids]
        stands = ~arrived
        stands[arrived] = self._movers.follow(
            bases.xy_m[arrived],
            np.array([view.lens.x_m, view.lens.y_m]),
            time_s,
            cut=view.is_cut(arrived)[arrived],
            judges=view.height_m >= cfg.low_m,
        )
        return bases.settled_after(np.where(on_ground, SETTLES_S, 0.0)).take(stands)
