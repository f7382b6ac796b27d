"""A campaign's folder: no stored flight is lost, and partial writes are recognized."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path
from typing import Any

import pytest

from tests.uav_bt.campaign.campaign_world import line, plan
from uav_bt.campaign.plan import CampaignPlan
from uav_bt.campaign.store import CampaignStore, read_plan
from uav_bt.errors import FileError, InputError


def keep(folder: Path, *flights: dict[str, Any], of: CampaignPlan | None = None) -> CampaignStore:
    with CampaignStore.opened(folder, of or plan(), {"code": None}) as store:
        for flight in flights:
            store.keep(flight)
    return store


def test_a_kept_flight_is_there_when_the_folder_is_opened_again(tmp_path: Path) -> None:
    keep(tmp_path / "new" / "folder", line(0))
    assert keep(tmp_path / "new" / "folder", line(1)).kept == (line(0),)
    assert keep(tmp_path / "new" / "folder").kept == (line(0), line(1))


def test_every_run_is_noted_in_the_plan(tmp_path: Path) -> None:
    keep(tmp_path)
    keep(tmp_path, of=plan(flights=9))
    read, runs = read_plan(tmp_path)
    assert (read.flights, runs) == (9, [{"code": None}, {"code": None}])


@pytest.mark.parametrize("cut", range(1, len(json.dumps(line(1))) + 1, 7))
def test_a_line_cut_anywhere_is_taken_away_and_the_rest_stays(tmp_path: Path, cut: int) -> None:
    keep(tmp_path, line(0), line(1))
    path = tmp_path / "flights.jsonl"
    whole = path.read_bytes()
    path.write_bytes(whole[:-cut])
    store = keep(tmp_path, line(1))
    assert store.repaired
    assert store.kept == (line(0),)
    assert path.read_bytes() == whole


def test_a_full_disk_leaves_nothing_of_the_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_file: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with CampaignStore.opened(tmp_path, plan(), {}) as store:
        store.keep(line(0))
        with monkeypatch.context() as disk:
            disk.setattr(os, "fsync", full)
            with pytest.raises(FileError, match="No space left on device; all flights before"):
                store.keep(line(1))
        store.keep(line(2))
    assert keep(tmp_path).kept == (line(0), line(2))


def test_another_plan_is_refused_and_nothing_is_touched(tmp_path: Path) -> None:
    keep(tmp_path, line(0))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(
        InputError, match=r"holds another campaign.*\n  profile: was lab, now ideal"
    ):
        keep(tmp_path, of=plan(profile="ideal"))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_campaign_without_a_flight_may_become_another(tmp_path: Path) -> None:
    """A command that was refused before any flight must not block the corrected one."""
    keep(tmp_path, of=plan(profile="harsh"))
    kept = keep(tmp_path, line(0), of=plan(profile="ideal"))
    assert kept.kept == ()
    found, runs = read_plan(tmp_path)
    assert found.options.profile == "ideal"
    assert len(runs) == 1


def test_two_campaigns_do_not_write_to_one_folder(tmp_path: Path) -> None:
    with (
        CampaignStore.opened(tmp_path, plan(), {}),
        pytest.raises(FileError, match="another campaign is at work in this folder"),
    ):
        keep(tmp_path)
    keep(tmp_path, line(0))


def test_flights_without_a_plan_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "flights.jsonl").write_text("mine\n")
    with pytest.raises(FileError, match=r"flights without a plan \(campaign\.json\)"):
        keep(tmp_path)
    assert (tmp_path / "flights.jsonl").read_text() == "mine\n"


def test_a_file_in_the_folders_place_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(FileError, match="cannot be written: File exists"):
        keep(tmp_path / "out")
