"""The import of the SDK."""

from __future__ import annotations

import logging
import sys
from types import ModuleType, SimpleNamespace

import pytest

from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.drone import OlympeDrone
from sim_bridge.olympe.sdk import load_sdk
from tests.sim_bridge.olympe.fake_olympe import FakeWorld, config
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


@pytest.mark.parametrize(
    ("remote", "proxy", "address"),
    [
        (False, SimpleNamespace(address="127.0.0.9", port=1234), ("127.0.0.1", 8080)),
        (True, SimpleNamespace(address="127.0.0.9", port=1234), ("127.0.0.9", 1234)),
        (True, SimpleNamespace(address=None, port=None), ("127.0.0.1", 8180)),
        (True, None, ("127.0.0.1", 8180)),
    ],
)
def test_the_web_server_behind_a_remote_control_is_at_the_proxy(
    *, remote: bool, proxy: object, address: tuple[str, int]
) -> None:
    drone = SimpleNamespace() if proxy is None else SimpleNamespace(http_proxy=proxy)
    given = config(remote_control=remote, http_port=8080)
    assert FakeWorld().sdk.web_address(drone, given) == address
