"""One flight in a bad room: outcome, contacts, and the errors of its depth."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from perception.camera.ground_plane import GroundPlane, view_of
from perception.depth.evidence import evidence, scale_confidence
from perception.depth.scale import sample_ground
from uav_bt import app
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, METRIC_DEPTH, ODOMETRY, RELATIVE_DEPTH, STATE
from uav_bt.board.context import MissionContext
from uav_bt.mission.judge import JudgeConfig
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Drone
from uav_bt.types.arrays import Floats32

TRUSTED: Final = 0.5  # least confidence of a trusted depth
WRONG: Final = math.log(1.2)
GROUND: Final = 0.2  # least share of an image that shows ground, as in `SensesAgree`
_NEAR_M: Final = 6.0  # depth beyond is not compared
_FLYING_M: Final = 0.8  # lower than this it takes off or lands
_HULL_M: Final = 0.15  # half of the body's length
_FRESH_S: Final = 0.5


@dataclass(frozen=True, kw_only=True)
class BadFlight:
    """A flight to fly.

    Attributes:
        case: Name of the bad room.
        seed: Of everything random.
        tree: The mission.
        lab: Folder of the lab.
        scene: File of the scene.
        camera: Camera file; None for the drone's own intrinsics.
        faults: Of the drone.
        mirror_x_m: World x of a mirror across the room; None without one.
        ports: Values by NODE.PORT, in place of those of the tree.
    """

    case: str
    seed: int
    tree: str
    lab: Path
    scene: Path
    camera: Path | None
    faults: tuple[str, ...]
    mirror_x_m: float | None
    ports: dict[str, str]


class Watch:
    """Notes contacts, and compares depth with the truth.

    Args:
        mirror_x_m: World x of a mirror, whose far side counts as a contact.
    """

    def __init__(self, mirror_x_m: float | None) -> None:
        self._mirror_x_m = mirror_x_m
        self._drone: Drone | None = None
        self._mission: MissionContext | None = None
        self._last = -1
        self._rules = JudgeConfig()
        self.contacts: dict[str, float] = {}  # first time of each, s
        self.frames: list[dict[str, float]] = []

    def follow(self, flight: app.Flight[Drone]) -> Sequence[Watch]:
        """Become a listener of a flight."""
        self._drone, self._mission = flight.drone, flight.context
        return (self,)

    def on_tick(self, record: TickRecord) -> None:
        """Note contacts, and compare the depth of a new frame."""
        truth = record.truth
        if truth is None or self._drone is None or self._drone.referee is None:
            return
        for name in truth.contacts:
            if not self._rules.is_landing_surface(name):
                self.contacts.setdefault(name, record.time_s)
        mirror_x_m = self._mirror_x_m
        if mirror_x_m is not None and truth.pose.x_m > mirror_x_m - _HULL_M:
            self.contacts.setdefault("mirror", record.time_s)
        if truth.pose.z_m > _FLYING_M:
            self._compare(record.time_s)

    def _compare(self, time_s: float) -> None:
        if self._mission is None or self._drone is None or self._drone.referee is None:
            return
        board = self._mission.board
        frame, camera = board.read(FRAME).value, board.read(CAMERA).value
        class_map = board.read(CLASS_MAP).value
        motion, state = board.read(ODOMETRY).value, board.read(STATE).value
        if frame is None or camera is None or class_map is None or frame.index == self._last:
            return
        self._last = frame.index
        found: dict[str, float] = {"time_s": time_s, "height_m": frame.height_above_ground_m}
        depth, relative = board.read(METRIC_DEPTH).value, board.read(RELATIVE_DEPTH).value
        if depth is not None and depth.captured_s == frame.captured_s:
            height_px, width_px = depth.depth.shape
            true = self._drone.referee.depth(frame, width_px, height_px)
            found["confidence"] = depth.confidence
            found["off"] = _off(depth.depth, true)
        if relative is not None and relative.captured_s == frame.captured_s:
            height_px, width_px = class_map.ids.shape
            view = view_of(frame, camera, (width_px, height_px))
            ground = GroundPlane.of(view)
            resized = cv2.resize(relative.depth, (width_px, height_px))
            sample = sample_ground(
                resized, class_map.is_ground, ground.depth_m, np.random.default_rng(0)
            )
            if sample is not None:
                measures = evidence(sample.measures, None, view.height_m)
                found["now"] = scale_confidence(measures).value or 0.0
                found["scale"] = sample.measures.log_scale - math.log(view.height_m)
                found["share"] = sample.measures.share
                found |= {name: each.value or 0.0 for name, each in measures.items()}
        if motion is not None and motion.ground_share is not None:
            found["ground"] = motion.ground_share
            found["followed"] = float(motion.tracked_s == motion.seen.time_s)
        if motion is not None and state is not None and motion.untracked_s < _FRESH_S:
            found["ground_f"] = motion.velocity.forward_mps
            found["ground_r"] = motion.velocity.right_mps
            found["reported_f"] = motion.velocity.forward_mps - motion.error.forward_mps
            found["reported_r"] = motion.velocity.right_mps - motion.error.right_mps
        self.frames.append(found)


def share_of(frames: Sequence[Mapping[str, float]], *, trusted: bool) -> float | None:
    """Return the share of frames whose depth is trusted and wrong, or is not trusted.

    Args:
        frames: The comparison of each frame.
        trusted: Which share; the whole are the frames with depth.
    """
    known = [each for each in frames if "confidence" in each]
    if not known:
        return None
    sure = [each["confidence"] > TRUSTED for each in known]
    wrong = [abs(each["off"]) > WRONG for each in known]
    counted = [a and b for a, b in zip(sure, wrong, strict=True)] if trusted else sure
    share = sum(counted) / len(known)
    return share if trusted else 1.0 - share


def followed_share(frames: Sequence[Mapping[str, float]]) -> float | None:
    """Return the share of frames with ground whose motion was measured on it; None without any.

    Args:
        frames: Comparisons, one a frame.
    """
    known = [each["followed"] for each in frames if each.get("ground", 0.0) >= GROUND]
    return sum(known) / len(known) if known else None


def _off(depth: Floats32, true: Floats32) -> float:
    """Return the logarithm of the median ratio of depth to the exact one; 0 without any."""
    near = np.isfinite(depth) & (depth > 0.0) & (true > 0.0) & (true < _NEAR_M)
    if not near.any():
        return 0.0
    return float(np.median(np.log(depth[near] / true[near])))


def fly(flight: BadFlight, size_px: tuple[int, int], frames: Path) -> dict[str, Any]:
    """Fly and return the line of a flight.

    Args:
        flight: What to fly.
        size_px: Width and height of the images.
        frames: Folder for the comparison of each frame, as JSON lines.
    """
    watch = Watch(flight.mirror_x_m)
    options = app.FlightOptions(
        lab=flight.lab,
        scene=str(flight.scene),
        seed=flight.seed,
        camera=flight.camera,
        faults=flight.faults,
        ports=flight.ports,
        image_size_px=size_px,
    )
    report = app.fly(flight.tree, options, listeners=[watch.follow])
    frames.mkdir(parents=True, exist_ok=True)
    name = f"{flight.lab.name}-{flight.seed}-{Path(flight.tree).stem}.jsonl"
    lines = "".join(json.dumps(each) + "\n" for each in watch.frames)
    (frames / name).write_text(lines, encoding="utf-8")
    return {
        "case": flight.case,
        "seed": flight.seed,
        "tree": flight.tree,
        "outcome": report.outcome,
        "reason": report.reason,
        "contacts": {key: round(value, 1) for key, value in watch.contacts.items()},
        "duration_s": report.duration_s,
        "covered": report.coverage_passed,
        "drift_m": report.map_drift_m,
        "clearance_m": report.min_clearance_m,
        "trusted_wrong": share_of(watch.frames, trusted=True),
        "doubted": share_of(watch.frames, trusted=False),
        "followed": followed_share(watch.frames),
        "warnings": report.warnings,
        "events": [f"{each.time_s:.0f} {each.kind.value} {each.text}" for each in report.events],
    }
