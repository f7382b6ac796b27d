"""Composition: trees, policies and drones by name, and whole flights with their reports."""

from __future__ import annotations

import gc
import json
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from sim_bridge.plain import PlainConfig
from sim_bridge.twin import TwinConfig
from tests.worlds.records import ANYWHERE
from tests.worlds.trees import document
from uav_bt import app
from uav_bt.errors import DroneError, InputError
from uav_bt.mission.drone_wrapper import DroneWrapper
from uav_bt.mission.flight_report import FlightReport
from uav_bt.mission.runner import MissionRunner
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.protocols import Drone
from uav_bt.testing import InjectedError, ScriptedDrone
from uav_bt.tree import Leaf, NodeRegistry, Status
from uav_bt.types import Command, FlyingState, Land, Observation

HOP = document('<Sequence><TakeOff height_m="1.0"/><Land/></Sequence>')
STAY = HOP.replace("<Land/>", '<HoverFor seconds="250"/><Land/>')


@pytest.fixture
def drone() -> ScriptedDrone:
    return ScriptedDrone()


def doing(action: Callable[[int], object]) -> app.Listeners:
    """Return a factory of a listener that calls `action` with each tick's number."""

    class Doing:
        def on_tick(self, record: TickRecord) -> None:
            action(record.index)

    return lambda _flight: [Doing()]


def fly(drone: Drone, *actions: Callable[[int], object], tree: str = HOP, **how: Any) -> Any:
    """Fly where nobody looks for a mark, with actions at each tick."""
    listeners = [doing(action) for action in actions]
    return app.fly(tree, drone=drone, judge=ANYWHERE, listeners=listeners, **how)


# --- flights without a world ----------------------------------------------------------------------


def test_exact_masks_need_a_referee(drone: ScriptedDrone) -> None:
    with pytest.raises(InputError, match="exact masks need a simulated drone"):
        fly(drone, exact_masks=True)
    assert not drone.connected
    assert drone.commands == []


