"""Addresses and limits, the probe of an address, and the import of the SDK."""

from __future__ import annotations

import logging
import math
import socket
import sys
import threading
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from sim_bridge.olympe import AnafiConfig, SphinxConfig, probe
from sim_bridge.olympe.drone import OlympeDrone
from sim_bridge.olympe.probe import probe as probed
from sim_bridge.olympe.sdk import load_sdk
from tests.sim_bridge.olympe.fake_olympe import PATIENCE_S, FakeWorld, config
from uav_bt.errors import DroneError, InputError, MissingDependencyError, ValueRangeError
from uav_bt.protocols import Drone


@pytest.mark.parametrize(
    ("kind", "address", "host", "port"),
    [
        (AnafiConfig, None, "192.168.42.1", 44445),
        (SphinxConfig, None, "10.202.0.1", 44445),
        (AnafiConfig, "127.0.0.2", "127.0.0.2", 44445),
        (SphinxConfig, "drone.lab:45000", "drone.lab", 45000),
    ],
)
def test_a_port_is_optional(kind: Any, address: str | None, host: str, port: int) -> None:
    made = kind(address=address)
    assert (made.host, made.discovery_port) == (host, port)
    assert isinstance(made.create(), Drone)


@pytest.mark.parametrize(
    "address", ["", ":1", "a:b", "::1", "a b", "127.0.0.1:", "x:1234567", "x:70000", "x:0"]
)
def test_a_malformed_address_is_refused_with_an_example(address: str) -> None:
    with pytest.raises(InputError, match="expected HOST or HOST:DISCOVERY_PORT, for instance"):
        AnafiConfig(address=address)


@pytest.mark.parametrize("limit", ["speed_limit_mps", "altitude_limit_m", "climb_limit_mps"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
def test_limits_are_positive(limit: str, value: float) -> None:
    with pytest.raises(ValueRangeError, match=f"{limit} must be a positive number"):
        config(**{limit: value})


@pytest.mark.parametrize(
    ("announcement", "remote"),
    [
        (b'{"model.id": "0x0914"}\0', False),
        (b'{"model.id": "0x0918"}\0', True),
        (b"nonsense\0", False),
        (b"[]\0", False),
        (b"", False),
    ],
)
def test_a_remote_control_announces_itself(
    monkeypatch: pytest.MonkeyPatch, announcement: bytes, *, remote: bool
) -> None:
    """A port that listens and announces nothing is a drone."""
    monkeypatch.setattr(probe, "LIMIT_S", 0.1 if announcement == b"" else PATIENCE_S)

    def announce() -> None:
        with server.accept()[0] as connection:
            connection.sendall(announcement)

    with socket.create_server(("127.0.0.1", 0)) as server:
        if announcement:
            threading.Thread(target=announce).start()
        assert probed(config(address=f"127.0.0.1:{server.getsockname()[1]}")) is remote


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({}, OSError(111, "refused"), r"reach .*\(refused\): .*`uav-bt serve-anafi`"),
        ({"address": "127.0.3.4"}, OSError("odd"), r"`uav-bt serve-anafi --address 127.0.3.4`"),
        ({"address": "localhost"}, OSError("odd"), r"reach anafi at localhost.*serve-anafi`"),
        ({"address": None}, TimeoutError(), "no answer from anafi at .* within 2 s: switch the"),
        ({"address": "nobody"}, socket.gaierror(), "the host 'nobody' is unknown: check its"),
    ],
)
def test_nobody_at_the_address_is_an_error_with_advice(
    monkeypatch: pytest.MonkeyPatch, given: Any, error: OSError, message: str
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(socket, "create_connection", refuse)
    with pytest.raises(DroneError, match=message):
        probed(config(**given))


def test_a_missing_sdk_is_reported_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "olympe", None)
    drone = OlympeDrone(config(), probe_first=lambda _: pytest.fail("looked for the drone"))
    with pytest.raises(MissingDependencyError, match=r"Parrot's SDK .*docs/anafi\.md"):
        drone.connect()
    assert logging.root.manager.disable == logging.NOTSET


def test_the_sdk_logs_through_our_loggers_at_a_lower_level(
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
        (False, {"address": "127.0.0.9", "port": 1234}, ("127.0.0.1", 8080)),
        (True, {"address": "127.0.0.9", "port": 1234}, ("127.0.0.9", 1234)),
        (True, {"address": None, "port": None}, ("127.0.0.1", 8180)),
        (True, None, ("127.0.0.1", 8180)),
    ],
)
def test_behind_a_remote_control_the_web_server_is_at_the_proxy(
    *, remote: bool, proxy: dict[str, Any] | None, address: tuple[str, int]
) -> None:
    drone = SimpleNamespace()
    if proxy is not None:
        drone.http_proxy = SimpleNamespace(**proxy)
    sdk, where = FakeWorld().sdk(), config(http_port=8080)
    assert sdk.web_address(drone, where, remote=remote) == address
