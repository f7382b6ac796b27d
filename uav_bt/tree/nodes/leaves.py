"""The format's own leaves."""

from __future__ import annotations

from uav_bt.tree.leaf import Leaf
from uav_bt.tree.status import FAILURE, SUCCESS, Status


class AlwaysSuccess(Leaf):
    """Succeeds at once."""

    def update(self) -> Status:
        """Succeed."""
        return SUCCESS


class AlwaysFailure(Leaf):
    """Fails at once."""

    def update(self) -> Status:
        """Fail."""
        return FAILURE
