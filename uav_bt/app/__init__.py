"""Everything put together: the Python API behind the command line.

Example:
    >>> from uav_bt import app
    >>> report = app.fly("land_only", scene="train-a", seed=7)
    >>> report.outcome
    'success'
"""

from uav_bt.app import own_packages as _own_packages  # noqa: F401  (first, for what it checks)
from uav_bt.app.assembly import Flight, Listeners, assemble
from uav_bt.app.drone_of_flight import make_drone
from uav_bt.app.flight import STILL_IN_THE_AIR, check, fly
from uav_bt.app.flight_outputs import FlownMission
from uav_bt.app.loading import Mission
from uav_bt.app.options import FlightOptions
from uav_bt.app.site import Site
from uav_bt.mission.judge import JudgeConfig
from uav_bt.mission.limits import Limits
from uav_bt.mission.runner import RunnerConfig
from uav_bt.tree.loading.lookup import TreeFolders
from uav_bt.types.place import LandOn

__all__ = [
    "STILL_IN_THE_AIR",
    "Flight",
    "FlightOptions",
    "FlownMission",
    "JudgeConfig",
    "LandOn",
    "Limits",
    "Listeners",
    "Mission",
    "RunnerConfig",
    "Site",
    "TreeFolders",
    "assemble",
    "check",
    "fly",
    "make_drone",
]
