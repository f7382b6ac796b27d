"""The places of a mission in a scene: where they lie, and the room that each has."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Final

from behaviours.fly.objects import ViewPoints
from behaviours.fly.places import Face, PlaceLeaf
from behaviours.path.margins import Margins, Passage
from behaviours.path.room import EDGE, Room
from sim_bridge.twin.scene import Scene
from uav_bt.app.place import area_of, rules_of
from uav_bt.app.site import Site
from uav_bt.display.lab_map import LabMap, MapPlace
from uav_bt.errors import UavBtError
from uav_bt.tree import MissionTree, Node
from uav_bt.tree.loading.places import lines_of_lists
from uav_bt.tree.rules import Rules
from uav_bt.types.area import Area
from uav_bt.types.place import Place, PlaceFrame, parse_places

_ROUNDING_M: Final = 0.005  # of the distances that are shown
_FACED: Final = (Face, ViewPoints)  # they need no room at the place


def with_places(lab_map: LabMap, mission: MissionTree, scene: Scene, site: Site) -> LabMap:
    """Return the map of a scene with the places and the area of a mission, by a site's margins."""
    start, usual = scene.take_off_pose, Margins().within(site.clearances, scene.mark)
    area = area_of(rules_of(mission), site, start)
    if area is not None and start is not None:
        areas_m = ([start.to_world(x_m, -y_m) for x_m, y_m in each] for each in area.polygons)
        lab_map = replace(lab_map, areas_m=tuple(map(tuple, areas_m)))
    lists, places = lines_of_lists(mission.sources), dict[str, MapPlace]()
    for node, port, place in _named(mission):
        text, at, at_m = str(place), mission.places.get(node.path), _at_m(place, scene)
        leaves = [each for each in node.iterate() if isinstance(each, PlaceLeaf | ViewPoints)]
        if at_m is None:
            found = MapPlace(text=text, at_m=None, note="known in flight only")
        elif all(isinstance(each, _FACED) for each in leaves or (node,)):
            found = MapPlace(text=text, at_m=at_m, note="only faced")
        else:
            is_mark = place.frame is PlaceFrame.MARK
            margins = usual.in_gap() if is_mark else usual.through(Passage.TIGHT)
            room = _room(at_m, lab_map, scene, margins)
            found = MapPlace(text=text, at_m=at_m, note=str(room))
            if room.short_m > _ROUNDING_M:
                where = lists.get(text, "" if at is None else f"{at.path}:{at.at(port)}")
                fault = f"{where}: no room at '{text}', {room}: move it by {room.short_m:.2f} m"
                found = replace(found, fault=fault)
        if text not in places or places[text].note == "only faced":
            places[text] = found
    return replace(lab_map, places=tuple(places.values()))


def _named(mission: MissionTree) -> Iterator[tuple[Node, str, Place]]:
    """Yield the places of all nodes, with the ports that have them; corners of areas are none."""
    for node in mission.nodes():
        for port in () if isinstance(node, Rules) else node.ports:
            with suppress(UavBtError):  # the values of other ports are no places
                text = None if port.direction == "output" else node.initial_value(port)
                for place in parse_places(text) if isinstance(text, str) else ():
                    yield node, port.name, place


def _at_m(place: Place, scene: Scene) -> tuple[float, float] | None:
    """Return where a place lies in the drawing; None where only the flight shows it."""
    start, mark = scene.take_off_pose, scene.mark_pose
    if place.frame is PlaceFrame.MARK and mark is not None:
        return mark.x_m, mark.y_m
    if place.frame is PlaceFrame.START and start is not None:
        return start.to_world(place.x_m, -place.y_m)
    return (place.x_m, place.y_m) if place.frame is PlaceFrame.LAB else None


def _room(at_m: tuple[float, float], lab_map: LabMap, scene: Scene, margins: Margins) -> Room:
    """Return what leaves least room at a place of the drawing."""
    touch_m, edge_m = margins.touch_m, margins.edge_m
    rooms = [
        Room(touch_m - item.distance_m(*at_m), touch_m, placed.name)
        for item, placed in zip(lab_map.boxes, scene.placed, strict=True)
    ]
    rooms.append(Room(edge_m - scene.ground.margin_m(*at_m), edge_m, EDGE))
    if lab_map.areas_m:
        rooms.append(Room(-Area(lab_map.areas_m).margin_m(*at_m), 0.0, "the border of the area"))
    return max(rooms)
