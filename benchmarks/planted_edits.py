"""Twenty defects, each an edit of the product's code, for `benchmarks/planted_defects.py`.

Ten of them were in the code once: each is the code before the commit that is named,
transferred to today's code. The list was chosen before any of them was flown.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from uav_bt.errors import FileError
from uav_bt.files import write_whole


@dataclass(frozen=True, kw_only=True)
class Defect:
    """An edit that plants one defect.

    Attributes:
        name: Name of the defect and of its folder.
        file: File that is edited, from the repository's root.
        sound: Text of the file without the defect; it occurs once.
        planted: Text that replaces it.
        wrong: The mistake, one sentence.
        fixed_in: Short hash of the commit that once fixed it; None: the defect is invented.
    """

    name: str
    file: str
    sound: str
    planted: str
    wrong: str
    fixed_in: str | None = None

    def edited(self, text: str) -> str:
        """Return a file's text with the defect.

        Raises:
            FileError: The text without the defect does not occur exactly once.
        """
        count = text.count(self.sound)
        if count != 1:
            raise FileError(
                self.file,
                f"defect '{self.name}' expects its text once and finds it {count} times; follow "
                "the change of the code in benchmarks/planted_edits.py",
            )
        return text.replace(self.sound, self.planted)

    def plant(self, root: Path) -> None:
        """Edit the file below a folder.

        Raises:
            FileError: The text without the defect does not occur exactly once.
        """
        path = root / self.file
        write_whole(path, self.edited(path.read_text(encoding="utf-8")))


DEFECTS: Final = (
    # --- safety layer and runner ------------------------------------------------------------------
    Defect(
        name="no-landing-after-exception",
        file="uav_bt/mission/runner.py",
        sound="                self._stop_and_land(str(fault) or type(fault).__name__)\n",
        planted="                self._flown.tree.halt()\n",
        wrong="An exception in a leaf or in the drone stops the tree and leaves the drone in the "
        "air.",
    ),
    Defect(
        name="old-frame-stops-landing",
        file="uav_bt/mission/safety.py",
        sound="        gimbal_too=True,\n        spares_landing=True,\n",
        planted="        gimbal_too=True,\n",
        wrong="An old frame makes a landing drone hover.",
        fixed_in="92483c95",
    ),
    Defect(
        name="frozen-image-trusted",
        file="perception/camera/frame_watch.py",
        sound="return self._blank(grey) or frozen",
        planted="return self._blank(grey)",
        wrong="A frozen image with fresh timestamps is flown by.",
        fixed_in="8e4b9716",
    ),
    Defect(
        name="drift-doubled",
        file="uav_bt/mission/position_hold.py",
        sound="return add(pull, -1.0, self._disturbance(motion))",
        planted="return add(pull, 1.0, self._disturbance(motion))",
        wrong="The learned disturbance is added to the order with the wrong sign.",
    ),
    Defect(
        name="place-misses-leap",
        file="uav_bt/mission/position_hold.py",
        sound="leapt = self._follow_leap((motion.pose.x_m, motion.pose.y_m), passed_s)",
        planted="leapt = False",
        wrong="The held place does not follow a leap of dead reckoning, and the leap is learned as "
        "a disturbance.",
        fixed_in="2eda2215",
    ),
    Defect(
        name="blind-limit-in-ms",
        file="uav_bt/mission/limits.py",
        sound="    blind_s: float = 15.0\n",
        planted="    blind_s: float = 15_000.0\n",
        wrong="The longest time without a usable frame is given in milliseconds and read as "
        "seconds, so that the drone hovers blind to the time limit.",
    ),
    # --- leaves -----------------------------------------------------------------------------------
    Defect(
        name="old-view-steers",
        file="behaviours/fly/steering.py",
        sound="return None if view is None or view[0].captured_s < self._view_from_s else view",
        planted="return None if view is None or self.clock.now() < self._view_from_s else view",
        wrong="The age check of a view compares the present time, so that a step is decided on a "
        "frame from before the last movement ended.",
    ),
    Defect(
        name="land-steps-back",
        file="behaviours/fly/land.py",
        sound="self.start_move(forward_m=forward_m, right_m=right_m)",
        planted="self.start_move(forward_m=-forward_m, right_m=right_m)",
        wrong="The step from the camera's place to the body's place above the mark goes backward.",
    ),
    Defect(
        name="step-away-over-edge",
        file="behaviours/fly/keeping_away.py",
        sound="    if (np.linalg.norm(obstacles.edges_m - (forward_m, right_m), axis=1) < edge_m)"
        ".any():\n        return None\n",
        planted="",
        wrong="A step away from an obstacle may lead to the edge of the ground and beyond.",
        fixed_in="7426b9a8",
    ),
    Defect(
        name="turn-counted-ahead",
        file="behaviours/fly/steering.py",
        sound="yaw_rad, held = state.attitude.yaw_rad, self.held_turn",
        planted="yaw_rad, held = self.yaw_rad(state), self.held_turn",
        wrong="A turn is counted by the extrapolated heading, and ends early.",
        fixed_in="9fcb11bf",
    ),
    Defect(
        name="retry-never-ends",
        file="behaviours/fly/step.py",
        sound="            self._attempt(left, now_s)\n",
        planted="            self._begin_count()\n            self._attempt(left, now_s)\n",
        wrong="Each attempt at a movement restarts the count of attempts, so that the retries "
        "never end.",
    ),
    # --- planner ----------------------------------------------------------------------------------
    Defect(
        name="way-out-without-reaction",
        file="behaviours/path/ways_out.py",
        sound="stops_m = speeds_mps * config.reaction_s + speeds_mps**2 / "
        "(2.0 * config.brake_mps2)",
        planted="stops_m = speeds_mps**2 / (2.0 * config.brake_mps2)",
        wrong="The stopping distance of a way out leaves out the drone's reaction time.",
        fixed_in="86bfd879",
    ),
    Defect(
        name="residual-not-kept",
        file="behaviours/path/clearance.py",
        sound="self.margins = margins = (margins or Margins()).by(site_map.residual_m)",
        planted="self.margins = margins = margins or Margins()",
        wrong="Routes do not keep the additional margin of a map that the views do not fit.",
        fixed_in="da1d9755",
    ),
    Defect(
        name="anything-is-mapped",
        file="behaviours/path/following.py",
        sound="there = np.abs(ahead_m - corridor.free_distance_m) < config.same_m",
        planted="there = (ahead_m > 0.0) & (ahead_m < corridor.free_distance_m + config.same_m)",
        wrong="Any nearer obstacle of the map explains a blocked corridor, and the drone flies on.",
        fixed_in="52b9374f",
    ),
    Defect(
        name="recent-edges-ignored",
        file="behaviours/path/distances.py",
        sound="ends = self.marked(np.vstack([self._map.edges_m, self._recent.edges_m]))",
        planted="ends = self.marked(self._map.edges_m)",
        wrong="Routes keep no distance from edges of the ground that were seen recently and are "
        "not on the map.",
        fixed_in="ba3511da",
    ),
    # --- map and odometry -------------------------------------------------------------------------
    Defect(
        name="mover-never-dropped",
        file="perception/mapping/mover_track.py",
        sound="life_s: float = 6.0  # a mover is forgotten after this time unseen",
        planted="life_s: float = 6000.0  # a mover is forgotten after this time unseen",
        wrong="The life of an unseen mover's track is given in milliseconds and read as seconds, "
        "so that the track is never dropped.",
    ),
    Defect(
        name="drift-correction-unused",
        file="perception/mapping/site_mapper.py",
        sound="placed = view.at(self._registration.corrected(view.pose))",
        planted="placed = view",
        wrong="Views enter the map without the drift correction that matching has found.",
    ),
    Defect(
        name="heading-uncorrected",
        file="perception/odometry/ground.py",
        sound="        turn_rad = self._heading.correction_rad\n        x_m, y_m = rotate(",
        planted="        turn_rad = 0.0\n        x_m, y_m = rotate(",
        wrong="The pose between two frames takes telemetry's heading without the correction by the "
        "ground.",
        fixed_in="431dd84b",
    ),
    # --- depth and corridor -----------------------------------------------------------------------
    Defect(
        name="unknown-depth-is-free",
        file="perception/depth/corridor.py",
        sound="free_m = 0.0 if unseen > config.stray_px else _nearest_m(ahead_m, config.stray_px)",
        planted="free_m = _nearest_m(ahead_m, config.stray_px)",
        wrong="An obstacle of unknown depth inside the corridor does not shorten the free "
        "distance.",
    ),
    Defect(
        name="edge-margin-unused",
        file="behaviours/policies/corridor_rule.py",
        sound="by_ground_m = reach_m - cfg.edge_margin_m + relief_m",
        planted="by_ground_m = reach_m + relief_m",
        wrong="A step of the corridor rule keeps no margin from the end of the ground.",
    ),
)
