"""Site files: every field is optional, every mistake is an error."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from behaviours.fly.take_off import TakeOff
from tests.worlds.trees import tree_file
from uav_bt import app
from uav_bt.app.loading import load_mission
from uav_bt.app.site import Site, load_site
from uav_bt.board import CLASS_MAP, FLIGHT_HEIGHT
from uav_bt.errors import FileError, InputError
from uav_bt.lab.shipped import default_mark
from uav_bt.mission.limits import Limits
from uav_bt.mission.preflight import PreflightConfig
from uav_bt.mission.tick import TickRecord
from uav_bt.testing import ScriptedDrone
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, Status
from uav_bt.types import Airframe, Clearances, LandingMark, MissionPhase

FULL = """
flight_height_m: 1.2
take_off_surface_m: 0.4
camera: camera.yaml
network: {model: hall.onnx, classes: classes.yaml}
ground: [carpet, background]
limits: {speed_mps: 0.6, climb_mps: 0.5, yaw_rate_radps: 1.2, ceiling_m: 2}
mark: {size_m: [0.6, 0.4], height_m: 0.05}
margins: {obstacle_m: 0.5, edge_m: 0.4, unknown_m: 0.3, lane_m: 0.8}
battery: {take_off: 0.4, critical: 0.15}
link: {take_off: 0.6}
video: {latency_s: 0.2}
ports: {http: 8080, rtsp: 8554}
return_home: off
"""


def site_file(folder: Path, text: str) -> Path:
    path = folder / "site.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_an_empty_file_is_a_site_like_any(tmp_path: Path) -> None:
    assert load_site(site_file(tmp_path, "# nothing to say\n")) == Site()


def test_all_keys_of_a_site_file(tmp_path: Path) -> None:
    for name in ("camera.yaml", "hall.onnx", "classes.yaml"):
        (tmp_path / name).touch()
    assert load_site(site_file(tmp_path, FULL)) == Site(
        flight_height_m=1.2,
        take_off_surface_m=0.4,
        camera=tmp_path / "camera.yaml",
        model=str(tmp_path / "hall.onnx"),
        classes=tmp_path / "classes.yaml",
        ground=("carpet", "background"),
        limits=Limits(
            speed_mps=0.6, climb_mps=0.5, yaw_rate_radps=1.2, ceiling_m=2.0, critical_battery=0.15
        ),
        mark=LandingMark(length_m=0.6, width_m=0.4, height_m=0.05),
        clearances=Clearances(obstacle_m=0.5, edge_m=0.4, unknown_m=0.3, lane_m=0.8),
        preflight=PreflightConfig(battery=0.4, link=0.6),
        video_latency_s=0.2,
        http_port=8080,
        rtsp_port=8554,
        return_home=False,
    )


def test_a_shipped_network_is_called_by_its_name(tmp_path: Path) -> None:
    assert load_site(site_file(tmp_path, "network: {model: teacher}")).model == "teacher"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("hight: 1", r"site.yaml:1: hight: unknown key \(known: flight_height_m,"),
        ("limits: {sped_mps: 1}", r"limits.sped_mps: unknown key; did you mean 'speed_mps'"),
        ("mark: {size_m: [0.5]}", "site.yaml:1: mark.size_m"),
        ("margins: {obstacle: 1}", "margins.obstacle: unknown key; did you mean 'obstacle_m'"),
        ("margins: {edge_m: wide}", "margins.edge_m: expected a number, got 'wide'"),
        (
            "camera: \nlimits: {speed_mps: 0}",
            "site.yaml:2: limits: speed_mps must be a positive number, got 0",
        ),
        ("limits: {ceiling_m: .nan}", "limits.ceiling_m: expected a number, got '.nan'"),
        ("flight_height_m: 0", "expected a number greater than 0, got '0'"),
        (
            "battery: {take_off: 40}",
            "battery.take_off: expected a number less than or equal to 1, got '40'",
        ),
        ("camera: nowhere.yaml", r"camera: there is no file .*nowhere\.yaml"),
        ("network: {model: gone.onnx}", r"model: there is no file .*gone\.onnx"),
        ("ground: carpet", "ground: expected a list, got 'carpet'"),
        (
            "ports: {http: 99999}",
            "ports.http: expected a number less than or equal to 65535, got '99999'",
        ),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        load_site(site_file(tmp_path, text))


EXPLORE = """
<ReactiveSequence>
  <Segment/>
  <Sequence>
    <TakeOff height_m="1.5"/>
    <ForceSuccess><Timeout msec="9000"><Repeat num_cycles="-1">
      <Fallback><Explore/><Avoid/></Fallback>
    </Repeat></Timeout></ForceSuccess>
    <AlwaysFailure/>
  </Sequence>
