"""The mission's own runner, ended and interrupted when the recording was."""

from __future__ import annotations

from typing import Any, Final

from uav_bt.app.replay.differences import Comparison
from uav_bt.app.replay.recorded_drone import RecordedDrone
from uav_bt.mission.judge import Judge, Outcome, Verdict
from uav_bt.mission.runner import MissionRunner, TickRecord
from uav_bt.mission.safety import Override
from uav_bt.record.moment import Moment
from uav_bt.tree import Status
from uav_bt.types import DroneState, Truth

_OVER: Final = frozenset({"SUCCESS", "FAILURE"})
_AS_RECORDED: Final = "stopped, as in the recording"
_NOT_TICKED: Final = (Status.IDLE.name, "INVALID")  # as older records have it


class ReplayJudge(Judge):
    """Ends the replay with the recording's last tick, whatever happens."""

    def __init__(self, drone: RecordedDrone) -> None:
        super().__init__()
        self._drone = drone

    def verdict(
        self,
        now_s: float,
        state: DroneState,
        truth: Truth | None,
        tree_status: Status,
        *,
        abort_reason: str | None,
    ) -> Verdict | None:
        """Return that the recording is over, None while it goes on."""
        del now_s, state, truth, tree_status, abort_reason
        if self._drone.at_end:
            return Verdict(outcome=Outcome.SUCCESS, reason="the recording is over")
        return None


class ReplayRunner(MissionRunner):
    """Flies a recorded drone; an operator's stop comes again in the tick in which it came.

    Args:
        drone: the recorded drone.
        rest: as `MissionRunner` takes it.
        named: likewise.
    """

    def __init__(self, drone: RecordedDrone, *rest: Any, **named: Any) -> None:
        super().__init__(drone, *rest, **named)
        self._recorded = drone

    def _tick_tree(self) -> Status:
        moment = self._recorded.moment
        stopped = _stopped_by_operator(self._recorded.before, moment)
        # A stop between two ticks keeps the tree from being ticked; one within comes after.
        if stopped and moment.tick.tree_status in _NOT_TICKED:
            self.request_abort(_AS_RECORDED)
        status = super()._tick_tree()
        if stopped:
            self.request_abort(_AS_RECORDED)
        return status


def _stopped_by_operator(before: Moment | None, now: Moment) -> bool:
    """Return whether a stop began here that the runner did not come to by itself."""
    if now.commands.override != Override.ABORT.value:
        return False
    return before is None or (
        before.commands.override not in {Override.ABORT.value, Override.BATTERY.value}
        and before.tick.tree_status not in _OVER
    )


class ComparingListener:
    """Compares every tick with the recorded one."""

    def __init__(self, drone: RecordedDrone, comparison: Comparison) -> None:
        self._drone = drone
        self._comparison = comparison

    def on_tick(self, record: TickRecord) -> None:
        """Compare a tick."""
        self._comparison.add(self._drone.moment, record)
