"""What a leaf is given when its mission sets up: the board, the clock, ways to ask for things."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from uav_bt.board.blackboard import Blackboard
from uav_bt.board.proposals import Proposals
from uav_bt.protocols import Clock, LeafPolicy, Segmenter

__all__ = ["MissionContext"]


@dataclass(frozen=True, kw_only=True)
class MissionContext:
    """One mission's surroundings, handed to every leaf's `on_setup`."""

    board: Blackboard
    clock: Clock
    proposals: Proposals
    policy: Callable[[str], LeafPolicy]  # by registered name; raises UnknownNameError
    seed: int = 0
    inference_threads: int = 1  # one in a campaign, so that results do not depend on the load
    # Replaces the network of every Segment leaf; evaluations fly on exact masks with it.
    segmenter: Segmenter | None = None
    # Names of the classes that count as ground besides the carpet, for every Segment leaf.
    ground: tuple[str, ...] = ()
    # Time each perception stage takes, seconds by stage name, of this mission.
    stage_times_s: dict[str, list[float]] = field(default_factory=dict)
    # `--policy NODE=NAME`: replaces the policy that the tree file names for a node.
    policy_overrides: dict[str, str] = field(default_factory=dict)

    def rng(self, owner: str) -> np.random.Generator:
        """Return a generator that depends on the mission's seed and the owner's name only."""
        return np.random.default_rng([self.seed, *owner.encode()])
