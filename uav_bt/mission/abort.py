"""The early end of a mission: its reason, and whether to wait for the landing."""

from __future__ import annotations

from uav_bt.mission.judge import Outcome, Verdict
from uav_bt.mission.lasting import Lasting


class Abort:
    """The one place for every reason to end a mission early.

    Operator, contingencies and a tree that ends in the air request the abort here. Every
    method except `follow` may be called from a signal handler or another thread.

    Args:
        grace_s: longest wait for the landing, seconds.
    """

    def __init__(self, grace_s: float) -> None:
        self._grace_s = grace_s
        self._landing = Lasting()
        self.reason: str | None = None  # None: not aborted
        self.cut = False  # stop the motors
        self.given_up = False  # do not wait for the landing

    def __bool__(self) -> bool:
        """Return whether the mission is being aborted."""
        return self.reason is not None

    def request(self, reason: str) -> None:
        """Request a landing with the next tick; the first reason counts."""
        if self.reason is None:
            self.reason = reason

    def cut_motors(self, reason: str) -> None:
        """Stop the motors with the next tick."""
        self.cut = True
        self.request(reason)

    def give_up(self) -> None:
        """Command one last landing and return."""
        self.given_up = True

    def follow(self, now_s: float, *, lands: bool) -> Verdict | None:
        """Return the verdict of an aborted mission, None while it waits for the landing.

        Args:
            now_s: mission clock, seconds.
            lands: whether the abort decided this tick's command.
        """
        if self._landing.update(now_s, holds=lands) > self._grace_s:
            self.given_up = True
        if self.reason is None or not self.given_up:
            return None
        return Verdict(outcome=Outcome.ABORTED, reason=self.reason)
