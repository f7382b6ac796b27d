"""The planner: routes over the site map, and how they are flown."""

from behaviours.path.clearance import ClearanceMap, Place, Route
from behaviours.path.following import follow
from behaviours.path.margins import Margins
from behaviours.path.nearby import RecentObstacles, recent_obstacles
from behaviours.path.passages import route

__all__ = [
    "ClearanceMap",
    "Margins",
    "Place",
    "RecentObstacles",
    "Route",
    "follow",
    "recent_obstacles",
    "route",
]
