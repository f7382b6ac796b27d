"""Reduction of a failed flight to its fewest causes."""

from __future__ import annotations

import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from click.testing import CliRunner

from sim_bridge.twin.scene_file import load_scene
from tests.uav_bt.campaign.campaign_world import jsonl
from uav_bt.app.options import FlightOptions
from uav_bt.campaign.shrinking import FailedFlight, least
from uav_bt.cli.campaign import shrink
from uav_bt.cli.fly import fly
from uav_bt.errors import InputError


@pytest.mark.parametrize("causes", [set(), {0}, {7}, {2, 3}, {0, 11}, {1, 5, 9}])
def test_the_causes_are_left(causes: set[int]) -> None:
    """Twelve parts, of which it needs some, or none."""
    flights = 0

    def fails(parts: Sequence[int]) -> bool:
        nonlocal flights
        flights += 1
        return causes <= set(parts)

    assert set(least(range(12), fails)) == causes
    assert flights <= 30


def test_a_part_that_had_to_stay_is_tried_again_without_the_others() -> None:
    assert least(range(12), lambda left: 5 in left and (11 in left or 3 not in left)) == [5]


FAULTS = ["wind=0.05@take-off", "battery-low=0.06@center+0.3"]


def flight(**changes: object) -> dict[str, object]:
    return {
        "tree": "land_only.xml",
        "scene": "val-a",
        "seed": 3,
        "drone": "plain",
        "profile": "lab",
        "outcome": "aborted",
        "reason": "critical battery: 6 %",
        "faults": FAULTS,
        **changes,
    }


def test_a_flight_is_reduced_to_its_fault_and_can_be_flown_again(tmp_path: Path) -> None:
    """Neither wind nor boxes matter to a low battery; without frames it aborts for that reason."""
    first = flight(faults=["no-frame@center+0.3", *FAULTS])
    source = jsonl(
        tmp_path / "flights.jsonl", first, flight(seed=4), flight(seed=5, outcome="success")
    )
    plain = tmp_path / "small"
    done = CliRunner().invoke(shrink, [str(source), "--out", str(plain)])
    assert done.exit_code == 0, done.output
    assert "remaining: faults 1, movers 0, objects 0" in done.output
    assert (plain / "faults.txt").read_text() == "battery-low=0.06@center+0.3\n"
    assert load_scene(plain / "scene.yaml").objects == ()
    assert "  parts  end of the flight\n" in done.output
    assert "failed, too, and not reduced: 1; " in done.output
    again, twin = re.findall(r"drone (\w+)(.*):\n  uav-bt (fly .*)", done.output)
    assert twin[:2] == ("twin", ", with images")
    assert twin[2] == (
        f"fly land_only --scene {plain}/scene.yaml --seed 3 --profile lab "
        f"--faults @{plain}/faults.txt --out {plain}/twin"
    )
    assert again[:2] == ("plain", "")
    flown = CliRunner().invoke(fly, shlex.split(again[2])[1:])
    assert "critical battery: 6 %" in flown.output
    assert (plain / "plain" / "report.json").exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_shrinking_and_nothing_is_written(tmp_path: Path, number: int) -> None:
    source = jsonl(tmp_path / "flights.jsonl", flight())
    words = ["-m", "uav_bt", "shrink", str(source), "--out", str(tmp_path / "small")]
    with subprocess.Popen(  # noqa: S603 - our own command
        [sys.executable, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as run:
        assert run.stdout is not None
        assert "objects, movers and faults" in run.stdout.readline()
        run.stdout.readline()  # the heading
        run.stdout.readline()  # the first flight has ended, the second one flies
        run.send_signal(number)
        assert run.wait(60.0) == 1
        assert run.stderr is not None
        assert "Error: stopped by" in run.stderr.read()
    assert not (tmp_path / "small").exists()


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"details": "Segmentation fault"}, "that ended by itself, not by a crash"),
        ({"drone": "anafi"}, "got drone 'anafi': critical battery"),
    ],
)
def test_what_cannot_be_flown_again_is_refused(changes: dict[str, object], expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        FailedFlight.of(flight(**changes), "land_only", "val-a", FlightOptions())


def test_a_variant_with_a_dot_is_found_and_flights_that_succeeded_are_not(tmp_path: Path) -> None:
    ends = (flight(seed=100, scene=scene, outcome="success") for scene in ("val-a", "val-b"))
    dotted = flight(tree="land_only[v1.5].xml", scene="no-such")
    source = jsonl(tmp_path / "flights.jsonl", *ends, dotted)

    def refused(*words: str) -> str:
        given = [str(source), "--out", str(tmp_path / "small"), *words]
        done = CliRunner().invoke(shrink, given)
        assert isinstance(done.exception, InputError)
        return str(done.exception)

    assert "unknown scene 'no-such'" in refused("--tree", "land_only[v1.5]")
    words = "has no failed flight of this tree, scene and seed; `uav-bt report` lists"
    assert words in refused("--seed", "100")


@pytest.mark.parametrize(
    "flown",
    [
        {"ports": {"TakeOff.height_m": "1.2"}, "variables": {"laps": 3}},
        {"drone": "twin", "exact_masks": True},
        {"drone": "twin", "exact_masks": False},
    ],
)
def test_a_flight_is_shrunk_with_what_was_changed_for_it(flown: dict[str, object]) -> None:
    options = FlightOptions(drone="plain", ports={"TakeOff.height_m": 1.0})
    failed = FailedFlight.of(flight(**flown), "land_only", "val-a", options)
    assert {name: getattr(failed.options, name) for name in flown} == flown


def test_a_flight_that_no_longer_fails_is_refused(tmp_path: Path) -> None:
    source = jsonl(tmp_path / "flights.jsonl", flight(faults=[]))
    done = CliRunner().invoke(shrink, [str(source), "--out", str(tmp_path / "small")])
    assert isinstance(done.exception, InputError)
    assert "does not end with 'aborted: critical battery: 6 %' any more" in str(done.exception)
    assert not (tmp_path / "small").exists()


def test_objects_of_a_lab_are_parts_that_can_be_left_out() -> None:
    line = flight(scene="depot-val-a")
    failed = FailedFlight.of(line, "land_only", "depot-val-a", FlightOptions())
    objects = [part for part in failed.parts() if part[0] == "objects"]
    assert len(objects) == 14
    smaller = failed.with_parts(objects[:2])
    assert smaller.scene.objects == failed.scene.objects[:2]
