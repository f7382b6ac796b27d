"""Site files: every field is optional, every mistake is an error."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.worlds.trees import tree_file
from uav_bt import app
from uav_bt.app.loading import load_mission
from uav_bt.app.site import Site, load_site
from uav_bt.board import CLASS_MAP, FLIGHT_HEIGHT
from uav_bt.errors import FileError, InputError
from uav_bt.lab.shipped import default_mark
from uav_bt.mission.limits import Limits
from uav_bt.mission.preflight import PreflightConfig
from uav_bt.testing import ScriptedDrone
from uav_bt.tree import Leaf, NodeRegistry, Port, Status
from uav_bt.types import Airframe, Clearances, LandingMark

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


def test_an_empty_file_and_half_a_mark_keep_what_they_do_not_state(tmp_path: Path) -> None:
    assert load_site(site_file(tmp_path, "# nothing to say\n")) == Site()
    flat = load_site(site_file(tmp_path, "mark: {height_m: 0.05}"))
    assert flat.mark == replace(default_mark(), height_m=0.05)
    large = load_site(site_file(tmp_path, "mark: {size_m: [1, 1.5]}"))
    assert large.mark == replace(default_mark(), length_m=1.0, width_m=1.5)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("hight: 1", r"site.yaml:1: hight: unknown key \(known: flight_height_m,"),
        ("mark: {size_m: [0.5]}", "site.yaml:1: mark.size_m"),
        (
            "camera: \nlimits: {speed_mps: 0}",
            "site.yaml:2: limits: speed_mps must be a positive number, got 0",
        ),
        ("camera: nowhere.yaml", r"camera: there is no file .*nowhere\.yaml"),
        ("\nmark: {kind: april}", r"2: mark: unknown landing mark 'april'"),
        ("\nmark: {kind: apriltag}", r"2: mark: landing mark 'apriltag' needs the option id"),
        ("mark: {kind: aruco, options: {id: 70, size_m: 0.3}}", "4x4_50 has the tags 0 to 49"),
        ("mark: {options: {id: 7}}", "landing mark 'helipad' has no option 'id'"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        load_site(site_file(tmp_path, text))


# --- values of a site in a tree -------------------------------------------------------------------


class Own(Leaf):
    def update(self) -> Status:
        return Status.SUCCESS


class Climb(Own):
    """A third party's independent take-off."""

    ports = (Port("height_m", float, default=2.0, doc="flight height, m"),)
    writes = (FLIGHT_HEIGHT,)


class FixedClimb(Own):
    """A take-off to a constant height."""

    writes = (FLIGHT_HEIGHT,)


class OwnEyes(Own):
    """Segment with another network."""

    ports = (Port("model", str, default="unet", doc="the network"),)
    writes = (CLASS_MAP,)


OWN = NodeRegistry.installed().with_nodes(Climb, FixedClimb, OwnEyes)


def loaded(folder: Path, body: str, site: Site) -> dict[str, object]:
    """Return the values of all ports of a tree's leaves, by node and port."""
    mission = load_mission(tree_file(folder, body), app.FlightOptions(site=site), OWN)
    return {
        f"{leaf.name}.{port.name}": leaf.port(port)
        for leaf in mission.leaves()
        for port in leaf.ports
    }


def test_every_leaf_that_sets_the_height_or_segments_gets_the_values_of_the_site(
    tmp_path: Path,
) -> None:
    for leaf in ("TakeOff", "Climb"):
        body = f'<{leaf} name="up" height_m="1.5"/>'
        assert loaded(tmp_path, body, Site(flight_height_m=0.9))["up.height_m"] == 0.9
    body = '<Sequence><Segment/><OwnEyes model="any"/></Sequence>'
    values = loaded(tmp_path, body, Site(model="teacher"))
    assert (values["Segment.model"], values["OwnEyes.model"]) == ("teacher", "teacher")


def test_a_setting_that_no_leaf_can_take_is_refused_and_one_that_none_asks_for_is_logged(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    words = "FixedClimb' writes 'flight_height_m' but has no port 'height_m'"
    with pytest.raises(InputError, match=words):
        loaded(tmp_path, "<FixedClimb/>", Site(flight_height_m=0.9))
    (tmp_path / "hall.yaml").touch()
    with pytest.raises(InputError, match="has no port 'classes'"):
        loaded(tmp_path, "<OwnEyes/>", Site(model="unet", classes=tmp_path / "hall.yaml"))
    assert not caplog.messages
    loaded(tmp_path, "<Land/>", Site(flight_height_m=0.9))
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


MAT_SCENE = """
helipad: {position_m: [1.6, 1.1], yaw_deg: 15, size_m: [0.6, 0.6, 0.05]}
take_off: {from: helipad, yaw_deg: -125}
"""


def test_a_site_may_not_state_another_mark_than_the_scene(tmp_path: Path) -> None:
    scene = tmp_path / "mat.yaml"
    scene.write_text(MAT_SCENE, encoding="utf-8")
    site = site_file(tmp_path, "mark: {size_m: [0.6, 0.6], height_m: 0.3}")
    with pytest.raises(InputError, match=r"the site's mark .*0\.3.* is not that of scene .*0\.05"):
        app.assemble("land_only", scene=scene, site=site)