</ReactiveSequence>
"""


def test_the_flight_height_of_a_site_holds_after_the_take_off(tmp_path: Path) -> None:
    """No step returns to the height in the tree."""
    heights: list[float] = []

    class Heights:
        def on_tick(self, record: TickRecord) -> None:
            if record.phase == MissionPhase.EXPLORE and record.override is None:
                heights.append(record.observation.state.height_above_ground_m)

    options = app.FlightOptions(
        scene="val-a",
        profile="ideal",
        exact_masks=True,
        image_size_px=(160, 90),
        site=Site(flight_height_m=1.2),
    )
    app.fly(tree_file(tmp_path, EXPLORE), options, listeners=[lambda _: [Heights()]])
    assert len(heights) > 50
    assert min(heights) > 1.1
    assert max(heights) < 1.3


# --- values of a site in a tree -------------------------------------------------------------------


class SlowTakeOff(TakeOff):
    """The shipped take-off in a subclass with another name."""


class Climb(Leaf):
    """A third party's independent take-off."""

    ports = (Port("height_m", float, default=2.0, doc="flight height, m"),)
    writes = (FLIGHT_HEIGHT,)

    def update(self) -> Status:
        return Status.SUCCESS


class FixedClimb(Leaf):
    """A take-off to a constant height."""

    writes = (FLIGHT_HEIGHT,)

    def update(self) -> Status:
        return Status.SUCCESS


class OwnEyes(Leaf):
    """Segment with another network."""

    ports = (Port("model", str, default="unet", doc="the network"),)
    writes = (CLASS_MAP,)

    def update(self) -> Status:
        return Status.SUCCESS


OWN = NodeRegistry.installed().with_nodes(SlowTakeOff, Climb, FixedClimb, OwnEyes)


def loaded(tmp_path: Path, body: str, site: Site) -> dict[str, object]:
    mission = load_mission(tree_file(tmp_path, body), app.FlightOptions(site=site), OWN)
    return port_values(mission)


def port_values(mission: MissionTree) -> dict[str, object]:
    """Return the values of all ports of a tree's leaves, by node and port."""
    return {
        f"{leaf.name}.{port.name}": leaf.port(port)
        for leaf in mission.leaves()
        for port in leaf.ports
    }


@pytest.mark.parametrize("leaf", ["TakeOff", "SlowTakeOff", "Climb"])
def test_every_leaf_that_sets_the_flight_height_gets_the_sites(tmp_path: Path, leaf: str) -> None:
    values = loaded(tmp_path, f'<{leaf} name="up" height_m="1.5"/>', Site(flight_height_m=0.9))
    assert values["up.height_m"] == 0.9


def test_every_leaf_that_segments_gets_the_sites_network(tmp_path: Path) -> None:
    body = '<Sequence><Segment/><OwnEyes model="any"/></Sequence>'
    values = loaded(tmp_path, body, Site(model="teacher"))
    assert (values["Segment.model"], values["OwnEyes.model"]) == ("teacher", "teacher")


def test_a_composed_tree_gets_the_sites_height_as_well() -> None:
    tree = MissionTree(SlowTakeOff("up", height_m=1.5), name="composed")
    mission = load_mission(tree, app.FlightOptions(site=Site(flight_height_m=0.9)))
    assert port_values(mission)["up.height_m"] == 0.9


def test_a_take_off_that_cannot_take_the_sites_height_is_refused(tmp_path: Path) -> None:
    words = "FixedClimb' writes 'flight_height_m' but has no port 'height_m'"
    with pytest.raises(InputError, match=words):
        loaded(tmp_path, "<FixedClimb/>", Site(flight_height_m=0.9))


def test_class_names_for_a_leaf_that_maps_none_are_refused(tmp_path: Path) -> None:
    (tmp_path / "hall.yaml").touch()
    site = Site(model="unet", classes=tmp_path / "hall.yaml")
    with pytest.raises(InputError, match="has no port 'classes'"):
        loaded(tmp_path, "<OwnEyes/>", site)


