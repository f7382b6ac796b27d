"""The landing mark as missions use it: seen in a frame, or carried on by dead reckoning."""

from __future__ import annotations

from perception.marks.tracker import MarkTracker
from uav_bt.landing_marks import MarkSighting
from uav_bt.types import DroneState, MarkFix
from uav_bt.types.dead_reckoning import OdometryPose


class TrackedMark:
    """Tracks the sightings of any finder through frames without one."""

    def __init__(self) -> None:
        self._tracker = MarkTracker()
        self._reckons = False  # whether any telemetry has come
        self._seen: MarkFix | None = None  # the sighting in the newest frame
        self._accepted = False  # whether the track accepted that sighting

    def predict(self, state: DroneState, now_s: float | None = None) -> None:
        """Integrate the drone's motion.

        Args:
            state: Telemetry.
            now_s: Time to which the newest pose is extrapolated, s; None for telemetry's newest
                time.
        """
        self._reckons = True
        self._tracker.predict(state, now_s)

    def pose_at(self, time_s: float) -> OdometryPose | None:
        """Return the drone's dead-reckoned pose; None before any telemetry.

        Args:
            time_s: A time in the last seconds; `math.inf` for the newest pose.
        """
        return self._tracker.pose_at(time_s)

    def forget(self) -> None:
        """Drop the track; the odometry goes on."""
        self._tracker.forget()
        self._seen, self._accepted = None, False

    def see(self, sighting: MarkSighting | None, captured_s: float) -> None:
        """Update the track with the newest frame.

        Args:
            sighting: The mark in that frame; None if the frame does not show it.
            captured_s: Capture time of that frame.
        """
        self._seen, self._accepted = None, False
        if sighting is None:
            return
        self._seen = MarkFix(
            captured_s=captured_s,
            forward_m=sighting.forward_m,
            right_m=sighting.right_m,
            height_m=sighting.height_m,
            detected=True,
            confidence=sighting.confidence,
            heading_deg=sighting.heading_deg,
        )
        self._accepted = self._tracker.update(sighting, captured_s=captured_s)

    def fix(self) -> MarkFix | None:
        """Return the mark relative to the drone; without telemetry only while it is seen."""
        if not self._reckons:
            return self._seen
        return self._tracker.fix(detected=self._accepted)
