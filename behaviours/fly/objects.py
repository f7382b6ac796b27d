"""Leaves that choose objects of the site map, and places from which to look at them."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterator
from typing import Any, ClassVar, Final

from behaviours.path.following import UNMAPPED_S
from behaviours.path.margins import Margins, Passage
from behaviours.path.nearby import recent_obstacles
from behaviours.path.passages import ClearanceMaps
from behaviours.path.view_points import view_points, why_none
from behaviours.ports import number
from uav_bt.board import SITE_MAP
from uav_bt.board.blackboard import Key
from uav_bt.board.context import MissionContext
from uav_bt.errors import UnknownNameError
from uav_bt.lab.classes import LabClasses
from uav_bt.lab.lab import Lab
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types.place import SEPARATOR, Place, PlaceFrame
from uav_bt.types.place_frames import Unresolved, resolve, start_place
from uav_bt.types.site_map import MapObject, SiteMap

_CHOSEN: Final = "objects that NextObject has chosen in this mission, such as object:1;object:4"
VISITED: Final = Key("visited", str, _CHOSEN, writer="NextObject")
_CLASS: Final = "class of the object, such as box_5, or several with ; between them; empty: any"
CLASS: Final = Port("class", str, "", _CLASS)
_FIRST: Final = "which object comes first: nearest, highest, largest or farthest"
_ORDERS: Final = ("nearest", "highest", "largest", "farthest")
_VIEWS: Final = "places such as start:1,0@90;start:2,1@180, for LoopString"
_FROM: Final = "distance from the side of the object, or from the other place, m"

_BESIDE_M: Final = 0.15  # a route ends this far beyond the margin of the object; a cell and a half
_MIN_POINTS: Final = 6  # of an object on the map; fewer may be an error of a network. Chosen.


def _class_ids(names: str, classes: LabClasses) -> tuple[int, ...]:
    """Return the classes of a port's value; all that stand on the ground for an empty one."""
    by_name = {classes.names[class_id]: class_id for class_id in classes.standing}
    given = [name.strip() for name in names.split(SEPARATOR) if name.strip()]
    for name in given:
        if name not in by_name:
            raise UnknownNameError("class of an object", name, tuple(by_name))
    return tuple(by_name[name] for name in given) or classes.standing


class MapLeaf(Leaf):
    """Base of the leaves that answer by the site map; FAILURE without one."""

    reads: ClassVar[tuple[Key[Any], ...]] = (SITE_MAP,)
    needed = (SITE_MAP,)

    def on_setup(self, mission: MissionContext) -> None:
        """Take the margins of the place; raises UnknownNameError for a class that the lab lacks."""
        self._margins = Margins().within(mission.clearances)
        if CLASS in self.ports:
            _class_ids(self.initial_value(CLASS) or "", mission.classes)

    def refuses_lab(self, lab: Callable[[], Lab]) -> str | None:
        """Refuse a class that the lab lacks."""
        try:
            if CLASS in self.ports and (names := self.initial_value(CLASS)):
                _class_ids(names, lab().classes)
        except UnknownNameError as error:
            return str(error)
        return None

    def update(self) -> Status:
        """Answer by the newest map."""
        if (site_map := self.read(SITE_MAP).value) is not None:
            return self.work(site_map)
        return self.fails("no site map: <MapSite/> must tick ahead of this leaf")

    @abstractmethod
    def work(self, site_map: SiteMap) -> Status:
        """Return the answer by the newest map."""

    def fails(self, reason: str) -> Status:
        """Return FAILURE, with its reason on the status line."""
        self.feedback_message = reason
        return Status.FAILURE

    def seen(self, site_map: SiteMap) -> list[MapObject]:
        """Return the objects of the wanted class that the map has enough points of."""
        class_ids = _class_ids(self.port(CLASS), site_map.classes)
        objects = (item for item in site_map.objects if item.class_id in class_ids)
        return [item for item in objects if item.points >= _MIN_POINTS]

    def clearance_maps(self, site_map: SiteMap) -> ClearanceMaps:
        """Return the clearances that routes and places need."""
        recent = recent_obstacles(site_map.near, site_map, unmapped_s=UNMAPPED_S)
        return ClearanceMaps(site_map, recent, self._margins)


class ObjectSeen(MapLeaf):
    """SUCCESS while the map has an object of a class, placed precisely enough; FAILURE otherwise.

    FAILURE also without a map. Objects of which the map has few points do not count.
    """

    condition = True
    ports = (
        CLASS,
        number("std_m", 0.3, 0.01, 5, "largest standard deviation of the object's position, m"),
    )

    def work(self, site_map: SiteMap) -> Status:
        """Look at the objects of the map."""
        most_m = self.port_value("std_m")
        seen = [item for item in self.seen(site_map) if item.std_m <= most_m]
        self.feedback_message = ", ".join(f"object:{item.id}" for item in seen)
        return Status.SUCCESS if seen else Status.FAILURE


