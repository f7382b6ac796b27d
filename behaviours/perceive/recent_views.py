"""Leaves that keep views for policies which compare them, and record what a policy answers."""

from __future__ import annotations

from dataclasses import replace

from behaviours.policies.view import VIEW_KEYS, ask, current_view, policy_view
from behaviours.ports import number
from uav_bt.answers import Answer
from uav_bt.board import ADVICE, FRAME, HELD_TURN, RECENT_VIEWS, STATE
from uav_bt.board.context import MissionContext
from uav_bt.errors import InputError
from uav_bt.protocols import Advice
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types import HeldTurn, PastView, RecentViews
from uav_bt.types.dead_reckoning import Odometry


class RememberViews(Leaf):
    """Keep the frames of the last seconds and where they were captured; SUCCESS always."""

    answers = (Status.SUCCESS,)
    # Enough for three views 2 s apart; the rest covers the interval between frames.
    ports = (number("keep_s", 4.2, 0, 30, "how long frames are kept, s"),)
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
        last = self._views[-1].frame.index if self._views else None
        if frame is None or pose is None or frame.index == last:
            return Status.SUCCESS
        newest = PastView(frame=frame, pose=replace(pose, time_s=frame.captured_s))
        oldest_s = frame.captured_s - self.port_value("keep_s")
        self._views = [each for each in self._views if each.frame.captured_s >= oldest_s] + [newest]
        self.write(RECENT_VIEWS, RecentViews(views=tuple(self._views)), captured_s=frame.captured_s)
        return Status.SUCCESS


class Advise(Leaf):
    """Write the answer of a leaf policy for each new view; SUCCESS always.

    Place it after the perception leaves, including `RememberViews`. No leaf follows the advice.
    """

    # In flights of the rule the advice equals the action. In flights of the network it labels the
    # network's own views with the rule's action (dataset aggregation: Ross, Gordon, Bagnell, arXiv
    # 1011.0686).

    answers = (Status.SUCCESS,)
    ports = (Port("policy", str, default="corridor", doc="leaf policy that is asked"),)
    reads = VIEW_KEYS
    writes = (ADVICE,)

    def on_setup(self, mission: MissionContext) -> None:
        """Find the policy; raises UnknownNameError for a name that is not registered."""
        self._policy = mission.policy(self.port_value("policy"))
        self._rng = mission.rng(self.path)
        self._last_index = -1

    def update(self) -> Status:
        """Ask about the newest view, if it is a new one."""
        view, recent = current_view(self), self.read(RECENT_VIEWS).value
        if view is None or recent is None or view[0].index == self._last_index:
            return Status.SUCCESS
        frame, pose = view[0], recent.newest.pose
        if recent.newest.frame.index != frame.index:
            return Status.SUCCESS
        self._last_index = frame.index
        held, tie_break = self.read(HELD_TURN).value or HeldTurn(), float(self._rng.random())

        def asked(turn: HeldTurn) -> Answer | None:
            shown = policy_view(self, view, held=turn, tie_break=tie_break)
            return ask(self, self._policy, shown)

        answer = asked(held)
        fresh = answer if held == HeldTurn() else asked(HeldTurn())
        if answer is None or fresh is None:
            return Status.SUCCESS
        advice = Advice(
            frame_index=frame.index,
            captured_s=frame.captured_s,
            x_m=pose.x_m,
            y_m=pose.y_m,
            yaw_rad=pose.yaw_rad,
            height_above_ground_m=frame.height_above_ground_m,
            gimbal_pitch_rad=frame.gimbal_pitch_rad,
            turning=held.direction,
            full_turns=held.full_turns,
            answer=answer,
            fresh=fresh,
        )
        self.feedback_message = answer.reason
        self.write(ADVICE, advice, captured_s=frame.captured_s)
        return Status.SUCCESS
