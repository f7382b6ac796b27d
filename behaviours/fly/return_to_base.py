"""ReturnToBase: a node made of a subtree of `trees/lib/`."""

from __future__ import annotations

from typing import ClassVar

from behaviours.fly.course_leaf import GIMBAL
from behaviours.fly.go_to_mark import ARRIVE
from behaviours.fly.steering import FLOWING, GIVES_WAY, POLICY
from uav_bt.tree import Port, SubtreeNode


class ReturnToBase(SubtreeNode):
    """Search for the landing mark and fly to it; SUCCESS above it.

    The drone flies by the site map if there is one. With `approach="policy"` the leaf policy
    chooses the way of the search and to the mark.
    """

    ports = (
        *(POLICY, FLOWING, GIVES_WAY, GIMBAL, ARRIVE),
        Port(
            "approach",
            str,
            default="memory",
            choices=("memory", "policy"),
            doc="what finds the way to the mark: the 'memory' of the place, or the 'policy'",
        ),
    )
    variants: ClassVar = {("approach", "policy"): "ReturnToBaseByPolicy"}
