"""From class maps to the helipad's position: detection, placement and tracking, frame by frame."""

from __future__ import annotations

import math

from perception.landing.detector import HelipadDetection, HelipadDetector, locate
from perception.landing.tracker import HelipadTracker
from uav_bt.types import PAD_HEIGHT_M, CameraModel, ClassMap, DroneState, Frame, HelipadFix


class HelipadFinder:
    """Finds the helipad in class maps and carries it through misses by dead reckoning.

    Args:
        pad_height_m: top of the helipad above the carpet.
    """

    def __init__(self, *, pad_height_m: float = PAD_HEIGHT_M) -> None:
        self._pad_height_m = pad_height_m
        self._detector, self._tracker = HelipadDetector(), HelipadTracker()
        self._reckons = False  # whether there was any telemetry to carry it by
        self._seen: HelipadFix | None = None  # in the newest class map
        self._accepted = False  # whether the track took that in

    def predict(self, state: DroneState) -> None:
        """Follow the drone's own motion up to a telemetry sample."""
        self._reckons = True
        self._tracker.predict(state)

    def miss(self) -> None:
        """Note that there is no class map to look at."""
        self._seen, self._accepted = None, False

    def see(
        self, class_map: ClassMap, frame: Frame, camera: CameraModel
    ) -> HelipadDetection | None:
        """Take in a class map and return what was detected in it.

        Args:
            class_map: made from `frame`.
            frame: its telemetry places what is seen.
            camera: intrinsics at any size of the same aspect.
        """
        self.miss()
        detection = self._detector.detect(class_map)
        if detection is None or not math.isfinite(
            frame.height_above_carpet_m + frame.gimbal_pitch_rad
        ):
            return detection
        height_px, width_px = class_map.ids.shape
        place = locate(
            detection,
            camera.resized(width_px, height_px),
            frame.gimbal_pitch_rad,
            frame.height_above_carpet_m - self._pad_height_m,
        )
        if place is not None:
            self._seen = HelipadFix(
                captured_s=frame.captured_s,
                forward_m=place[0],
                right_m=place[1],
                detected=True,
                confidence=detection.score,
            )
            self._accepted = self._tracker.update(
                *place, captured_s=frame.captured_s, confidence=detection.score
            )
        return detection

    def fix(self) -> HelipadFix | None:
        """Return where the helipad is from the drone now; without telemetry only while seen."""
        return self._tracker.fix(detected=self._accepted) if self._reckons else self._seen
