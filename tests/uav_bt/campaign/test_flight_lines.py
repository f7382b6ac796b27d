"""Lines of flights: valid and invalid lines."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.uav_bt.campaign.campaign_world import line
from uav_bt.campaign.flight_lines import parse_flight, read_flights
from uav_bt.errors import FileError, InputError


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "no JSON"),
        ('{"tree": "a', "no JSON: Unterminated string"),
        ("[1]", "expected a flight's JSON object, got list"),
        ("[" * 100_000, "nested deeper than 64"),
        ('{"seed": 1e999}', "1e999 is beyond a double's range"),
        (json.dumps(line(duration_s=float("nan"))), "NaN is not JSON"),
        ("{}", "'tree': Field required"),
        (json.dumps(line(scene=3)), "'scene': Input should be a valid string, got 3"),
        (json.dumps(line() | {"seed": True}), "'seed': Input should be a valid integer, got True"),
        (json.dumps(line() | {"seed": -1}), "'seed': Input should be greater than or equal to 0"),
        (json.dumps(line(outcome="fine")), "'outcome': Input should be 'success', 'collision'"),
        (json.dumps(line(duration_s="long")), "'duration_s': Input should be a valid number"),
        (json.dumps(line(duration_s=True)), "'duration_s': Input should be a valid number"),
        (json.dumps(line(reason=1)), "'reason': Input should be a valid string"),
        (json.dumps(line(tick_ms={"p50": 1.0})), "'tick_ms.p99': Field required"),
        (json.dumps(line(perception_ms={"a": {"p50": "1"}})), "'perception_ms.a.p50'"),
        (json.dumps(line(path=[[0.0, 1.0, 2.0]])), "'path.0.3': Field required"),
        (json.dumps(line(path=[[0.0, 1.0, None, 2.0]])), "'path.0.2'"),
        (json.dumps(line(coverage_curve=[[10.0, 0.1]])), "'coverage_curve.0.2'"),
        (json.dumps(line(object_errors_m=[0.1, None])), "'object_errors_m.1'"),
        (json.dumps(line(map_restarts="one")), "'map_restarts'"),
        (json.dumps(line(movers=-2)), "'movers': Input should be greater than or equal to 0"),
        (json.dumps(line(faults="wind")), "'faults': Input should be a valid"),
        (json.dumps(line(ports=7)), "'ports': Input should be an object, got 7"),
        (json.dumps(line(vary_room="yes")), "'vary_room': Input should be a valid boolean"),
    ],
)
def test_what_is_no_flight_is_refused_with_the_reason(text: str, why: str) -> None:
    with pytest.raises(InputError) as refused:
        parse_flight(text)
    assert why in str(refused.value)


def test_a_damaged_line_is_refused_with_its_number(tmp_path: Path) -> None:
    path = tmp_path / "flights.jsonl"
    path.write_bytes(b"%s\n\n\xff\xfe\n" % json.dumps(line(0)).encode())
    with pytest.raises(FileError, match=r"flights\.jsonl:3: no JSON: .*; delete this line"):
        read_flights(path)


def test_of_a_flight_that_stands_there_twice_the_later_counts(tmp_path: Path) -> None:
    path = tmp_path / "flights.jsonl"
    again = [line(0, reason="first"), line(1), line(0, reason="second", scene=None)]
    again.append(again[0] | {"reason": "third"})
    path.write_text("".join(json.dumps(one) + "\n" for one in again))
    assert [flight["reason"] for flight in read_flights(path)] == ["landed", "second", "third"]
