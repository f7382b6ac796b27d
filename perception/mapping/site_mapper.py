"""Keep the map of the place: every view is matched to it, corrects the drone's place, and adds."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from perception.mapping.arrivals import ArrivalConfig, is_cut, standing
from perception.mapping.ground_grid import GroundGrid, GroundGridConfig
from perception.mapping.landmarks import (
    LandmarkConfig,
    Landmarks,
    Sighting,
    merged,
    seen_points,
    shown_free,
    sighting,
    without_missed,
)
from perception.mapping.mover_track import MoverConfig
from perception.mapping.movers import MoverTracker
from perception.mapping.objects import objects_of
from perception.mapping.registration import (
    Points,
    Registration,
    RegistrationConfig,
)
from perception.obstacles.contact_scan import GroundScan, find_bases
from uav_bt.classes import BACKGROUND
from uav_bt.errors import MissionError
from uav_bt.types import CameraModel, Frame, HelipadFix, Pose2D
from uav_bt.types.dead_reckoning import MotionEstimate
from uav_bt.types.site_map import MapMark, MapObject, SiteMap

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class SiteMapperConfig:
    """How the map is kept."""

    tracked_s: float = 0.6  # without ground followed for longer, telemetry alone is flown by
    displaced_m: float = 0.03  # a view further off the map adds nothing to it
    lost_m: float = 0.05  # and in one still further off, nothing that moves is followed
    # From further down nothing is seen to move: its height's error lets what stands slide.
    low_m: float = 1.2
    settled_s: float = 1.0  # points known for so long correct the drone's place
    residual_views: int = 200  # of so many views is the mean of how far they are off the map
    objects_s: float = 0.5  # objects are made of points so often
    mark_std_m: float = 0.03  # of a sighting of the landing mark close by,
    mark_std_ratio: float = 0.05  # of its range besides,
    mark_doubt_m: float = 0.3  # and, in proportion, of what its confidence lacks of 1
    # So many sightings elsewhere in a row move the mark: as far as the map may have drifted, or
    # further once ground was seen where it was. What is sighted far from a mark that still stands
    # is a mask's error.
    mark_moved_views: int = 10
    mark_drift_m: float = 0.7
    # Views contradict the map when they show nothing but ground at more than this share of its
    # points that lie in them (heavy drift: a quarter); for so long, and the map begins anew.
    contradiction: float = 0.4
    judged_s: float = 3.0  # views so long ago count a third
    judged_points: float = 80.0  # fewer points in all those views say nothing
    restart_s: float = 2.0
    gap_s: float = 0.5  # between views; what is longer counts neither for nor against the map
    grid: GroundGridConfig = field(default_factory=GroundGridConfig)
    arrivals: ArrivalConfig = field(default_factory=ArrivalConfig)
    movers: MoverConfig = field(default_factory=MoverConfig)
    landmarks: LandmarkConfig = field(default_factory=LandmarkConfig)
    registration: RegistrationConfig = field(default_factory=RegistrationConfig)


class SiteMapper:
    """Makes one map of the views of a mission."""

    def __init__(self, config: SiteMapperConfig | None = None) -> None:
        self.config = config or SiteMapperConfig()
        self.restarts = 0  # how often the map was begun anew
        self._motion: MotionEstimate | None = None
        self._begin()

    def _begin(self) -> None:
        cfg = self.config
        self._grid = GroundGrid(cfg.grid)
        self._registration = Registration(cfg.registration)
        self._bases, self._edges = Landmarks.none(), Landmarks.none()
        self._movers = MoverTracker(cfg.movers)
        self._mark: MapMark | None = None
        self._mark_elsewhere = 0  # sightings in a row that were not where it is
        self._objects: tuple[MapObject, ...] = ()
        self._objects_s = self._captured_s = self._agreed_s = self._judged_s = -math.inf
        self._residual_m, self._matched = 0.0, 0
        self._judged = np.zeros(2)  # points of the map that lay in views, and were not there

    def follow(self, motion: MotionEstimate) -> None:
        """Follow the drone."""
        tracked = motion.untracked_s <= self.config.tracked_s
        self._registration.predict(motion.pose, motion.pose.time_s, tracked=tracked)
        self._motion = motion
        here = self._registration.corrected(motion.pose)
        self._grid.fly_over(here.x_m, here.y_m)

    def see(
        self,
        scan: GroundScan,
        frame: Frame,
        camera: CameraModel,
    ) -> None:
        """Take in the view that the odometry saw last.

        Args:
            scan: of its class map.
            frame: that it was made from.
            camera: intrinsics at that size.
        """
        cfg, time_s = self.config, frame.captured_s
        self._captured_s = time_s
        if self._motion is None:
            return
        reckoned = self._motion.seen
        if frame.gimbal_pitch_rad < cfg.landmarks.min_pitch_rad:
            return
        seen = sighting(find_bases(scan), frame.height_above_carpet_m, cfg.landmarks)
        off_m = self._match(seen, camera, reckoned, time_s)
        if off_m is not None:
            self._matched = min(self._matched + 1, cfg.residual_views)
            self._residual_m += (off_m - self._residual_m) / self._matched
        here = self._registration.corrected(reckoned)
        x_m, y_m = here.to_world(camera.forward_offset_m, 0.0)
        lens = replace(here, x_m=x_m, y_m=y_m)
        if self._contradicts(scan, lens, frame, camera):
            self.restarts += 1
            self._begin()
            self._captured_s = self._agreed_s = time_s
            return
        cut = is_cut(seen.bases_m, frame, camera)
        off_m = 0.0 if off_m is None else off_m
        is_low = frame.height_above_carpet_m < cfg.low_m
        self._add(seen, lens, time_s, cut=cut, off_m=off_m, is_low=is_low)
        self._grid.see(scan, lens, time_s)
        self._grid.note_moving(self._movers.may_move_m(time_s), time_s)
        self._movers.see_free(self._grid.shown_at(self._movers.places_m(), time_s), time_s)
        if time_s - self._objects_s >= cfg.objects_s:
            self._objects, self._objects_s = objects_of(self._bases), time_s

    def see_mark(self, fix: HelipadFix) -> None:
        """Take in a sighting of the landing mark, given from where the drone is now."""
        cfg = self.config
        if self._motion is None:
            return
        reckoned = self._motion.pose
        std_m = math.hypot(
            cfg.mark_std_m,
            cfg.mark_std_ratio * fix.range_m,
            cfg.mark_doubt_m * (1.0 - fix.confidence),
        )
        place = np.array(reckoned.to_world(fix.forward_m, fix.right_m))
        x_m, y_m = self._registration.correction.to_world(*map(float, place))
        known = self._mark
        if self._grid.is_beyond_edge(x_m, y_m):
            return
        moved_m = 0.0 if known is None else known.moved_m
        if known is not None:
            known_m = np.array([known.x_m, known.y_m])
            both_m = math.hypot(std_m, known.std_m)
            agrees = self._registration.see_mark(place, known_m, both_m)
            self._mark_elsewhere = 0 if agrees else self._mark_elsewhere + 1
            x_m, y_m = self._registration.correction.to_world(*map(float, place))
            apart_m = math.hypot(x_m - known.x_m, y_m - known.y_m)
            gone = apart_m <= cfg.mark_drift_m or self._grid.shows_ground(
                known.x_m, known.y_m, since_s=known.seen_s
            )
            if self._mark_elsewhere >= cfg.mark_moved_views and gone:
                moved_m += apart_m
                known, self._mark_elsewhere = None, 0
            elif not agrees:
                return
        if known is None or std_m < known.std_m:
            self._mark = MapMark(
                x_m=x_m, y_m=y_m, std_m=std_m, seen_s=fix.captured_s, moved_m=moved_m
            )
        else:
            self._mark = replace(known, seen_s=fix.captured_s)

    def trails_m(self) -> Floats:
        """Return where movers were lately, in the dead-reckoned frame, and their radius, (K, 3)."""
        trails_m = self._movers.trails_m()
        trails_m[:, :2] = self._registration.correction.points_to_body(trails_m[:, :2])
        return trails_m

    def map(self) -> SiteMap:
        """Return the map as it is known now.

        Raises:
            MissionError: the drone was not followed yet.
        """
        if self._motion is None:
            raise MissionError("a map begins with the drone's motion: call follow first")
        grid, window = self._grid, self._grid.window()
        return SiteMap(
            pose=self._registration.corrected(self._motion.pose),
            corner_m=grid.corner_m(window),
            cell_m=grid.config.cell_m,
            seen_s=grid.seen_s[window].copy(),
            free=grid.free[window].copy(),
            outside=grid.outside(window),
            passed=grid.passed[window].copy(),
            obstacles_m=self._bases.xy_m,
            edges_m=self._edges.xy_m,
            captured_s=self._captured_s,
            movers=self._movers.movers(max(self._motion.pose.time_s, self._captured_s)),
            lanes_m=grid.lanes_m(self._captured_s),
            objects=self._objects,
            mark=self._mark,
            correction=self._registration.correction,
            residual_m=self._residual_m,
            contradicted_s=self._contradicted_s,
            restarts=self.restarts,
            full=grid.full,
            untracked_s=self._motion.untracked_s,
        )

    @property
    def _contradicted_s(self) -> float:
        return max(0.0, self._captured_s - self._agreed_s) if self._agreed_s > -math.inf else 0.0

    def _match(
        self, seen: Sighting, camera: CameraModel, reckoned: Pose2D, time_s: float
    ) -> float | None:
        """Match a view to the map; return how far it is off it, None where it says nothing."""
        local_m = np.vstack([seen.bases_m, seen.edges_m])
        places_m = reckoned.points_to_world(local_m + np.array([camera.forward_offset_m, 0.0]))
        known = self._bases.with_rows(self._edges)
        known = known.take(time_s - known.first_s >= self.config.settled_s)
        return self._registration.match(
            Points(places_m, np.concatenate([seen.ids, _edge_ids(seen)])),
            np.hypot(*local_m.T),
            Points(known.xy_m, known.ids),
        )

    def _contradicts(
        self, scan: GroundScan, lens: Pose2D, frame: Frame, camera: CameraModel
    ) -> bool:
        """Take from the map what a view shows not to be there; return whether it is too much."""
        cfg, time_s = self.config, frame.captured_s
        unseen_s = time_s - self._judged_s
        self._judged *= math.exp(-unseen_s / cfg.judged_s)
        self._judged_s = time_s
        if cfg.gap_s < unseen_s < math.inf:
            self._agreed_s += unseen_s
        kept: list[Landmarks] = []
        for known in (self._bases, self._edges):
            in_view, free = shown_free(
                known, scan.image_groups, lens, frame, camera, config=cfg.landmarks
            )
            self._judged += (in_view.sum(), (in_view & free).sum())
            kept.append(without_missed(known, in_view & free, cfg.landmarks))
        self._bases, self._edges = kept
        in_all, gone = self._judged
        if in_all < cfg.judged_points or gone <= cfg.contradiction * in_all:
            self._agreed_s = time_s
        return self._contradicted_s > cfg.restart_s

    def _add(
        self,
        seen: Sighting,
        lens: Pose2D,
        time_s: float,
        *,
        cut: NDArray[np.bool_],
        off_m: float,
        is_low: bool,
    ) -> None:
        cfg = self.config
        adds = off_m <= cfg.displaced_m
        bases = seen_points(seen.bases_m, seen.ids, lens, time_s)
        if off_m <= cfg.lost_m:
            bases = standing(
                bases,
                self._bases,
                self._grid,
                self._movers,
                cut=cut,
                is_low=is_low,
                config=cfg.arrivals,
            )
            known = self._bases
            self._bases = known.take(~self._movers.passed_over(known.xy_m, known.first_s))
        self._bases = merged(self._bases, bases, cfg.landmarks, adds=adds)
        edges = seen_points(seen.edges_m, _edge_ids(seen), lens, time_s)
        self._edges = merged(self._edges, edges, cfg.landmarks, adds=adds)


def _edge_ids(seen: Sighting) -> NDArray[np.uint8]:
    return np.full(len(seen.edges_m), BACKGROUND, dtype=np.uint8)
