"""The nodes of the format, one module per family."""

from __future__ import annotations

from typing import Final

from uav_bt.tree.node import Node
from uav_bt.tree.nodes.base import SubTree
from uav_bt.tree.nodes.branches import (
    IfThenElse,
    Switch2,
    Switch3,
    Switch4,
    Switch5,
    Switch6,
    TryCatch,
    WhileDoElse,
)
from uav_bt.tree.nodes.decorators import (
    ForceFailure,
    ForceSuccess,
    Inverter,
    KeepRunningUntilFailure,
    Repeat,
    RetryUntilSuccessful,
    RunOnce,
)
from uav_bt.tree.nodes.loops import LoopBool, LoopDouble, LoopInt, LoopString
from uav_bt.tree.nodes.ordered import (
    AsyncFallback,
    AsyncSequence,
    Fallback,
    ReactiveFallback,
    ReactiveSequence,
    Sequence,
    SequenceWithMemory,
)
from uav_bt.tree.nodes.parallel import Parallel, ParallelAll
from uav_bt.tree.nodes.scripts import (
    AlwaysFailure,
    AlwaysSuccess,
    Precondition,
    ScriptCondition,
    ScriptNode,
    SetBlackboard,
    UnsetBlackboard,
)
from uav_bt.tree.nodes.timers import Delay, Sleep, Timeout
from uav_bt.tree.nodes.updates import SkipUnlessUpdated, WaitValueUpdate, WasEntryUpdated

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
    "IfThenElse",
    "Inverter",
    "KeepRunningUntilFailure",
    "LoopBool",
    "LoopDouble",
    "LoopInt",
    "LoopString",
    "Parallel",
    "ParallelAll",
    "Precondition",
    "ReactiveFallback",
    "ReactiveSequence",
    "Repeat",
    "RetryUntilSuccessful",
    "RunOnce",
    "ScriptCondition",
    "ScriptNode",
    "Sequence",
    "SequenceWithMemory",
    "SetBlackboard",
    "SkipUnlessUpdated",
    "Sleep",
    "SubTree",
    "Switch2",
    "Switch3",
    "Switch4",
    "Switch5",
    "Switch6",
    "Timeout",
    "TryCatch",
    "UnsetBlackboard",
    "WaitValueUpdate",
    "WasEntryUpdated",
    "WhileDoElse",
]

BUILTIN_NODES: Final[tuple[type[Node], ...]] = tuple(
    globals()[name] for name in __all__ if name != "BUILTIN_NODES"
)
