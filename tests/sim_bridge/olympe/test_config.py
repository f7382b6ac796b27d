"""Addresses, ports and limits."""

from __future__ import annotations

import math

import pytest

from sim_bridge.olympe import AnafiConfig, SphinxConfig
from tests.sim_bridge.olympe.fake_olympe import config
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.protocols import Drone

KINDS = {kind.kind: kind for kind in (AnafiConfig, SphinxConfig)}


@pytest.mark.parametrize(
    ("kind", "address", "host", "port"),
    [
        ("anafi", None, "192.168.42.1", 44445),
        ("sphinx", None, "10.202.0.1", 44445),
        ("anafi", "127.0.0.2", "127.0.0.2", 44445),
        ("sphinx", "drone.lab:45000", "drone.lab", 45000),
    ],
)
def test_an_address_is_a_host_and_perhaps_a_port(
    kind: str, address: str | None, host: str, port: int
) -> None:
    made = KINDS[kind](address=address)
    assert (made.host, made.discovery_port) == (host, port)


@pytest.mark.parametrize("address", ["", ":1", "a:b", "::1", "a b", "127.0.0.1:", "x:1234567"])
def test_a_malformed_address_is_refused_with_an_example(address: str) -> None:
    with pytest.raises(InputError, match="expected HOST or HOST:DISCOVERY_PORT, for instance"):
        AnafiConfig(address=address)


def test_a_port_beyond_the_last_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="within 1 and 65535, got 70000"):
        AnafiConfig(address="127.0.0.1:70000")


def test_only_the_remote_control_stands_between() -> None:
    assert AnafiConfig(address="192.168.53.1").through_skycontroller
    assert not AnafiConfig(address="192.168.42.1").through_skycontroller


@pytest.mark.parametrize("limit", ["speed_limit_mps", "altitude_limit_m", "climb_limit_mps"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
def test_limits_are_positive(limit: str, value: float) -> None:
    with pytest.raises(ValueRangeError, match=f"{limit} must be a positive number"):
        config(**{limit: value})


def test_both_kinds_are_drones() -> None:
    for kind in KINDS.values():
        assert isinstance(kind().create(), Drone)
