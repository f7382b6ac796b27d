"""The leaf Advise: it records a leaf policy's answer to every view; the drone does not follow it.

The records are training data for the network that imitates the rule. In flights of the rule the
advice equals the action. In flights of the network it labels the network's own views with the
rule's action (dataset aggregation: Ross, Gordon, Bagnell, arXiv 1011.0686).
"""

from __future__ import annotations

from behaviours.policies.view import VIEW_KEYS, ask, current_view, policy_view
from uav_bt.answers import Answer
from uav_bt.board import ADVICE, HELD_TURN, RECENT_VIEWS
from uav_bt.board.context import MissionContext
from uav_bt.protocols import Advice
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types import HeldTurn


class Advise(Leaf):
    """Write the answer of a leaf policy for each new view; SUCCESS always.

    Place it after the perception leaves, including `RememberViews`. No leaf follows the advice.
    """

    answers = (Status.SUCCESS,)
    ports = (Port("policy", str, default="corridor", doc="leaf policy that is asked"),)
    reads = VIEW_KEYS
    writes = (ADVICE,)

    def on_setup(self, mission: MissionContext) -> None:
        """Find the policy; raises UnknownNameError for a name that is not registered."""
        self._policy = mission.policy(self.port_value("policy"))
        self._rng = mission.rng(self.path)
        self._clearances = mission.clearances
        self._last_index = -1

    def update(self) -> Status:
        """Ask about the newest view, if it is a new one."""
        view, recent = current_view(self), self.read(RECENT_VIEWS).value
        if view is None or recent is None or view[0].index == self._last_index:
            return Status.SUCCESS
        frame, newest = view[0], recent.newest
        if newest.frame.index != frame.index:
            return Status.SUCCESS
        self._last_index = frame.index
        held, tie_break = self.read(HELD_TURN).value or HeldTurn(), float(self._rng.random())

        def asked(turn: HeldTurn) -> Answer | None:
            shown = policy_view(
                self, *view, held=turn, tie_break=tie_break, clearances=self._clearances
            )
            return ask(self, self._policy, shown)

        answer = asked(held)
        fresh = answer if held == HeldTurn() else asked(HeldTurn())
        if answer is None or fresh is None:
            return Status.SUCCESS
        advice = Advice(
            frame_index=frame.index,
            captured_s=frame.captured_s,
            x_m=newest.pose.x_m,
            y_m=newest.pose.y_m,
            yaw_rad=newest.pose.yaw_rad,
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
