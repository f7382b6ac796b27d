"""Rules of a flight: mission, site and options together, and flights under them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.worlds.trees import document
from uav_bt import app
from uav_bt.app.assembly import Flight, assemble
from uav_bt.app.place import drawn_places
from uav_bt.errors import InputError
from uav_bt.protocols import Drone
from uav_bt.record.reader import RecordReader
from uav_bt.tree import parse_tree
from uav_bt.types import Pose2D
from uav_bt.types.place import LandOn, area_corners

pytestmark = pytest.mark.flight

NO_PAD = """\
take_off: {from: [-1.0, 0.5], yaw_deg: 90}
boxes:
  - {pattern: 1, position_m: [1.5, 1.0], size_m: [0.4, 0.4, 1.0]}
"""
SQUARE = "start:-1,-1; start:1,-1; start:1,1; start:-1,1"
AHEAD = "start:-0.5,-0.5; start:0.6,-0.5; start:0.6,0.5; start:-0.5,0.5"


def mission(rules: str, body: str) -> str:
    return document(
        f'<ReactiveSequence><Segment model="unet"/><TrackMotion/><Sequence>{rules}{body}'
        "</Sequence></ReactiveSequence>"
    )


SHORT = '<TakeOff/><Turn degrees="90"/><ForceSuccess><EmergencyLand/></ForceSuccess>'


@pytest.fixture
def no_pad(tmp_path: Path) -> Path:
    path = tmp_path / "open.yaml"
    path.write_text(NO_PAD, encoding="utf-8")
    return path


def put_together(rules: str, **how: Any) -> Flight[Drone]:
    return assemble(mission(rules, "<TakeOff/>"), drone="plain", **how)


# --- before the flight ----------------------------------------------------------------------------


def test_options_come_before_the_missions_rules() -> None:
    rules = '<Rules time_limit_s="60" land_on="ground"/>'
    flight = put_together(rules)
    assert (flight.held.judge.limit_s, flight.held.judge.land_on) == (60.0, LandOn.GROUND)
    flight = put_together(rules, judge=app.JudgeConfig(time_limit_s=90.0, land_on=LandOn.ANY))
    assert (flight.held.judge.limit_s, flight.held.judge.land_on) == (90.0, LandOn.ANY)
    assert put_together("").held.judge.limit_s == 300.0
    rehearsal = put_together('<Rules land_on="mark"/>', rehearse=True)
    assert rehearsal.held.judge.land_on is LandOn.ANY  # where the drone is held


def test_the_areas_of_mission_and_site_both_hold() -> None:
    assert put_together("").held.area is None
    site = app.Site(area=area_corners(AHEAD))
    of_site, of_both = (
        put_together("", site=site),
        put_together(f'<Rules area="{SQUARE}"/>', site=site),
    )
    assert of_site.held.area is not None
    assert of_both.held.area is not None
    assert of_site.held.area.margin_m(0.0, 0.0) == pytest.approx(0.5)
    assert of_both.held.area.margin_m(0.8, 0.0) == pytest.approx(-0.2)
    assert of_both.held.area.margin_m(-0.8, 0.0) == pytest.approx(-0.3)


def test_an_area_of_the_drawing_is_turned_to_the_take_off(no_pad: Path) -> None:
    """The drone at (-1, 0.5) looks up the drawing: up is ahead, left is left."""
    area = "lab:-2,0; lab:0,0; lab:0,2; lab:-2,2"
    flight = put_together(f'<Rules land_on="any" area="{area}"/>', scene=no_pad)
    assert flight.held.area is not None
    corners = np.array(flight.held.area.polygons[0])
    assert corners == pytest.approx(np.array([[-0.5, -1.0], [-0.5, 1.0], [1.5, 1.0], [1.5, -1.0]]))
    no_pad.write_text("take_off: {from: random}", encoding="utf-8")
    with pytest.raises(InputError, match="name the corners as start:x,y"):
        put_together(f'<Rules land_on="any" area="{area}"/>', scene=no_pad)


@pytest.mark.parametrize(
    ("area", "words"),
    [
        ("start:1,1;start:2,1;start:2,2", "the take-off point, start:0,0, lies outside"),
        ("start:-1,-1;start:1,1;start:1,-1;start:-1,1", "must not cross"),
    ],
)
def test_an_area_that_cannot_be_kept_is_refused(area: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        put_together("", site=app.Site(area=area_corners(area)))


def test_a_mission_that_lands_on_a_mark_needs_one(no_pad: Path) -> None:
    with pytest.raises(InputError, match="scene 'open' has no landing mark") as error:
        put_together("", scene=no_pad)
    assert '<Rules land_on="any"/>' in str(error.value)
    assert put_together('<Rules land_on="ground"/>', scene=no_pad).held.area is None


# --- flights --------------------------------------------------------------------------------------


def fly(text: str, **how: Any) -> app.FlownMission:
    return app.fly(text, drone="plain", profile="ideal", **how)


def test_a_place_without_a_mark_is_flown_in(no_pad: Path) -> None:
    flown = fly(mission('<Rules land_on="any"/>', SHORT), scene=no_pad)
    assert (flown.outcome, flown.reason) == ("success", "landed")
    assert (flown.landing_error_m, flown.time_to_find_mark_s) == (None, None)
    assert flown.time_to_land_s is None


def test_a_mission_may_stay_on_the_ground(no_pad: Path) -> None:
    flown = fly(mission('<Rules land_on="none"/>', '<Sleep msec="500"/>'), scene=no_pad)
    assert (flown.outcome, flown.reason) == ("success", "the tree succeeded on the ground")
    assert flown.duration_s is None


def test_a_tree_lands_while_the_drone_is_blind(no_pad: Path) -> None:
    """The landing of a leaf passes the hover of a stale frame, long before the abort of 15 s."""
    text = mission('<Rules land_on="any"/>', SHORT)
    flown = fly(text, scene=no_pad, faults=["video-lost@emergency landing"])
    assert flown.outcome == "success"
    assert (flown.duration_s or 99.0) < 25.0


DASH = """\
from uav_bt.board import STATE
from uav_bt.tree import Leaf, Status
from uav_bt.types import Velocity


