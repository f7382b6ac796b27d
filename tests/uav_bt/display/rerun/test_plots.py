"""The plots: heading error of a turn, gaps where nothing is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.uav_bt.display.rerun.rerun_world import NotedStream, World, values
from uav_bt.display.rerun.plots import FlightPlots, TurnLeft
from uav_bt.types import HOVER, Command, Corridor, HelipadFix, MoveBy, ObstaclePoints, Pose


def turn(id_: int, yaw_rad: float) -> Command:
    return Command(movement=MoveBy(id=id_, yaw_rad=yaw_rad))


def test_what_is_left_of_a_turn_shrinks_as_the_drone_turns() -> None:
    world, left = World(), TurnLeft()
    assert left.after(world.tick(yaw_rad=0.2, command=turn(1, 1.0))) == pytest.approx(1.0)
    assert left.after(world.tick(yaw_rad=0.9, command=turn(1, 1.0))) == pytest.approx(0.3)
    assert left.after(world.tick(yaw_rad=0.9, command=HOVER)) is None


def test_a_new_turn_begins_at_the_heading_of_then_and_wraps() -> None:
    world, left = World(), TurnLeft()
    left.after(world.tick(yaw_rad=0.0, command=turn(1, 1.0)))
    begun = left.after(world.tick(yaw_rad=3.0, command=turn(2, -0.5)))
    assert begun == pytest.approx(-0.5)
    later = left.after(world.tick(yaw_rad=-3.1, command=turn(2, -0.5)))
    assert later == pytest.approx(2.5 + 3.1 - 2 * math.pi)


def test_an_advance_is_no_turn() -> None:
    command = Command(movement=MoveBy(id=3, forward_m=0.3))
    assert TurnLeft().after(World().tick(command=command)) is None


def shown(stream: NotedStream, entity: str) -> float:
    (value,) = values(stream.last(entity).scalars)
    return float(value)


def test_every_series_has_a_name_and_a_point_a_tick() -> None:
    stream = NotedStream()
    plots = FlightPlots(stream)
    series = [note.entity for note in stream.notes]
    assert all(note.static and values(note.thing.names) for note in stream.notes)
    at = Pose(x_m=0.0, y_m=0.0, z_m=1.4, yaw_rad=0.0)
    plots.show(World().tick(pose=at), corridor=None, obstacles=None, fix=None)
    assert {note.entity for note in stream.notes if not note.static} == set(series)
    assert shown(stream, "plots/height/telemetry") == 1.5
    assert shown(stream, "plots/height/true") == pytest.approx(1.4)
    assert shown(stream, "plots/free_distance/clearance") == 0.8
    assert shown(stream, "plots/tick_time/compute") == pytest.approx(4.0)


def test_what_is_known_of_the_way_is_plotted() -> None:
    stream = NotedStream()
    corridor = Corridor(
        captured_s=0.0,
        free_distance_m=1.2,
        nearest_m=0.7,
        nearest_side="front",
        time_to_impact_s=2.0,
    )
    obstacles = ObstaclePoints(points_m=np.array([[0.3, 0.4]]), captured_s=0.0)
    fix = HelipadFix(captured_s=0.0, forward_m=1.0, right_m=1.0, detected=True)
    FlightPlots(stream).show(World().tick(), corridor=corridor, obstacles=obstacles, fix=fix)
    assert shown(stream, "plots/free_distance/ahead") == 1.2
    assert shown(stream, "plots/free_distance/intrusion") == 0.7
    assert shown(stream, "plots/free_distance/remembered") == pytest.approx(0.5)
    assert shown(stream, "plots/heading/helipad") == pytest.approx(45.0)


@pytest.mark.parametrize("entity", ["heading/turn", "heading/helipad", "height/true"])
def test_what_is_not_known_leaves_a_gap(entity: str) -> None:
    stream = NotedStream()
    FlightPlots(stream).show(World().tick(), corridor=None, obstacles=None, fix=None)
    assert math.isnan(shown(stream, f"plots/{entity}"))


def test_a_way_without_an_end_leaves_a_gap() -> None:
    stream = NotedStream()
    free = Corridor(
        captured_s=0.0,
        free_distance_m=math.inf,
        nearest_m=math.inf,
        nearest_side=None,
        time_to_impact_s=math.inf,
    )
    FlightPlots(stream).show(World().tick(), corridor=free, obstacles=None, fix=None)
    assert math.isnan(shown(stream, "plots/free_distance/ahead"))