def test_a_flight_is_described_in_its_report_and_a_listener_that_breaks_is_named(
    drone: ScriptedDrone, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("behaviours.fly.land.Land.budget_s", -1.0)  # any duration exceeds it
    path, ticks = tmp_path / "report.json", list[int]()

    def follow(flight: app.Flight[Drone]) -> Sequence[TickListener]:
        assert flight.drone is drone
        assert drone.connected
        assert flight.context.clock.now() == flight.drone.clock.now()
        assert flight.context.seed == 11
        return doing(ticks.append)(flight)

    def fail(index: int) -> None:
        if index == 10:
            raise OSError("disk full")

    options = app.FlightOptions(drone=drone, judge=ANYWHERE, seed=11)
    report = app.fly(HOP, options, report=path, listeners=[follow, doing(fail)])
    assert (report.outcome, report.tree, report.seed) == ("success", "<text>", 11)
    assert (report.scene, report.profile) == (None, None)  # the drone has no referee
    assert list(report.slow_leaves) == ["Main/Sequence/Land"]
    assert report.site_map is None
    assert ticks == list(range(report.ticks))
    assert list(report.lost_outputs.values()) == ["OSError: disk full"]
    assert not report.airborne_at_end
    assert json.loads(path.read_text(encoding="utf-8")) == report.to_json()
    assert not drone.connected


def test_a_lost_drone_leaves_a_report_a_film_and_a_word_about_where_it_is(
    drone: ScriptedDrone, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lost(_: Command) -> Command:
        raise DroneError("no answer")

    def lose(index: int) -> None:
        if index == 10:
            monkeypatch.setattr(drone, "send", lost)

    path = tmp_path / "report.json"
    with pytest.raises(DroneError, match="no answer") as caught:
        fly(drone, lose, tree=STAY, report=path, video=tmp_path / "flight.mp4")
    with av.open(str(tmp_path / "flight.mp4")) as container:
        assert sum(1 for _ in container.decode(video=0)) > 10
    assert app.STILL_IN_THE_AIR in caught.value.__notes__
    report = json.loads(path.read_text(encoding="utf-8"))
    assert (report["outcome"], report["reason"]) == ("error", "no answer")
    assert report["airborne_at_end"] is True
    assert not drone.connected


def test_a_drone_nobody_landed_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The report does not depend on the code that lands the drone: it asks the simulation."""
    monkeypatch.setattr(MissionRunner, "_stop_and_land", lambda _runner, _reason: None)
    path = tmp_path / "report.json"
    options = app.FlightOptions(scene="train-a", drone="plain", faults=("observe-raises@take-off",))
    with pytest.raises(InjectedError) as caught:
        app.fly(STAY, options, report=path)
    assert app.STILL_IN_THE_AIR in caught.value.__notes__
    assert json.loads(path.read_text(encoding="utf-8"))["airborne_at_end"] is True


def test_leaves_close_what_they_opened_when_the_flight_is_over(
    drone: ScriptedDrone, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A device or a drone that fails at the end changes no result."""

    class Device(Leaf):
        def update(self) -> Status:
            return Status.SUCCESS

        def on_shutdown(self) -> None:
            raise OSError("the device is gone")

    def fail() -> None:
        raise DroneError("already gone")

    monkeypatch.setattr(drone, "disconnect", fail)
    registry = NodeRegistry.installed().with_nodes(Device)
    report = fly(drone, tree=HOP.replace("<Land/>", "<Device/><Land/>"), registry=registry)
    assert report.outcome == "success"
    assert "Device' failed: OSError: the device is gone" in caplog.text


# --- interrupts -----------------------------------------------------------------------------------


def press(*indices: int, number: signal.Signals = signal.SIGINT) -> Callable[[int], None]:
    """Return an action that sends a signal, by default Ctrl-C's, at these ticks."""

    def send(index: int) -> None:
        for _ in range(indices.count(index)):
            # Call the handler like the interpreter: a real signal might reach the test runner.
            handler = signal.getsignal(number)
            assert callable(handler)
            handler(number, None)

    return send


@pytest.fixture(autouse=True)
def _interruptible() -> Iterator[None]:
    """Set Python's handler of Ctrl-C; a background run of the tests would ignore the signal."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def handlers() -> tuple[object, ...]:
    return tuple(map(signal.getsignal, (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("ticks", [(20,), (20, 21)])
def test_the_first_signal_lands_and_the_second_does_not_wait(
    drone: ScriptedDrone, tmp_path: Path, ticks: tuple[int, ...], number: signal.Signals
) -> None:
    """A closed terminal is one of them; each one still gives a report."""
    before, path = handlers(), tmp_path / "report.json"
    report = fly(drone, press(*ticks, number=number), tree=STAY, report=path)
    assert (report.outcome, report.reason) == ("aborted", f"stopped by {number.name}")
    flies = len(ticks) > 1
    assert report.airborne_at_end == flies
    assert json.loads(path.read_text(encoding="utf-8"))["airborne_at_end"] == flies
    assert 20 < report.ticks < (24 if flies else 40)
    assert Command(movement=Land()) in drone.commands
    assert (drone.state.flying is FlyingState.LANDED) != flies
    assert handlers() == before


def test_the_third_signal_ends_a_program_that_hangs(drone: ScriptedDrone) -> None:
    before = handlers()
    with pytest.raises(KeyboardInterrupt):
        fly(drone, press(20, 20, 20), tree=STAY)
    assert not drone.connected
    assert handlers() == before


def test_ignored_signals_stay_so_and_another_thread_takes_no_handlers() -> None:
    """With nohup a mission continues after its terminal was closed."""
    within, reports = list[tuple[object, ...]](), list[FlightReport]()

    def fly_once() -> None:
        reports.append(fly(ScriptedDrone(), lambda _: within.append(handlers())))

    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        fly_once()
        assert {one[2] for one in within} == {signal.SIG_IGN}
    finally:
        signal.signal(signal.SIGHUP, before)
    within.clear()
    thread = threading.Thread(target=fly_once)
    thread.start()
    thread.join(timeout=60.0)
    assert [report.outcome for report in reports] == ["success"] * 2
    assert set(within) == {handlers()}


# --- flights of the twin, and live drones ---------------------------------------------------------


def measured(report: FlightReport) -> dict[str, Any]:
    """Return the fields of a report without the computing times."""
    timed = {"tick_ms", "perception_ms", "slow_leaves"}
    return {name: value for name, value in report.to_json().items() if name not in timed}


def test_the_twin_hovers_looks_around_and_lands_on_its_pad_the_same_with_each_seed() -> None:
    small = app.FlightOptions(scene="test-a", seed=3, exact_masks=True, image_size_px=(320, 180))
    report = app.fly("hover_and_look", small)
    assert (report.outcome, report.reason) == ("success", "landed")
    assert (report.scene, report.profile, report.tree) == ("test-a", "lab", "hover_and_look.xml")
    assert (report.landing_error_m or 1.0) < 0.25  # half the pad's side
    assert (report.min_clearance_m or 0.0) > 0.3
    assert report.duration_s == pytest.approx(0.1 * report.ticks, abs=0.2)
    assert report.search_distance_m is None  # this mission neither explores nor searches
    assert set(report.perception_ms) >= {"segmentation", "mark", "map", "corridor"}
    for summary in (report.tick_ms, *report.perception_ms.values()):
        assert summary is not None
        assert 0.0 < summary.p50 <= summary.p99 <= summary.max
    assert measured(app.fly("hover_and_look", small)) == measured(report)
    one, other = (app.fly(HOP, drone="plain", seed=seed).landing_error_m for seed in (1, 2))
    assert one != other


class Live(DroneWrapper):
    """A live drone whose lens may be covered."""

    live = True
    dark = False

    def __init__(self, drone: Drone) -> None:
        super().__init__(drone)
        self.frozen: list[int] = []

    def observe(self) -> Observation:
        seen = super().observe()
        if seen.frame is None or not self.dark:
            return seen
        return replace(seen, frame=replace(seen.frame, image=np.zeros_like(seen.frame.image)))

    def send(self, command: Command) -> Command:
        self.frozen.append(gc.get_freeze_count())
        return super().send(command)


def test_a_live_drone_whose_images_show_nothing_does_not_take_off() -> None:
    """A rehearsal shows the problems; it has no take-off."""
    drone = Live(TwinConfig(image_size_px=(160, 90)).create())
    drone.dark = True
    checks: list[str] = []
    words = r"nothing was flown\n  video: NOT READY, .*is dark"
    with pytest.raises(DroneError, match=words):
        app.fly(HOP, drone=drone, on_check=lambda each: checks.append(str(each)))
    told = len(checks)
    app.fly(HOP, drone=drone, rehearse=True, on_check=lambda each: checks.append(str(each)))
    for part in (checks[:told], checks[told:]):
        assert any("the image is dark" in check for check in part)


def test_a_live_mission_is_not_stopped_to_collect_what_was_loaded_before_it() -> None:
    drone = Live(PlainConfig().create())
    app.fly(HOP, drone=drone)
    assert min(drone.frozen) > 10_000
    assert gc.get_freeze_count() == 0
