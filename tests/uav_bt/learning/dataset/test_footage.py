"""Footage from a record is what `--footage` keeps of the same flight."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from perception.footage.file import Footage, read_footage
from tests.uav_bt.learning.dataset.dataset_world import MISSION, NoisyDrone
from uav_bt import app
from uav_bt.app.footage import flight_footage
from uav_bt.errors import FileError
from uav_bt.learning.dataset.footage import footage_of


def test_a_record_holds_the_footage_of_its_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tree = tmp_path / "mission.xml"
    tree.write_text(
        f'<root BTCPP_format="4"><BehaviorTree ID="Main">{MISSION}</BehaviorTree></root>',
        encoding="utf-8",
    )
    monkeypatch.setattr("uav_bt.app.flight.make_drone", lambda _: NoisyDrone())
    with flight_footage(tmp_path / "flight.npz") as kept:
        app.fly(tree, app.FlightOptions(record=tmp_path / "flight.mcap"), listeners=kept)
    live, recorded = read_footage(tmp_path / "flight.npz"), footage_of(tmp_path / "flight.mcap")
    assert len(recorded) > 20
    for item in fields(Footage):
        one, other = getattr(live, item.name), getattr(recorded, item.name)
        np.testing.assert_equal(one, other, err_msg=item.name)
    assert len(footage_of(tmp_path / "flight.npz")) == len(live)


def test_what_is_no_flight_is_refused(tmp_path: Path) -> None:
    for name in ("absent.mcap", "absent.npz"):
        with pytest.raises(FileError):
            footage_of(tmp_path / name)
