"""The nodes of the format, one module per family: all its classes that can be ticked."""

from __future__ import annotations

from typing import Final

from uav_bt.tree.node import Node
from uav_bt.tree.nodes.base import *
from uav_bt.tree.nodes.branches import *
from uav_bt.tree.nodes.decorators import *
from uav_bt.tree.nodes.leaves import *

_NODES: Final = [
    one for one in globals().values() if isinstance(one, type) and issubclass(one, Node)
]
BUILTIN_NODES: Final = tuple(
    # The bases have no `update` of their own.
    sorted({one for one in _NODES if one.update is not Node.update}, key=lambda one: one.__name__)
)
