"""The import of the SDK."""

from __future__ import annotations

import logging
import sys
from types import ModuleType

import pytest

from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.drone import OlympeDrone
from sim_bridge.olympe.sdk import load_sdk
from tests.sim_bridge.olympe.fake_olympe import config
from uav_bt.errors import MissingDependencyError


def test_a_missing_sdk_is_named_with_its_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "olympe", None)
    with pytest.raises(MissingDependencyError, match=r"Parrot's SDK cannot be imported"):
        load_sdk()
    assert logging.root.manager.disable == logging.NOTSET


def test_a_missing_sdk_is_reported_before_the_drone_is_looked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "olympe", None)
    probed: list[OlympeConfig] = []
    drone = OlympeDrone(config(), probe_first=lambda asked: bool(probed.append(asked)))
    with pytest.raises(MissingDependencyError, match=r"Parrot's SDK .*docs/anafi\.md"):
        drone.connect()
    assert probed == []


def test_the_sdks_log_becomes_ours(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    fake = ModuleType("olympe")
    fake.__version__ = "8.5.0"  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "olympe", fake)
    loud = logging.getLogger("olympe")
    monkeypatch.setattr(loud, "handlers", [logging.StreamHandler()])
    monkeypatch.setattr(loud, "propagate", True)
    caplog.set_level(logging.DEBUG)
    assert load_sdk().version == (8, 5, 0)
    logging.getLogger("olympe.pdraw").error("sky %s", "falls")
    assert [(r.name, r.levelname, r.getMessage()) for r in caplog.records] == [
        ("sim_bridge.olympe.sdk.olympe.pdraw", "INFO", "sky falls")
    ]
