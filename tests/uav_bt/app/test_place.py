"""Where a flight is: site files, rules of mission, site and options together, and flights there."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.worlds.labs import SITE, with_files_of_site
from tests.worlds.tables import cases
from tests.worlds.trees import document
from uav_bt import app
from uav_bt.app.assembly import Flight, assemble
from uav_bt.app.loading import load_mission
from uav_bt.app.site import Site, load_site
from uav_bt.board import CLASS_MAP, FLIGHT_HEIGHT
from uav_bt.errors import FileError, InputError
from uav_bt.lab.shipped import default_mark
from uav_bt.mission.limits import Limits
from uav_bt.mission.preflight import PreflightConfig
from uav_bt.protocols import Drone
from uav_bt.record.reader import RecordReader
from uav_bt.testing import ScriptedDrone
from uav_bt.tree import Leaf, NodeRegistry, Port, Status
from uav_bt.types import Airframe, Clearances, LandingMark, Pose2D
from uav_bt.types.place import LandOn, area_corners

pytestmark = pytest.mark.flight

# --- site files -----------------------------------------------------------------------------------


def site_file(folder: Path, text: str) -> Path:
    path = folder / "site.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_all_keys_of_a_site_file(tmp_path: Path) -> None:
    assert load_site(site_file(with_files_of_site(tmp_path), SITE)) == Site(
        flight_height_m=1.2,
        take_off_surface_m=0.4,
        camera=tmp_path / "camera.yaml",
        model=str(tmp_path / "hall.onnx"),
        classes=tmp_path / "classes.yaml",
        ground=("floor", "wall"),
        limits=Limits(speed_mps=0.6, ceiling_m=2.0, critical_battery=0.15),
        take_off_pose=Pose2D(x_m=-1.0, y_m=0.5, yaw_rad=math.pi / 2),
        area=area_corners("lab:-2,-2; lab:2,-2; lab:2,2; lab:-2,2"),
        mark=LandingMark(length_m=0.6, width_m=0.4, height_m=0.05),
        mark_pose=Pose2D(x_m=1.0, y_m=-1.0, yaw_rad=math.pi),
        clearances=Clearances(obstacle_m=0.5),
        preflight=PreflightConfig(battery=0.4, link=0.6),
        video_latency_s=0.2,
        http_port=8080,
        rtsp_port=8554,
        return_home=False,
    )


def test_an_empty_file_and_half_a_mark_keep_what_they_do_not_state(tmp_path: Path) -> None:
    assert load_site(site_file(tmp_path, "# nothing to say\n")) == Site()
    flat = load_site(site_file(tmp_path, "mark: {height_m: 0.05}"))
    assert flat.mark == replace(default_mark(), height_m=0.05)
    large = load_site(site_file(tmp_path, "mark: {size_m: [1, 1.5]}"))
    assert large.mark == replace(default_mark(), length_m=1.0, width_m=1.5)


@pytest.mark.parametrize(("text", "message"), cases("labs")["refused_sites"])
def test_what_is_wrong_is_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        load_site(site_file(tmp_path, text))


# --- values of a site in a tree -------------------------------------------------------------------


class OwnEyes(Leaf):
    """Segment with another network, and set a constant flight height."""

    ports = (Port("model", str, default="unet", doc="the network"),)
    writes = (CLASS_MAP, FLIGHT_HEIGHT)

    def update(self) -> Status:
        return Status.SUCCESS


class Climb(OwnEyes):
    """A third party's independent take-off."""

    ports = (Port("height_m", float, default=2.0, doc="flight height, m"),)
    writes = (FLIGHT_HEIGHT,)


OWN = NodeRegistry.installed().with_nodes(Climb, OwnEyes)


def loaded(body: str, site: Site) -> dict[str, object]:
    """Return the values of all ports of a tree's leaves, by node and port."""
    mission = load_mission(document(body), app.FlightOptions(site=site), OWN)
    return {
        f"{leaf.name}.{port.name}": leaf.port(port)
        for leaf in mission.leaves()
        for port in leaf.ports
    }


