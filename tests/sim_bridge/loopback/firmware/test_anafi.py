"""The firmware as a whole."""

from __future__ import annotations

from tests.sim_bridge.loopback.loopback_world import Bench


def test_a_command_that_is_not_simulated_changes_nothing(bench: Bench) -> None:
    bench.events.clear()
    bench.send("ardrone3.Animations.Flip", direction="front")
    assert bench.events == []
    assert bench.world.orders == []
