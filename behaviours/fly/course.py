"""Course: a heading and a speed that are held between the answers of a policy."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from behaviours.fly.heading_control import HeadingController
from uav_bt.answers import FollowLeg, Rotate

_LASTS_S: Final = 0.5  # chosen: a course ends after this time without a new answer


@dataclass(frozen=True, kw_only=True)
class _Ordered:
    yaw_rad: float
    speed_mps: float
    since_s: float


class Course:
    """Turns the legs and rotations of a policy into a speed and a yaw rate."""

    def __init__(self) -> None:
        self._heading = HeadingController()
        self._ordered: _Ordered | None = None

    def drop(self) -> None:
        """Drop the course."""
        self._ordered = None
        self._heading.reset()

    def follow(
        self, answer: FollowLeg | Rotate | None, *, yaw_rad: float, now_s: float
    ) -> tuple[float, float] | None:
        """Return the speed, m/s, and the yaw rate, rad/s; None without a course.

        Args:
            answer: The answer to a new view; None without a new view.
            yaw_rad: Heading of the drone.
            now_s: Time of the mission clock.
        """
        if answer is not None:
            speed_mps = answer.speed_mps if isinstance(answer, FollowLeg) else 0.0
            self._ordered = _Ordered(
                yaw_rad=yaw_rad + answer.yaw_rad, speed_mps=speed_mps, since_s=now_s
            )
        if self._ordered is None or now_s - self._ordered.since_s > _LASTS_S:
            self._ordered = None
            return None
        error_rad = math.remainder(self._ordered.yaw_rad - yaw_rad, 2.0 * math.pi)
        return self._ordered.speed_mps, self._heading.update(error_rad, now_s)
