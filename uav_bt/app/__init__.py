"""Everything put together: the Python API behind the command line.

Example:
    >>> from uav_bt import app
    >>> report = app.fly("land_only", app.FlightOptions(scene="train-a", seed=7))
    >>> report.outcome
    'success'
"""

from uav_bt.app.assembly import ExactSegmenter, FlightOptions, make_drone, make_policy
from uav_bt.app.flight import check, fly
from uav_bt.tree.shipped import resolve_tree

__all__ = [
    "ExactSegmenter",
    "FlightOptions",
    "check",
    "fly",
    "make_drone",
    "make_policy",
    "resolve_tree",
]
