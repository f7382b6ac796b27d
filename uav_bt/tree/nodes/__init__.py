"""The nodes of the format, one module per family. What is imported here is a node."""

from __future__ import annotations

from typing import Final

from uav_bt.tree.node import Node
from uav_bt.tree.nodes.base import SubTree as SubTree
from uav_bt.tree.nodes.branches import IfThenElse as IfThenElse
from uav_bt.tree.nodes.branches import Parallel as Parallel
from uav_bt.tree.nodes.branches import ParallelAll as ParallelAll
from uav_bt.tree.nodes.branches import Switch2 as Switch2
from uav_bt.tree.nodes.branches import Switch3 as Switch3
from uav_bt.tree.nodes.branches import Switch4 as Switch4
from uav_bt.tree.nodes.branches import Switch5 as Switch5
from uav_bt.tree.nodes.branches import Switch6 as Switch6
from uav_bt.tree.nodes.branches import WhileDoElse as WhileDoElse
from uav_bt.tree.nodes.decorators import ForceFailure as ForceFailure
from uav_bt.tree.nodes.decorators import ForceSuccess as ForceSuccess
from uav_bt.tree.nodes.decorators import Inverter as Inverter
from uav_bt.tree.nodes.decorators import KeepRunningUntilFailure as KeepRunningUntilFailure
from uav_bt.tree.nodes.decorators import LoopBool as LoopBool
from uav_bt.tree.nodes.decorators import LoopDouble as LoopDouble
from uav_bt.tree.nodes.decorators import LoopInt as LoopInt
from uav_bt.tree.nodes.decorators import LoopString as LoopString
from uav_bt.tree.nodes.decorators import Repeat as Repeat
from uav_bt.tree.nodes.decorators import RetryUntilSuccessful as RetryUntilSuccessful
from uav_bt.tree.nodes.decorators import RunOnce as RunOnce
from uav_bt.tree.nodes.ordered import AsyncFallback as AsyncFallback
from uav_bt.tree.nodes.ordered import AsyncSequence as AsyncSequence
from uav_bt.tree.nodes.ordered import Fallback as Fallback
from uav_bt.tree.nodes.ordered import ReactiveFallback as ReactiveFallback
from uav_bt.tree.nodes.ordered import ReactiveSequence as ReactiveSequence
from uav_bt.tree.nodes.ordered import Sequence as Sequence
from uav_bt.tree.nodes.ordered import SequenceWithMemory as SequenceWithMemory
from uav_bt.tree.nodes.ordered import TryCatch as TryCatch
from uav_bt.tree.nodes.scripts import AlwaysFailure as AlwaysFailure
from uav_bt.tree.nodes.scripts import AlwaysSuccess as AlwaysSuccess
from uav_bt.tree.nodes.scripts import Precondition as Precondition
from uav_bt.tree.nodes.scripts import ScriptCondition as ScriptCondition
from uav_bt.tree.nodes.scripts import ScriptNode as ScriptNode
from uav_bt.tree.nodes.scripts import SetBlackboard as SetBlackboard
from uav_bt.tree.nodes.scripts import UnsetBlackboard as UnsetBlackboard
from uav_bt.tree.nodes.timers import Delay as Delay
from uav_bt.tree.nodes.timers import SkipUnlessUpdated as SkipUnlessUpdated
from uav_bt.tree.nodes.timers import Sleep as Sleep
from uav_bt.tree.nodes.timers import Timeout as Timeout
from uav_bt.tree.nodes.timers import WaitValueUpdate as WaitValueUpdate
from uav_bt.tree.nodes.timers import WasEntryUpdated as WasEntryUpdated

_IMPORTED: Final = [
    one for one in globals().values() if isinstance(one, type) and issubclass(one, Node)
]
BUILTIN_NODES: Final = tuple(sorted({*_IMPORTED} - {Node}, key=lambda node: node.__name__))
