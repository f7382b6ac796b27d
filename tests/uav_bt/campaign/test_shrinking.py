"""Reduction of a failed flight to its fewest causes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pytest
from click.testing import CliRunner

from sim_bridge.twin.scene_file import load_scene
from uav_bt.app.options import FlightOptions
from uav_bt.campaign.shrinking import FailedFlight, least
from uav_bt.cli.shrink import shrink_command
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
    assert flights <= 60


def flight(**changes: object) -> dict[str, object]:
    return {
        "tree": "land_only.xml",
        "scene": "val-a",
        "seed": 3,
        "drone": "plain",
        "profile": "lab",
        "outcome": "aborted",
        "reason": "critical battery: 6 %",
        "faults": ["wind=0.05@take-off", "battery-low=0.06@center+0.3"],
        **changes,
    }


def test_a_flight_is_reduced_to_its_fault_and_can_be_flown_again(tmp_path: Path) -> None:
    """Neither the wind nor any box matters to a low battery."""
    source = tmp_path / "flights.jsonl"
    source.write_text(json.dumps(flight()) + "\n")
    plain = tmp_path / "small"
    done = CliRunner().invoke(shrink_command, [str(source), "--out", str(plain)])
    assert done.exit_code == 0, done.output
    assert "left: faults 1, movers 0, boxes 0" in done.output
    assert (plain / "faults.txt").read_text() == "battery-low=0.06@center+0.3\n"
    assert load_scene(plain / "scene.yaml").boxes == ()
    assert f"uav-bt fly land_only --scene {plain}/scene.yaml --seed 3" in done.output


def test_a_flight_of_a_variant_keeps_its_values() -> None:
    flown = flight(ports={"TakeOff.height_m": "1.2"}, variables={"laps": 3})
    options = FlightOptions(drone="plain", ports={"TakeOff.height_m": 1.0})
    failed = FailedFlight.of(flown, "land_only", "val-a", options)
    assert failed.options.ports == {"TakeOff.height_m": "1.2"}
    assert failed.options.variables == {"laps": 3}


def test_a_flight_that_succeeded_or_no_longer_fails_is_refused(tmp_path: Path) -> None:
    options = FlightOptions(drone="plain")
    with pytest.raises(InputError, match="this flight succeeded"):
        FailedFlight.of(flight(outcome="success"), "land_only", "val-a", options)
    source = tmp_path / "flights.jsonl"
    source.write_text(json.dumps(flight(faults=[])) + "\n")
    done = CliRunner().invoke(shrink_command, [str(source), "--out", str(tmp_path / "small")])
    assert isinstance(done.exception, InputError)
    assert "does not end with 'aborted' any more" in str(done.exception)
    assert not (tmp_path / "small").exists()


def test_objects_of_a_lab_are_left_out_one_by_one() -> None:
    failed = FailedFlight.of(
        flight(scene="depot-val-a"), "land_only", "depot-val-a", FlightOptions()
    )
    objects = [part for part in failed.parts() if part[0] == "object"]
    assert len(objects) == 14
    smaller = failed.with_parts(objects[:2])
    assert smaller.scene.objects == failed.scene.objects[:2]