class NextObject(MapLeaf):
    """Choose an object of the map that this mission has not chosen yet; FAILURE without.

    The nearest is the one with the shortest route, the farthest the one with the longest. Objects
    without a known route come last, ordered by straight lines. The highest is the one with the
    highest top; objects whose height the map does not know come last, and do not count with
    `min_height_m`. The largest has the largest base. All nodes of a mission share the memory, the
    board key `visited`. Objects of which the map has few points do not count. FAILURE also without
    a map.
    """

    ORDER: ClassVar = Port("order", str, "nearest", _FIRST, choices=_ORDERS)
    PLACE: ClassVar = Port("place", str, direction="output", doc="the object, such as object:3")
    LABEL: ClassVar = Port("label", str, direction="output", doc="its class, such as box_5")
    group = "Looking"
    answers = (Status.SUCCESS, Status.FAILURE)
    ports = (
        CLASS,
        ORDER,
        number("min_height_m", 0.0, 0, 20, "least height of its top above the ground, m; 0: any"),
        number("within_m", 0.0, 0, 100, "largest distance in a straight line, m; 0: any"),
        PLACE,
        LABEL,
    )
    reads = (SITE_MAP, VISITED)
    writes = (VISITED,)

    def work(self, site_map: SiteMap) -> Status:
        """Choose an object."""
        visited = self.read(VISITED).value or ""
        chosen = set(visited.split(SEPARATOR))
        left = [item for item in self.wanted(site_map) if f"object:{item.id}" not in chosen]
        if not left:
            return self.fails("the map has no further object of this class, height and distance")
        maps = self.clearance_maps(site_map)
        item = min(left, key=lambda each: self.rank(maps, each))
        place, label = f"object:{item.id}", site_map.classes.names[item.class_id]
        self.write(VISITED, SEPARATOR.join(filter(None, (visited, place))))
        self.set_port(self.PLACE, place)
        self.set_port(self.LABEL, label)
        height = "" if item.height_m is None else f", {item.height_m:.2f} m high"
        self.feedback_message = f"{place}, {label}{height}"
        return Status.SUCCESS

    def wanted(self, site_map: SiteMap) -> Iterator[MapObject]:
        """Yield the objects of the wanted class, height and distance."""
        least_m, most_m = self.port_value("min_height_m"), self.port_value("within_m") or math.inf
        here = site_map.pose
        for item in self.seen(site_map):
            near = math.dist((here.x_m, here.y_m), (item.x_m, item.y_m)) <= most_m
            if near and (least_m == 0.0 or (item.height_m or 0.0) >= least_m):
                yield item

    def rank(self, maps: ClearanceMaps, item: MapObject) -> tuple[float, ...]:
        """Return numbers that are least for the object that comes first."""
        match self.port(self.ORDER):
            case "highest":
                return (-(item.height_m or 0.0),)
            case "largest":
                return (-item.size_m * item.width_m,)
        no_route, length_m = _route_m(maps, item)
        return no_route, length_m if self.port(self.ORDER) == "nearest" else -length_m


class ViewPoints(MapLeaf):
    """List places around an object that face it and have room and a free view; FAILURE without.

    The list begins with the place that is reached first, and each place is followed by the nearest
    one that is left. If the wanted place has no room or no free view, a place beside it is
    taken. The list is shorter than `count` if fewer places are free. An object hides the places
    behind it, whatever its height. FAILURE also without a map, and while the map does not have
    the object.
    """

    OF: ClassVar = Port("of", str, check=Place.parse, sample="object:1", doc="object, or place")
    PLACES: ClassVar = Port("places", str, direction="output", doc=_VIEWS)
    group = "Looking"
    answers = (Status.SUCCESS, Status.FAILURE)
    ports = (
        OF,
        number("distance_m", 1.0, 0.3, 10, _FROM),
        Port("count", int, default=4, least=1, most=36, doc="wanted number of places"),
        PLACES,
    )

    def work(self, site_map: SiteMap) -> Status:
        """Find the places."""
        of = self.port(self.OF)
        place = Place.parse(of)
        goal = resolve(place, site_map)
        if isinstance(goal, Unresolved):
            return self.fails(goal.reason)
        target = site_map.object(place.object_id) if place.frame is PlaceFrame.OBJECT else None
        if target is None:  # a place is an object without a size
            x_m, y_m, at_s = goal.x_m, goal.y_m, site_map.captured_s
            target = MapObject(class_id=0, x_m=x_m, y_m=y_m, size_m=0.0, std_m=0.0, seen_s=at_s)
        shape = {name: self.port_value(name) for name in ("distance_m", "count")}
        maps = self.clearance_maps(site_map)
        poses = view_points(maps, target, **shape)
        if not poses:
            why = why_none(maps, target, **shape)
            return self.fails(f"no place around {of} has room and a free view ({why})")
        self.feedback_message = f"{len(poses)} places around {of}"
        places = [start_place(site_map, it.x_m, it.y_m, yaw_rad=it.yaw_rad) for it in poses]
        self.set_port(self.PLACES, SEPARATOR.join(map(str, places)))
        return Status.SUCCESS


def _route_m(maps: ClearanceMaps, item: MapObject) -> tuple[bool, float]:
    """Return whether an object has no route, and the length of the route or the distance."""
    pose, margins = maps.map.pose, maps[Passage.ORDINARY].margins
    beside_m = math.hypot(item.size_m, item.width_m) / 2 + margins.touch_m + _BESIDE_M
    route = maps.route_to((item.x_m, item.y_m), near_m=beside_m, far_m=beside_m)
    if route is None:
        return True, math.dist((pose.x_m, pose.y_m), (item.x_m, item.y_m))
    return False, route.length_m + math.dist(route.path_m[-1], (item.x_m, item.y_m))
