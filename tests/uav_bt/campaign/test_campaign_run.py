"""Whole campaigns with simulated flights: stored, resumed, reproducible."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.uav_bt.campaign.campaign_world import comparable, fly, plan
from uav_bt.campaign import CampaignResult
from uav_bt.campaign.plan import CampaignPlan
from uav_bt.campaign.runner import LocalBackend, run
from uav_bt.errors import InputError, ValueRangeError


def flown(wanted: CampaignPlan, folder: Path, *, workers: int = 2, **how: Any) -> CampaignResult:
    return run(wanted, folder, backend=LocalBackend(workers), fly=fly, **how)


def kept_seeds(folder: Path) -> list[int]:
    lines = (folder / "flights.jsonl").read_text().splitlines()
    return [json.loads(line)["seed"] for line in lines]


def test_one_and_two_workers_fly_the_same_flights(tmp_path: Path) -> None:
    wanted = plan(trees=("a.xml", "b.xml"), flights=3)
    one = flown(wanted, tmp_path / "one", workers=1)
    two = flown(wanted, tmp_path / "two", workers=2)
    assert len(one.flights) == 6
    assert [comparable(f) for f in one.flights] == [comparable(f) for f in two.flights]
    assert len({flight["wall_s"] for flight in one.flights}) == 1, "one process flies them all"


def test_a_stopped_campaign_goes_on_and_flies_nothing_twice(tmp_path: Path) -> None:
    wanted = plan(flights=4)

    def stop(_flight: Any, _now: bool) -> None:  # noqa: FBT001 - as the campaign calls it
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        flown(wanted, tmp_path, on_flight=stop)
    assert len(kept_seeds(tmp_path)) == 1
    told: list[bool] = []
    result = flown(wanted, tmp_path, on_flight=lambda _, now: told.append(now))
    assert told == [False, True, True, True]
    assert result.flown_now == 3
    assert sorted(kept_seeds(tmp_path)) == [0, 1, 2, 3]
    more = flown(plan(flights=5), tmp_path)
    assert (more.flown_now, len(more.flights)) == (1, 5)


def test_a_refused_flight_ends_the_campaign_and_is_not_kept(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such weights"):
        flown(plan(flights=9, policies={"1": "is refused"}), tmp_path, workers=1)
    assert kept_seeds(tmp_path) == [0]


def test_no_workers_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="at least one worker, got 0"):
        LocalBackend(0)
