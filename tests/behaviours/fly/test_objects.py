"""NextObject, ViewPoints and ObjectSeen on drawn maps."""

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviours.fly.objects import VISITED, NextObject, ObjectSeen, ViewPoints
from tests.paper_lab import BOXES, CARPET, CLASSES, ROOFS
from uav_bt.board import SITE_MAP
from uav_bt.errors import InputError
from uav_bt.testing import LeafBench, parse_tree
from uav_bt.testing.world import drawn_map
from uav_bt.tree import Status
from uav_bt.types import Pose2D
from uav_bt.types.place import parse_places
from uav_bt.types.place_frames import resolve
from uav_bt.types.site_map import MapMark, MapObject, SiteMap

NAMES = [CLASSES.names[each] for each in BOXES]
START = Pose2D(x_m=-1.5, y_m=-1.5, yaw_rad=math.radians(90))


def box(
    number: int, x_m: float, y_m: float, *, class_id: int = BOXES[0], points: int = 9
) -> MapObject:
    place = {"x_m": x_m, "y_m": y_m, "size_m": 0.4, "width_m": 0.4, "std_m": 0.1, "seen_s": 1.0}
    return MapObject(class_id=class_id, id=number, points=points, **place)


def map_of(*objects: MapObject, wall: bool = False) -> SiteMap:
    """Return a map with the drone at (-1.5, -1.5); a wall may divide it, with a gap far away."""
    outlines_m = [each.outline_m(0.08) for each in objects]
    y_m = np.arange(-2.2, 0.9, 0.05)
    walls_m = [np.column_stack([np.zeros(len(y_m)), y_m])] if wall else []
    drawn = drawn_map(
        obstacles=np.vstack([np.empty((0, 2)), *outlines_m, *walls_m]), pose=(-1.5, -1.5, 0.0)
    )
    return replace(drawn, objects=objects, start=START)


def show(bench: LeafBench, site_map: SiteMap) -> Status:
    bench.clock.advance(0.1)
    bench.board.write(SITE_MAP, site_map)
    return bench.tick()


def handed_out(
    site_map: SiteMap, bench: LeafBench | None = None, **ports: object
) -> list[tuple[str, str]]:
    """Return place and label of each tick until the leaf fails."""
    bench = bench or LeafBench(NextObject, place="{place}", label="{label}", **ports)
    found = []
    while show(bench, site_map) is Status.SUCCESS:
        found.append((bench.variables["place"], bench.variables["label"]))
    return found


def test_without_a_map_they_fail_and_say_so() -> None:
    for leaf, ports in ((NextObject, {}), (ViewPoints, {"of": "object:1"}), (ObjectSeen, {})):
        bench = LeafBench(leaf, **ports)
        assert bench.tick() is Status.FAILURE
        assert "MapSite" in bench.feedback


def test_objects_are_handed_out_once_the_nearest_first() -> None:
    site_map = map_of(box(1, 1.0, 1.0), box(2, -0.3, -0.8, class_id=BOXES[1]), box(3, 0.8, -1.0))
    bench = LeafBench(NextObject, place="{place}", label="{label}")
    assert handed_out(site_map, bench) == [
        ("object:2", NAMES[1]),
        ("object:3", NAMES[0]),
        ("object:1", NAMES[0]),
    ]
    assert bench.board[VISITED] == "object:2;object:3;object:1"
    assert "no further object" in bench.feedback
    more = map_of(*site_map.objects, box(4, 1.0, 0.0))
    assert handed_out(more, bench) == [("object:4", NAMES[0])]


def test_the_nearest_is_the_one_with_the_shortest_route() -> None:
    """The second is nearer through a wall, but the way round is longer. No route: it is last."""
    boxes = box(1, -1.5, 0.8), box(2, 0.6, -1.5, class_id=BOXES[1])
    assert handed_out(map_of(*boxes))[0] == ("object:2", NAMES[1])
    assert handed_out(map_of(*boxes, wall=True))[0] == ("object:1", NAMES[0])
    closed, x_m = map_of(box(1, -1.4, 1.0), box(2, 1.2, -1.4)), np.arange(-2.2, 2.2, 0.05)
    wall_m = np.column_stack([x_m, np.full(len(x_m), -0.4)])
    closed = replace(closed, obstacles_m=np.vstack([closed.obstacles_m, wall_m]))
    assert [place for place, _ in handed_out(closed)] == ["object:2", "object:1"]


def test_only_the_classes_of_the_port_and_objects_with_enough_points_count() -> None:
    site_map = map_of(
        box(1, 1.0, 1.0, class_id=BOXES[0]),
        box(2, 1.0, -1.0, class_id=BOXES[1]),
        box(3, 0.0, 1.0, class_id=BOXES[2]),
        box(4, 0.0, 0.0, class_id=BOXES[0], points=4),
    )
    assert handed_out(site_map, **{"class": NAMES[0]}) == [("object:1", NAMES[0])]
    found = handed_out(site_map, **{"class": f"{NAMES[2]}; {NAMES[0]}"})
    assert sorted(found) == [("object:1", NAMES[0]), ("object:3", NAMES[2])]


