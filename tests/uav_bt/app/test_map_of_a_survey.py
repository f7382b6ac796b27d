"""The objects that a survey without images maps: places, sizes, heights and ids."""

from __future__ import annotations

from sim_bridge.twin.scene_file import load_scene
from uav_bt import app
from uav_bt.app.assembly import Flight
from uav_bt.board import SITE_MAP
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Drone


class Ids:
    """Notes in which ticks each object is on the map."""

    def __init__(self) -> None:
        self.ticks: dict[int, list[int]] = {}

    def follow(self, flight: Flight[Drone]) -> list[Ids]:
        self._board = flight.context.board
        return [self]

    def on_tick(self, record: TickRecord) -> None:
        site_map = self._board.read(SITE_MAP).value
        for item in () if site_map is None else site_map.objects:
            self.ticks.setdefault(item.id, []).append(record.index)


def test_a_survey_maps_each_object_once_under_one_id() -> None:
    ids = Ids()
    judge = app.JudgeConfig(time_limit_s=60.0)
    options = app.FlightOptions(scene="train-a", drone="plain", judge=judge)
    flown = app.fly("survey_and_land", options, listeners=[ids.follow])

    assert (flown.objects_found, flown.false_objects) == (8, 0)
    assert max(flown.object_errors_m or ()) < 0.15
    assert flown.site_map is not None
    true = {each.class_id: each for each in load_scene("train-a").ground_plan.standing}
    errors_m = []
    for item in flown.site_map.objects:
        footprint = true[item.class_id].footprint
        assert abs(item.size_m - 2 * max(footprint.half_x_m, footprint.half_y_m)) < 0.15
        if item.height_m is not None:
            errors_m.append(abs(item.height_m - true[item.class_id].height_m))
        there = ids.ticks[item.id]
        assert len(there) >= 0.8 * (flown.ticks - there[0])
    assert len(errors_m) >= 3
    assert max(errors_m) < 0.03
    brief = [there for there in ids.ticks.values() if len(there) < 0.05 * flown.ticks]
    assert len(ids.ticks) - len(brief) == 8
