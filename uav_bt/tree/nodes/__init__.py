"""The nodes of the format, one module per family: all its classes that can be ticked."""

from __future__ import annotations

from typing import Final

from uav_bt.tree.node import Node
from uav_bt.tree.nodes.base import *
from uav_bt.tree.nodes.branches import *
from uav_bt.tree.nodes.decorators import *
from uav_bt.tree.nodes.leaves import *

_CLASSES: Final = {one for one in globals().values() if isinstance(one, type)}
# The bases have no `update` of their own.
_NODES: Final = [one for one in _CLASSES if issubclass(one, Node) and one.update != Node.update]
BUILTIN_NODES: Final = tuple(sorted(_NODES, key=lambda node: node.__name__))
