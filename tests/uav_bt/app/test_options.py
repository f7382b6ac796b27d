"""Options of a flight: checked when set; objects among them have a name."""

from __future__ import annotations

import math
import pydoc
import re
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_bridge.olympe import AnafiConfig
from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.plain import PlainConfig
from sim_bridge.twin import TwinConfig
from tests.uav_bt.campaign.campaign_world import plan
from tests.worlds.tables import cases
from uav_bt import app
from uav_bt.answers import Advance, Answer
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.mission.limits import Limits
from uav_bt.mission.preflight import PreflightConfig
from uav_bt.protocols import PolicyView
from uav_bt.testing import Fault, ScriptedDrone
from uav_bt.types import Airframe, Clearances


class Ahead:
    """Flies straight ahead."""

    def decide(self, view: PolicyView) -> Answer:
        del view
        return Advance(forward_m=0.3)


@dataclass(frozen=True, kw_only=True)
class NotADrone:
    camera: int = 3


@pytest.mark.parametrize(
    ("given", "message"),
    [
        *cases("refusals")["options"],
        (
            {"policies": {"Explore": max}},
            r"policies\['Explore'\]: expected a policy's name, or an object with `decide`, got",
        ),
        ({"policies": {"Explore": Ahead}}, r"got the class Ahead: write Ahead\(\.\.\.\)"),
        ({"faults": [Fault.parse("wind")]}, "faults: expected a valid string, got"),
        ({"drone": TwinConfig}, r"got the class TwinConfig: write TwinConfig\(\.\.\.\)"),
        ({"drone": NotADrone()}, r"NotADrone lacks clock, referee, scene, .*disconnect"),
        (
            {"drone": TwinConfig(), "scene": "val-a"},
            r"TwinConfig is flown as it is and takes no scene, got 'val-a': set it there",
        ),
        (
            {"drone": TwinConfig(), "image_size_px": (320, 180)},
            r"takes no image_size_px, got \(320, 180\)",
        ),
        (
            {"drone": ScriptedDrone(), "profile": "harsh"},
            r"ScriptedDrone .* takes no profile, got 'harsh'",
        ),
        (
            {"drone": PlainConfig(seed=6), "seed": 5},
            r"seed: expected one seed, got 5 for the flight and 6 in the drone's PlainConfig",
        ),
    ],
)
def test_a_value_that_cannot_be_used_is_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        app.FlightOptions(**given)
    assert "\n" not in str(caught.value)


SETTINGS = (
    *(app.Limits, app.RunnerConfig, app.JudgeConfig, app.Site),
    *(PreflightConfig, Clearances, plan),
)
"""What makes the settings that users hand over; all of its numbers have defaults."""


@pytest.mark.parametrize("make", SETTINGS)
def test_every_number_is_checked_when_it_is_given(make: Callable[..., Any]) -> None:
    kinds = fields(make if isinstance(make, type) else type(make()))
    stated = {one.name: str(one.type).removeprefix("Annotated[") for one in kinds}
    names = [name for name, kind in stated.items() if kind.startswith(("int", "float"))]
    assert names
    for name, wrong in product(names, (math.nan, math.inf, -math.inf, -7, "3", True)):
        with pytest.raises(ValueRangeError, match=f"^{name} must be .*number.*, got {wrong!r}"):
            make(**{name: wrong})


