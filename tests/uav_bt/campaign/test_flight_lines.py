"""Lines of flights: valid and invalid lines, and their comparable part."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.uav_bt.campaign.campaign_world import line
from uav_bt.campaign.flight_lines import comparable, key_of, parse_flight, read_flights
from uav_bt.errors import InputError


def test_flights_without_a_path_are_read(tmp_path: Path) -> None:
    """A report needs only the result of a flight; its positions are optional."""
    kept = tmp_path / "flights.jsonl"
    kept.write_text("".join(json.dumps(line(seed)) + "\n" for seed in range(3)), encoding="utf-8")

    read = read_flights(kept)

    assert read.damaged == ()
    assert [flight["seed"] for flight in read.flights] == [0, 1, 2]
    assert not any("path" in flight for flight in read.flights)


def test_a_flight_is_identified_by_tree_scene_and_seed() -> None:
    assert key_of(line(7, scene=None)) == ("one.xml", None, 7)


def test_what_depends_on_the_machine_is_not_compared() -> None:
    times = {"p50": 1.0, "p99": 2.0, "max": 3.0}
    one = line(wall_s=3.0, tick_ms=times, perception_ms={"a": times}, slow_leaves={"x": 1.0})
    assert comparable(one) == line()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "no JSON"),
        ('{"tree": "a', "no JSON: Unterminated string"),
        ("[1]", "expected a flight's JSON object, got list"),
        ("[" * 100_000, "nested deeper than 64"),
        ('{"more": ' + "[" * 70 + "]" * 70 + "}", "nested deeper than 64"),
        ('{"seed": 1e999}', "1e999 is beyond a double's range"),
        ('{"seed": ' + "9" * 5000 + "}", "no JSON: Exceeds the limit"),
        (json.dumps(line(duration_s=float("nan"))), "NaN is not JSON"),
        ("{}", "needs 'tree' and 'scene'"),
        (json.dumps(line(scene=3)), "needs 'tree' and 'scene'"),
        (json.dumps(line() | {"seed": True}), "'seed' is a whole number from 0, got True"),
        (json.dumps(line() | {"seed": -1}), "'seed' is a whole number from 0, got -1"),
        (json.dumps(line(outcome="fine")), "unknown outcome 'fine'"),
        (json.dumps(line(outcome=["success"])), "unknown outcome"),
        (json.dumps(line(duration_s="long")), "'duration_s' must be a number or null, got 'long'"),
        (json.dumps(line(duration_s=True)), "'duration_s' must be a number"),
        ('{"tree": "a", "scene": "b", "seed": 0, "outcome": "success", "wall_s": 1e999}', "1e999"),
        (json.dumps(line(reason=1)), "'reason' must be a text"),
        (json.dumps(line(tick_ms=3)), "'tick_ms' must hold"),
        (json.dumps(line(tick_ms={"p50": 1.0})), "'tick_ms' must hold"),
        (json.dumps(line(perception_ms=[1])), "'perception_ms' must hold"),
        (json.dumps(line(perception_ms={"a": {"p50": "1"}})), "'perception_ms' must hold"),
        (json.dumps(line(path=[[0.0, 1.0, 2.0]])), "'path' must be a list of"),
        (json.dumps(line(path=[[0.0, 1.0, None, 2.0]])), "'path' must be a list of"),
        (json.dumps(line(path="home")), "'path' must be a list of"),
        (json.dumps(line(coverage_curve=[[10.0, 0.1]])), "'coverage_curve' must be a list of"),
        (json.dumps(line(object_errors_m=[0.1, None])), "'object_errors_m' must be a list of"),
        (json.dumps(line(map_restarts="one")), "'map_restarts' must be a number or null"),
        (json.dumps(line(coverage_seen="all")), "'coverage_seen' must be a number or null"),
    ],
)
def test_what_is_no_flight_is_refused_with_the_reason(text: str, why: str) -> None:
    with pytest.raises(InputError) as refused:
        parse_flight(text)
    assert why in str(refused.value)


def test_damaged_lines_are_left_out_and_named(tmp_path: Path) -> None:
    path = tmp_path / "flights.jsonl"
    path.write_bytes(
        b"%s\n\n{half\n\xff\xfe\n%s\n"
        % (json.dumps(line(0)).encode(), json.dumps(line(1)).encode())
    )
    read = read_flights(path)
    assert [flight["seed"] for flight in read.flights] == [0, 1]
    first, second = read.damaged
    assert first.startswith(f"{path}:3: no JSON")
    assert second.startswith(f"{path}:4: ")


def test_of_a_flight_that_stands_there_twice_the_later_counts(tmp_path: Path) -> None:
    path = tmp_path / "flights.jsonl"
    again = [line(0, reason="first"), line(1), line(0, reason="second")]
    path.write_text("".join(json.dumps(one) + "\n" for one in again))
    assert [flight["reason"] for flight in read_flights(path).flights] == ["landed", "second"]
