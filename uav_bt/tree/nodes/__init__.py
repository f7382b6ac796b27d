"""The nodes of the format, one module per family."""

from __future__ import annotations

from typing import Final

from uav_bt.tree.node import Node
from uav_bt.tree.nodes.decorators import (
    ForceFailure,
    ForceSuccess,
    Inverter,
    KeepRunningUntilFailure,
    Repeat,
    RetryUntilSuccessful,
    RunOnce,
)
from uav_bt.tree.nodes.fallbacks import AsyncFallback, Fallback, ReactiveFallback
from uav_bt.tree.nodes.leaves import AlwaysFailure, AlwaysSuccess
from uav_bt.tree.nodes.parallel import Parallel
from uav_bt.tree.nodes.sequences import (
    AsyncSequence,
    ReactiveSequence,
    Sequence,
    SequenceWithMemory,
)
from uav_bt.tree.nodes.subtree import SubTree
from uav_bt.tree.nodes.timers import Delay, Sleep, Timeout

__all__ = [
    "BUILTIN_NODES",
    "AlwaysFailure",
    "AlwaysSuccess",
    "AsyncFallback",
    "AsyncSequence",
    "Delay",
    "Fallback",
    "ForceFailure",
    "ForceSuccess",
    "Inverter",
    "KeepRunningUntilFailure",
    "Parallel",
    "ReactiveFallback",
    "ReactiveSequence",
    "Repeat",
    "RetryUntilSuccessful",
    "RunOnce",
    "Sequence",
    "SequenceWithMemory",
    "Sleep",
    "SubTree",
    "Timeout",
]

BUILTIN_NODES: Final[tuple[type[Node], ...]] = (
    AlwaysFailure,
    AlwaysSuccess,
    AsyncFallback,
    AsyncSequence,
    Delay,
    Fallback,
    ForceFailure,
    ForceSuccess,
    Inverter,
    KeepRunningUntilFailure,
    Parallel,
    ReactiveFallback,
    ReactiveSequence,
    Repeat,
    RetryUntilSuccessful,
    RunOnce,
    Sequence,
    SequenceWithMemory,
    Sleep,
    SubTree,
    Timeout,
)