def test_a_setting_that_no_leaf_asks_for_is_logged(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    loaded(tmp_path, "<Land/>", Site(flight_height_m=0.9))
    assert len(caplog.messages) == 1
    assert "the site's height_m='0.9' has no effect: no leaf of tree" in caplog.text


def test_the_mark_and_the_clearances_of_a_site_reach_the_leaves() -> None:
    """A real drone has no scene, so that the site describes the mark."""
    site = Site(mark=replace(default_mark(), height_m=0.05), clearances=Clearances(obstacle_m=0.5))
    flight = app.assemble("land_only", drone=ScriptedDrone(), site=site)

    assert flight.context.mark.height_m == 0.05
    assert flight.context.clearances.obstacle_m == 0.5


def test_a_place_that_is_narrower_than_the_drone_is_refused() -> None:
    """The body's radius is 0.2 m, and narrow passages reduce the distance by 0.1 m."""
    site = Site(clearances=Clearances(obstacle_m=0.25))
    with pytest.raises(InputError, match=r"obstacle_m: must be at least 0\.30 m.*got 0\.25"):
        app.assemble("land_only", app.FlightOptions(scene="val-a", site=site))


def test_a_place_that_is_too_narrow_is_refused_with_its_line(tmp_path: Path) -> None:
    file = site_file(tmp_path, "margins:\n  edge_m: 0.15\n  obstacle_m: 0.4\n")
    with pytest.raises(FileError, match=r"site.yaml:2: margins.edge_m: must be at least 0\.20 m"):
        app.assemble("land_only", app.FlightOptions(site=file))


def test_the_least_that_the_drone_needs_is_enough() -> None:
    place = Clearances(obstacle_m=0.3, edge_m=0.2, unknown_m=0.2, lane_m=0.2)
    options = app.FlightOptions(site=Site(clearances=place))
    assert app.assemble("land_only", options).context.clearances == place


def test_a_large_drone_needs_more_than_the_default(tmp_path: Path) -> None:
    """The radius of its hull is 0.5 m."""
    drone = ScriptedDrone()
    drone.airframe = Airframe(body_size_m=(0.6, 0.8, 0.1))
    with pytest.raises(
        InputError, match=r"margins.obstacle_m: must be at least 0\.60 m.*site file"
    ):
        app.assemble("land_only", app.FlightOptions(drone=drone))
    text = "margins: {obstacle_m: 0.6, edge_m: 0.5, unknown_m: 0.5, lane_m: 0.7}"
    options = app.FlightOptions(drone=drone, site=site_file(tmp_path, text))
    assert app.assemble("land_only", options).context.clearances.obstacle_m == 0.6


def test_half_a_mark_keeps_the_other_half(tmp_path: Path) -> None:
    flat = load_site(site_file(tmp_path, "mark: {height_m: 0.05}"))
    assert flat.mark == replace(default_mark(), height_m=0.05)
    large = load_site(site_file(tmp_path, "mark: {size_m: [1, 1.5]}"))
    assert large.mark == replace(default_mark(), length_m=1.0, width_m=1.5)


def test_a_tag_as_mark(tmp_path: Path) -> None:
    text = "mark: {kind: apriltag, height_m: 0, options: {family: 36h11, id: 7, size_m: 0.3}}"
    site = load_site(site_file(tmp_path, text))

    assert site.mark is not None
    assert (site.mark.kind, site.mark.height_m) == ("apriltag", 0.0)
    assert site.mark.options == {"family": "36h11", "id": 7, "size_m": 0.3}
    flight = app.assemble("land_only", drone=ScriptedDrone(), site=site)
    assert flight.context.mark == site.mark


@pytest.mark.parametrize(
    ("mark", "message"),
    [
        ("{kind: april}", r"2: mark: unknown landing mark 'april'"),
        ("{kind: apriltag}", r"2: mark: landing mark 'apriltag' needs the option id"),
        ("{kind: aruco, options: {id: 70, size_m: 0.3}}", r"family 4x4_50 has the tags 0 to 49"),
        ("{options: {id: 7}}", r"2: mark: landing mark 'helipad' has no option 'id'"),
    ],
)
def test_a_wrong_mark_is_refused_before_a_flight(tmp_path: Path, mark: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        load_site(site_file(tmp_path, f"flight_height_m: 1.2\nmark: {mark}"))


def test_a_wrong_mark_in_python_is_refused_before_a_flight() -> None:
    site = Site(mark=replace(default_mark(), kind="apriltag"))
    with pytest.raises(InputError, match="needs the option id"):
        app.assemble("land_only", drone=ScriptedDrone(), site=site)


def test_a_mark_that_no_leaf_looks_for_is_no_mistake(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """An emergency landing also needs the height."""
    loaded(tmp_path, "<EmergencyLand/>", Site(mark=default_mark()))
    assert caplog.messages == []


MAT_SCENE = """
helipad: {position_m: [1.6, 1.1], yaw_deg: 15, size_m: [0.6, 0.6, 0.05]}
take_off: {from: helipad, yaw_deg: -125}
"""


def test_it_lands_on_the_mat_of_a_scene(tmp_path: Path) -> None:
    scene = tmp_path / "mat.yaml"
    scene.write_text(MAT_SCENE, encoding="utf-8")
    report = app.fly("land_only", drone="plain", scene=scene, seed=1)
    assert report.outcome == "success"
    assert report.landing_error_m is not None
    assert report.landing_error_m < 0.15


def test_a_site_whose_mark_is_not_the_scenes_is_refused(tmp_path: Path) -> None:
    scene = tmp_path / "mat.yaml"
    scene.write_text(MAT_SCENE, encoding="utf-8")
    site = site_file(tmp_path, "mark: {size_m: [0.6, 0.6], height_m: 0.3}")
    with pytest.raises(InputError, match=r"the site's mark .*0\.3.* is not that of scene .*0\.05"):
        app.assemble("land_only", scene=scene, site=site)