@pytest.mark.parametrize(
    ("make", "given", "message"),
    [
        (app.RunnerConfig, {"landing_grace_s": 0.0}, "must be a positive number, got 0.0"),
        (app.RunnerConfig, {"tick_s": 1.5}, "must be a positive number up to 1, got 1.5"),
        (app.Limits, {"critical_battery": 1.5}, "must be a number from 0 up to 1, got 1.5"),
        (app.Site, {"http_port": 70_000}, "must be a positive whole number up to 65535, got 70000"),
        (plan, {"flights": 0}, "must be a positive whole number, got 0"),
        (app.JudgeConfig, {"land_on": "nowhere"}, "unknown land_on 'nowhere' .*ground, mark, none"),
        (app.TreeFolders, {"trees": "parts"}, "trees: expected a list of folders, got 'parts'"),
        (app.TreeFolders, {"trees": [3]}, "trees: expected a folder, as str or Path, got 3"),
        (app.TreeFolders, {"include_root": ""}, "include_root: expected a folder"),
        (app.TreeFolders, {"packages": ["robot"]}, "expected folders by the name of a ROS package"),
        (app.TreeFolders, {"packages": {"robot": None}}, r"packages\['robot'\]: expected a folder"),
    ],
)
def test_values_of_nested_settings_are_refused(
    make: Callable[..., Any], given: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        make(**given)


def test_a_named_drone_gets_its_address_and_what_it_may_need() -> None:
    """Everything after the first colon is the address."""
    limits = Limits(speed_mps=0.4)
    real: Any = app.make_drone(app.FlightOptions(drone="anafi:10.0.0.1:44444", limits=limits))
    assert (real._config.address, real._config.speed_limit_mps) == ("10.0.0.1:44444", 0.4)
    twin: Any = app.make_drone(app.FlightOptions(scene="val-a", profile="harsh"))
    assert (twin.scene.name, twin.profile.video_latency_s) == ("val-a", 0.28)
    with pytest.raises(InputError, match="drone 'twin' takes no address, got 'here'"):
        app.make_drone(app.FlightOptions(drone="twin:here"))


@pytest.mark.parametrize(
    ("drone", "flag", "option", "value"),
    [
        ("anafi", "--scene", "scene", "val-a"),
        ("anafi", "--movers", "movers", 2),
        ("anafi:127.0.0.1:1", "--profile", "profile", "harsh"),
        ("anafi", "--seed", "seed", 9),
        ("sphinx", "--realtime", "realtime", True),
        ("plain", "--image-size", "image_size_px", (320, 180)),
    ],
)
def test_foreign_options_are_refused(drone: str, flag: str, option: str, value: Any) -> None:
    words = (
        f"drone '{drone.partition(':')[0]}' takes no {flag} ({option} in Python), got {value!r}: "
        "leave it out, as this drone has no such setting"
    )
    with pytest.raises(InputError, match=re.escape(words)):
        app.make_drone(app.FlightOptions(drone=drone, **{option: value}))


@pytest.mark.parametrize(("own", "seed"), [(6, 0), (0, 6), (6, 6)])
def test_a_flight_and_its_drone_have_one_seed(own: int, seed: int) -> None:
    options = app.FlightOptions(drone=PlainConfig(seed=own), seed=seed)
    assert options.seed == 6
    named = app.FlightOptions(drone="plain", scene="train-a", seed=6)
    one, other = app.make_drone(options), app.make_drone(named)
    one.connect()
    other.connect()
    assert one.observe().state == other.observe().state


def test_files_are_texts_or_paths_and_numbers_may_be_numpys(tmp_path: Path) -> None:
    site = tmp_path / "site.yaml"
    site.write_text("flight_height_m: 1.1\n", encoding="utf-8")
    by_text = app.FlightOptions(record="f.mcap", camera="c.yaml", site=str(site), scene="s.yaml")
    by_path = app.FlightOptions(
        record=Path("f.mcap"), camera=Path("c.yaml"), site=site, scene=Path("s.yaml")
    )
    assert by_text == by_path
    assert by_text.site == app.Site(flight_height_m=1.1)
    assert repr(app.FlightOptions(site=site)).startswith("FlightOptions(site=Site(flight_height")
    options = replace(by_text, seed=np.int64(7), image_size_px=[320, 180])  # type: ignore[arg-type]
    assert options.site is by_text.site
    assert (options.seed, options.image_size_px) == (7, (320, 180))
    assert type(options.seed) is int


def test_objects_are_called_by_their_class() -> None:
    first, second = Ahead(), Ahead()
    options = app.FlightOptions(
        drone=TwinConfig(),
        policies={"Explore": first, "Avoid": first, "Main/back": second, "Advise": "corridor"},
    )
    name = f"{__name__}.Ahead"
    assert options.drone_name == "sim_bridge.twin.TwinConfig"
    assert options.policy_names == {
        "Explore": name,
        "Avoid": name,
        "Main/back": f"{name}#2",
        "Advise": "corridor",
    }
    assert options.policy_objects[name] is first
    assert options.policy_objects[f"{name}#2"] is second


def test_keywords_replace_values_of_options_that_several_flights_share() -> None:
    shared = app.FlightOptions(scene="val-a", profile="ideal")
    flight = app.assemble("land_only", shared, seed=7)
    assert flight.options == app.FlightOptions(scene="val-a", profile="ideal", seed=7)
    assert shared.seed == 0


def test_objects_and_configurations_fly_as_they_are_but_for_the_place() -> None:
    """A drone with propeller guards; a site replaces what a configuration says of the place."""
    drone = ScriptedDrone()
    drone.airframe = wide = Airframe(body_size_m=(0.4, 0.4, 0.12), command_delay_s=0.2)
    flight = app.assemble("land_only", drone=drone)
    assert flight.drone is drone
    assert flight.context.airframe is wide
    twin: Any = app.make_drone(app.FlightOptions(drone=TwinConfig(scene="val-b", profile="harsh")))
    assert (twin.scene.name, twin.profile.video_latency_s) == ("val-b", 0.28)
    given = AnafiConfig(speed_limit_mps=0.9, address="127.0.0.1", rtsp_port=8554, airframe=wide)
    site = app.Site(take_off_surface_m=0.4, http_port=8080, limits=Limits(speed_mps=0.5))
    alone: Any = app.make_drone(app.FlightOptions(drone=given))
    assert alone._config is given
    assert alone.airframe is wide
    placed: Any = app.make_drone(app.FlightOptions(drone=given, site=site))
    config: AnafiConfig = placed._config
    assert (config.address, config.http_port, config.rtsp_port) == ("127.0.0.1", 8080, 8554)
    assert (config.take_off_surface_m, config.speed_limit_mps) == (0.4, 0.5)


@pytest.mark.parametrize(
    "documented",
    [
        *(app.FlightOptions, app.JudgeConfig, app.Limits, app.RunnerConfig),
        *(TwinConfig, OlympeConfig),
    ],
)
def test_help_says_what_each_field_is(documented: Any) -> None:
    text = pydoc.render_doc(documented, renderer=pydoc.plaintext)
    section = text.partition("Attributes:")[2]
    for field in fields(documented):
        assert f" {field.name}: " in section, field.name
