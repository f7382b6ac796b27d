"""The leaf RememberViews: it keeps the last seconds' frames for policies that compare frames."""

from __future__ import annotations

from dataclasses import replace

from uav_bt.board import FRAME, RECENT_VIEWS, STATE
from uav_bt.board.context import MissionContext
from uav_bt.errors import InputError
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types import PastView, RecentViews
from uav_bt.types.dead_reckoning import Odometry


class RememberViews(Leaf):
    """Keep the frames of the last seconds and where they were captured; SUCCESS always."""

    answers = (Status.SUCCESS,)
    # Enough for three views 2 s apart; the rest covers the interval between frames.
    ports = (
        Port("keep_s", float, default=4.2, least=0, most=30, doc="how long frames are kept, s"),
    )
    reads = (STATE, FRAME)
    writes = (RECENT_VIEWS,)

    def on_setup(self, mission: MissionContext) -> None:
        """Make the odometry; raises InputError if the drone's frames show nothing."""
        if mission.sight is not None:
            raise InputError(
                "RememberViews keeps images for a policy that looks at them, and this drone has "
                "none; fly the mission with --drone twin"
            )
        self._odometry = Odometry()
        self._views: list[PastView] = []

    def update(self) -> Status:
        """Integrate the drone's motion, and keep a new frame."""
        state, frame = self.read(STATE).value, self.read(FRAME).value
        if state is not None:
            self._odometry.update(state)
        pose = None if frame is None else self._odometry.at(frame.captured_s)
        if frame is None or pose is None:
            return Status.SUCCESS
        if self._views and self._views[-1].frame.index == frame.index:
            return Status.SUCCESS
        newest = PastView(frame=frame, pose=replace(pose, time_s=frame.captured_s))
        oldest_s = frame.captured_s - self.port_value("keep_s")
        self._views = [each for each in self._views if each.frame.captured_s >= oldest_s] + [newest]
        self.write(RECENT_VIEWS, RecentViews(views=tuple(self._views)), captured_s=frame.captured_s)
        return Status.SUCCESS
