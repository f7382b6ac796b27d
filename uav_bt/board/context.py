"""What a leaf is handed when its mission is set up: board, clock, proposals, policies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from uav_bt.board.blackboard import Blackboard
from uav_bt.board.proposals import Proposals
from uav_bt.plugins import make_policy
from uav_bt.protocols import Clock, LeafPolicy, Segmenter


@dataclass(frozen=True, kw_only=True)
class MissionContext:
    """One mission's surroundings, handed to every leaf's `on_setup`."""

    board: Blackboard
    clock: Clock
    proposals: Proposals = field(default_factory=Proposals)
    # By registered name; raises UnknownNameError.
    policy: Callable[[str], LeafPolicy] = make_policy
    seed: int = 0
    inference_threads: int = 1  # one in a campaign, so that results do not depend on the load
    # Replaces the network of every Segment leaf; evaluations fly on exact masks with it.
    segmenter: Segmenter | None = None
    # Names of the classes that count as ground besides the carpet, for every Segment leaf.
    ground: tuple[str, ...] = ()
    # Time each perception stage takes, seconds by stage name, of this mission.
    stage_times_s: dict[str, list[float]] = field(default_factory=dict)

    def rng(self, owner: str) -> np.random.Generator:
        """Return a generator that depends on the mission's seed and the owner's name only."""
        return np.random.default_rng([self.seed, *owner.encode()])