def test_every_leaf_that_sets_the_height_or_segments_gets_the_values_of_the_site() -> None:
    for leaf in ("TakeOff", "Climb"):
        body = f'<{leaf} name="up" height_m="1.5"/>'
        assert loaded(body, Site(flight_height_m=0.9))["up.height_m"] == 0.9
    values = loaded('<Sequence><Segment/><OwnEyes model="any"/></Sequence>', Site(model="teacher"))
    assert (values["Segment.model"], values["OwnEyes.model"]) == ("teacher", "teacher")


def test_a_setting_that_no_leaf_can_take_is_refused_and_one_that_none_asks_for_is_logged(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    words = "OwnEyes' writes 'flight_height_m' but has no port 'height_m'"
    with pytest.raises(InputError, match=words):
        loaded("<OwnEyes/>", Site(flight_height_m=0.9))
    (tmp_path / "hall.yaml").touch()
    with pytest.raises(InputError, match="has no port 'classes'"):
        loaded("<OwnEyes/>", Site(model="unet", classes=tmp_path / "hall.yaml"))
    assert not caplog.messages
    loaded("<Land/>", Site(flight_height_m=0.9))
    (message,) = caplog.messages
    assert "the site's height_m='0.9' has no effect: no leaf of tree" in message


def test_a_place_that_is_narrower_than_the_drone_is_refused(tmp_path: Path) -> None:
    """The body's radius is 0.2 m, and narrow passages reduce the distance by 0.1 m."""
    site = Site(clearances=Clearances(obstacle_m=0.25))
    with pytest.raises(InputError, match=r"obstacle_m: must be at least 0\.30 m.*got 0\.25"):
        app.assemble("land_only", scene="val-a", site=site)
    file = site_file(tmp_path, "margins:\n  edge_m: 0.15\n  obstacle_m: 0.4\n")
    with pytest.raises(FileError, match=r"site.yaml:2: margins.edge_m: must be at least 0\.20 m"):
        app.assemble("land_only", site=file)
    least = Clearances(obstacle_m=0.3, edge_m=0.2, unknown_m=0.2, lane_m=0.2)
    assert app.assemble("land_only", site=Site(clearances=least)).context.clearances == least
    drone = ScriptedDrone()
    drone.airframe = Airframe(body_size_m=(0.6, 0.8, 0.1))  # 0.5 m from its centre
    with pytest.raises(InputError, match=r"margins.obstacle_m: must be at least 0\.60 m.*site fil"):
        app.assemble("land_only", drone=drone)


def test_a_site_may_not_state_another_mark_than_the_scene(tmp_path: Path) -> None:
    scene = tmp_path / "mat.yaml"
    scene.write_text("helipad: {position_m: [1.6, 1.1], size_m: [0.6, 0.6, 0.05]}\n")
    site = site_file(tmp_path, "mark: {size_m: [0.6, 0.6], height_m: 0.3}")
    with pytest.raises(InputError, match=r"the site's mark .*0\.3.* is not that of scene .*0\.05"):
        app.assemble("land_only", scene=scene, site=site)


# --- rules ----------------------------------------------------------------------------------------

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
    for rules, at, margin_m in (
        ("", (0.0, 0.0), 0.5),
        (f'<Rules area="{SQUARE}"/>', (0.8, 0.0), -0.2),
        (f'<Rules area="{SQUARE}"/>', (-0.8, 0.0), -0.3),
    ):
        area = put_together(rules, site=site).held.area
        assert area is not None
        assert area.margin_m(*at) == pytest.approx(margin_m)


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


def test_a_mission_may_stay_on_the_ground(no_pad: Path) -> None:
    flown = fly(mission('<Rules land_on="none"/>', '<Sleep msec="500"/>'), scene=no_pad)
    assert (flown.outcome, flown.reason) == ("success", "the tree succeeded on the ground")
    assert flown.duration_s is None


def test_a_tree_lands_without_a_mark_and_while_the_drone_is_blind(no_pad: Path) -> None:
    """The landing of a leaf passes the hover of a stale frame, long before the abort of 15 s."""
    text = mission('<Rules land_on="any"/>', SHORT)
    flown = fly(text, scene=no_pad, faults=["video-lost@emergency landing"])
    assert (flown.outcome, flown.reason) == ("success", "landed")
    assert (flown.landing_error_m, flown.time_to_find_mark_s) == (None, None)
    assert flown.time_to_land_s is None
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
