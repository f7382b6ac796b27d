"""Whether the last metre before the mark begins."""

from __future__ import annotations

import pytest

from behaviours.fly.mark_track import is_at_mark
from uav_bt.types import MarkFix


@pytest.mark.parametrize(
    ("forward_m", "detected", "at_mark"),
    [(0.4, True, True), (1.55, True, False), (1.55, False, True), (2.0, False, False)],
)
def test_a_mark_has_left_the_view_only_where_a_frame_does_not_show_it(
    forward_m: float, *, detected: bool, at_mark: bool
) -> None:
    """Without new frames its last sighting grows old, too."""
    fix = MarkFix(
        captured_s=10.0, forward_m=forward_m, right_m=0.0, height_m=0.0, detected=detected
    )
    assert is_at_mark(fix, 10.6) is at_mark
