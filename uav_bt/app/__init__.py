"""Everything put together: the Python API behind the command line.

Example:
    >>> from uav_bt import app
    >>> report = app.fly("land_only", app.FlightOptions(scene="train-a", seed=7))
    >>> report.outcome
    'success'
"""

from uav_bt.app.assembly import ExactSegmenter, Flight, FlightOptions, assemble, make_drone
from uav_bt.app.flight import Listeners, check, fly
from uav_bt.plugins import make_policy
from uav_bt.tree.shipped import resolve_tree

__all__ = [
    "ExactSegmenter",
    "Flight",
    "FlightOptions",
    "Listeners",
    "assemble",
    "check",
    "fly",
    "make_drone",
    "make_policy",
    "resolve_tree",
]