class Dash(Leaf):
    \"\"\"Fly ahead for six seconds.\"\"\"

    moves = True
    reads = (STATE,)

    def initialise(self):
        self._began_s = self.clock.now()

    def update(self):
        self.propose(Velocity(forward_mps=0.8))
        return Status.SUCCESS if self.clock.now() - self._began_s > 6.0 else Status.RUNNING
"""


@pytest.mark.parametrize("area", [AHEAD, ""])
def test_a_drone_stays_in_its_area(no_pad: Path, tmp_path: Path, area: str) -> None:
    """Six seconds at 0.8 m/s would lead 4.8 m ahead, beyond the ground."""
    leaves = tmp_path / "dash.py"
    leaves.write_text(DASH, encoding="utf-8")
    body = "<TakeOff/><Dash/><ForceSuccess><EmergencyLand/></ForceSuccess>"
    text, record = mission(f'<Rules land_on="any" area="{area}"/>', body), tmp_path / "f.mcap"
    flown = fly(text, scene=no_pad, leaves=[leaves], record=record)
    ahead_m = float(flown.path[:, 2].max()) - 0.5  # along y of the drawing
    if not area:
        assert flown.outcome == "left_area"
        return
    assert flown.outcome == "success"
    assert ahead_m == pytest.approx(0.6, abs=0.1)
    assert math.dist(flown.path[-1, 1:3], (-1.0, 1.1)) < 0.2
    assert RecordReader(record).metadata["area"].startswith("[[[-0.5, -0.5]")


# --- places in the drawing ------------------------------------------------------------------------

PLACES = """<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence>
  <LoopString queue="start:2,0;lab:0.5,1@90;mark" value="{p}"><GoTo to="{p}"/></LoopString>
  <GoTo to="start:2,0"/><Face at="90"/><GoTo to="body:1,0"/>
</Sequence></BehaviorTree></root>"""
UP = Pose2D(x_m=-1.0, y_m=0.0, yaw_rad=math.pi / 2)


def test_each_known_place_is_drawn_once() -> None:
    found = dict(drawn_places(parse_tree(PLACES), UP))
    assert list(found) == ["start:2,0", "lab:0.5,1@90"]
    assert found["start:2,0"] == pytest.approx((-1.0, 2.0))
    assert found["lab:0.5,1@90"] == (0.5, 1.0)
    assert [text for text, _ in drawn_places(parse_tree(PLACES), None)] == ["lab:0.5,1@90"]
