"""Faults of a flight: as texts, from a file, or drawn from the seed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sim_bridge.plain import PlainConfig
from sim_bridge.twin.scene_file import shipped_scenes
from tests.worlds.trees import document
from uav_bt import app
from uav_bt.app.drone_of_flight import check_phases, drawn, with_faults
from uav_bt.errors import FileError, InputError, UnknownNameError
from uav_bt.testing import Fault, FaultyDrone, ScriptedDrone
from uav_bt.tree import Leaf, NodeRegistry


def options(seed: int, scene: str | None = "val-a") -> app.FlightOptions:
    return drawn(app.FlightOptions(drone="plain", seed=seed, scene=scene, faults=["random"]))


def test_room_movers_and_faults_come_from_seed_and_scene() -> None:
    assert options(1) == options(1)
    many = [options(seed) for seed in range(40)]
    assert all(one.vary_room for one in many)
    assert {one.movers for one in many} == {0, 1}
    assert {len(one.faults) for one in many} == {0, 1, 2, 3}
    assert len({one.faults for one in many}) > 20
    assert options(1, "val-b") != options(1)


def test_the_draws_of_a_scene_do_not_depend_on_how_its_file_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.yaml").write_bytes(shipped_scenes()["val-a"].read_bytes())
    paths = ["mine.yaml", "./mine.yaml", str(tmp_path / "mine.yaml")]
    assert len({options(4, path).faults for path in paths}) == 1
    assert options(4, None).faults == options(4, "train-a").faults


def test_a_file_holds_one_fault_per_line_and_a_mistake_is_named_with_its_line(
    tmp_path: Path,
) -> None:
    file = tmp_path / "faults.txt"
    file.write_text("wind=0.1@explore\n\nblack@start\n")
    assert app.FlightOptions(faults=[f"@{file}"]).faults == ("wind=0.1@explore", "black@start")
    file.write_text("random\n\nwind=0.1@explore\nblakc@explore\n")
    with pytest.raises(FileError, match=r"faults\.txt:4: unknown fault 'blakc'; did you mean"):
        app.FlightOptions(faults=[f"@{file}"])


@pytest.mark.parametrize(
    ("scene", "faults"),
    [
        ("train-a", ("velocity-bias=-0.11@explore+20.4~10.6",)),
        (
            "val-b",
            (
                "drift=0.15@explore+6.7~9.2",
                "attitude-nan@center+0.5~8.1",
                "battery-drains=0.071@explore+2.2~14.1",
            ),
        ),
    ],
)
def test_the_draws_of_shipped_scenes_stay(scene: str, faults: tuple[str, ...]) -> None:
    """Campaigns of before can be flown again."""
    assert options(0, scene).faults == faults


def test_drawn_faults_leave_the_drone_a_chance() -> None:
    """Each can be parsed again, and none keeps every landing command from the drone."""
    kinds = {Fault.parse(text).kind.name for seed in range(200) for text in options(seed).faults}
    assert len(kinds) > 25
    assert not kinds & {"deaf", "no-landing", "motors-cut", "link-lost", "pilot"}
    assert not kinds & {"no-take-off", "send-raises"}


def test_a_fault_that_the_flight_did_not_have_is_among_its_warnings() -> None:
    faults = ["black@search", "black@land+500", "late=0.1@take-off~0.2"]
    report = app.fly("land_only", drone="plain", scene="val-a", faults=faults)
    assert report.outcome == "success"
    assert report.warnings[-2:] == [
        "the fault black@search had no effect: the flight did not enter the phase 'search'",
        "the fault black@land+500 had no effect: the flight ended too early in the phase 'land'",
    ]


def test_a_drone_with_a_fault_follows_its_flight_once() -> None:
    """Also one that is given as a listener, too."""
    drone = FaultyDrone(PlainConfig(seed=1).create(), Fault.parse("battery-low=0.06@hover+1"))
    around = FaultyDrone(drone, Fault.parse("black@search"))
    report = app.fly("hover_and_look", drone=around, listeners=[lambda _: [drone]])
    assert report.reason == "critical battery: 6 %"
    assert report.warnings[-1:] == [
        "the fault black@search had no effect: the flight did not enter the phase 'search'"
    ]
    wrong = FaultyDrone(PlainConfig().create(), Fault.parse("wind@hoover"))
    for one in (wrong, FaultyDrone(wrong, Fault.parse("black"))):
        with pytest.raises(UnknownNameError, match="'hoover'; did you mean 'hover'"):
            app.fly("hover_and_look", drone=one)


def test_only_leaves_that_become_the_phase_are_phases_of_faults() -> None:
    class Nudge(Leaf):
        moves = True

    text = document('<Sequence><TakeOff/><Nudge name="aside"/><Land/></Sequence>')
    mission = app.check(text, NodeRegistry.installed().with_nodes(Nudge))
    check_phases(mission, [Fault.parse("black@aside"), Fault.parse("black@take-off")])
    for phase in ("TakeOff", "Land", "Nudge"):
        with pytest.raises(UnknownNameError, match=f"'{phase}'"):
            check_phases(mission, [Fault.parse(f"black@{phase}")])


@pytest.mark.parametrize(
    ("faults", "message"),
    [
        (["wind=inf"], "'wind=inf': expected a finite level from -10 to 10 m"),
        (["black@centre"], "fault 'black@centre': 'centre'; did you mean"),
        (["random=3"], "'random' takes no level and no time"),
        ([Fault.parse("wind")], "faults: expected a valid string, got"),
        (["@no-such.txt"], "no-such"),
    ],
)
def test_mistakes_are_refused_before_anything_flies(faults: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        app.fly("land_only", drone="plain", faults=faults)


def test_a_real_drone_gets_no_faults() -> None:
    real = ScriptedDrone()
    real.live = True
    with pytest.raises(InputError, match="faults are for simulated drones"):
        with_faults(real, ["wind"])