@pytest.mark.parametrize(
    ("ports", "numbers"),
    [
        ({}, [1, 2, 3, 4]),
        ({"order": "farthest"}, [4, 3, 2, 1]),
        ({"order": "highest"}, [3, 1, 4, 2]),
        ({"order": "largest"}, [2, 1, 3, 4]),
        ({"order": "highest", "min_height_m": 1.0}, [3, 1]),
        ({"within_m": 1.6}, [1, 2]),
        ({"order": "highest", "class": NAMES[0], "within_m": 3.0}, [1, 2]),
    ],
)
def test_the_order_and_the_bounds(ports: dict[str, object], numbers: list[int]) -> None:
    """An object of unknown height comes last, and has no least height."""
    site_map = map_of(
        replace(box(1, -0.7, -1.5), height_m=1.2),
        replace(box(2, 0.0, -1.5), size_m=0.5),
        replace(box(3, 0.6, -1.0, class_id=BOXES[1]), height_m=1.9),
        replace(box(4, 1.0, 1.0), height_m=0.8),
    )
    places = [f"object:{number}" for number in numbers]
    assert [place for place, _ in handed_out(site_map, **ports)] == places


def test_an_unknown_class_or_order_is_refused() -> None:
    for name in ("box_9", CLASSES.names[CARPET], CLASSES.names[ROOFS[0]], f"{NAMES[0]};box_9"):
        with pytest.raises(InputError, match="unknown class of an object"):
            LeafBench(ObjectSeen, **{"class": name}).setup()
    with pytest.raises(InputError, match="one of nearest, highest, largest, farthest; got 'tall'"):
        LeafBench(NextObject, order="tall").setup()


def test_two_nodes_share_what_was_handed_out() -> None:
    tree = parse_tree(
        """<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>
        <NextObject place="{a}"/><NextObject place="{b}"/><Inverter><NextObject/></Inverter>
        </Sequence></BehaviorTree></root>"""
    )
    tree.board.write(SITE_MAP, map_of(box(1, 0.0, -1.0), box(2, 0.0, 1.0)))
    assert tree.tick() is Status.SUCCESS
    assert (tree.variables["a"], tree.variables["b"]) == ("object:1", "object:2")


def test_view_points_are_places_from_the_start_that_face_the_object() -> None:
    target = box(7, 0.2, 0.1)
    site_map = map_of(target)
    bench = LeafBench(ViewPoints, of="object:7", distance_m=0.8, places="{places}")
    assert show(bench, site_map) is Status.SUCCESS
    places = parse_places(bench.variables["places"])
    assert len(places) == 4
    for place in places:
        goal = resolve(place, site_map)
        assert math.dist((goal.x_m, goal.y_m), (0.2, 0.1)) == pytest.approx(1.0, abs=0.02)
        faces_rad = math.atan2(0.1 - goal.y_m, 0.2 - goal.x_m)
        assert math.remainder(goal.yaw_rad - faces_rad, math.tau) == pytest.approx(0.0, abs=0.02)


def test_other_places_have_view_points_too() -> None:
    mark = MapMark(x_m=0.3, y_m=0.0, std_m=0.05, seen_s=1.0)
    site_map = replace(map_of(), mark=mark)
    for of in ("mark", "start:1.5,-1.8"):
        bench = LeafBench(ViewPoints, of=of, distance_m=0.7, count=3, places="{places}")
        assert show(bench, site_map) is Status.SUCCESS
        for place in parse_places(bench.variables["places"]):
            goal = resolve(place, site_map)
            assert math.dist((goal.x_m, goal.y_m), (0.3, 0.0)) == pytest.approx(0.7, abs=0.02)


def test_without_a_place_there_are_no_view_points() -> None:
    for of, reason in (
        ("object:3", "no object 3"),
        ("mark", "not seen"),
        ("lab:0,0", "unknown"),
        # in a corner
        ("object:1", "room and a free view (1 of 2: 0.30 m to box_1 (object:1), 0.45 m needed; 1"),
    ):
        bench = LeafBench(ViewPoints, of=of, distance_m=0.3, count=2)
        assert show(bench, map_of(box(1, 1.9, 1.9))) is Status.FAILURE
        assert reason in bench.feedback


def test_an_object_counts_as_seen_when_it_is_placed_precisely() -> None:
    bench = LeafBench(ObjectSeen, **{"class": NAMES[0], "std_m": 0.15})
    for changes in ({"std_m": 0.2}, {"class_id": BOXES[1]}, {"points": 4}):
        assert show(bench, map_of(replace(box(1, 0.0, 0.0), **changes))) is Status.FAILURE
    assert show(bench, map_of(box(1, 0.0, 0.0))) is Status.SUCCESS
    assert bench.feedback == "object:1"
