"""Photographs of an ANAFI's camera: commands and events, without Olympe."""

from __future__ import annotations

import pytest

from sim_bridge.olympe.drone import OlympeDrone
from sim_bridge.olympe.stills import OlympeStills
from tests.sim_bridge.olympe.fake_olympe import FakeSdkDrone, FakeWorld, bridge
from uav_bt.protocols import Photographing, Still, StillState

SAVED = Still(state=StillState.SAVED, media="10000001")


class Flown:
    """A connected drone, and the answers of its camera."""

    def __init__(self, mode: str | None = "recording") -> None:
        self.world = FakeWorld()
        self.drone: OlympeDrone = bridge(self.world)
        self.drone.connect()
        if mode is not None:
            self.event("camera_mode", mode=mode)
        self.event("photo_state", available="not_available", state="inactive")

    @property
    def sdk(self) -> FakeSdkDrone:
        return self.world.drone

    @property
    def stills(self) -> OlympeStills:
        assert isinstance(self.drone, Photographing)
        assert self.drone.stills is not None
        return self.drone.stills

    @property
    def asked(self) -> list[str]:
        """Commands to the camera, and the modes that it was set to."""
        return [
            str(args.get("value", name.rpartition(".")[2]))
            for name, args in self.sdk.sent
            if name.startswith("camera.")
        ]

    def event(self, name: str, **args: object) -> None:
        self.sdk.event(f"camera.{name}", **{"cam_id": 0, **args})

    def progress(self, *results: str) -> None:
        for result in results:
            media = SAVED.media if result == "photo_saved" else ""
            self.event("photo_progress", result=result, photo_count=1, media_id=media)

    def ready(self) -> None:
        """Report the mode for photographs, and tick."""
        self.event("camera_mode", mode="photo")
        self.event("photo_state", available="available", state="inactive")
        self.drone.observe()


def test_the_camera_changes_its_mode_takes_the_photograph_and_changes_back() -> None:
    flown = Flown()
    number = flown.stills.take_still()
    assert flown.asked == ["photo"]
    flown.event("camera_mode", mode="photo")
    flown.drone.observe()
    assert flown.asked == ["photo"]  # not available yet
    flown.ready()
    flown.drone.observe()
    assert flown.asked == ["photo", "take_photo"]
    flown.progress("taking_photo", "photo_taken")
    assert flown.stills.still(number) == Still()
    flown.progress("photo_saved")
    assert flown.stills.still(number) == SAVED
    flown.drone.observe()
    flown.drone.observe()
    assert flown.asked == ["photo", "take_photo", "recording"]


def test_a_camera_that_takes_photographs_keeps_its_mode() -> None:
    flown = Flown(mode="photo")
    flown.ready()
    for _ in range(2):
        number = flown.stills.take_still()
        flown.progress("taking_photo", "photo_taken", "photo_saved")
        flown.drone.observe()
        assert flown.stills.still(number) == SAVED
    assert flown.asked == ["take_photo", "take_photo"]


@pytest.mark.parametrize(
    ("result", "reason"),
    [
        ("error_no_storage_space", "the memory card is full"),
        ("error_bad_state", "the camera is busy, or in another mode"),
        ("error", "the camera reports an error"),
        ("error_of_newer_firmware", "the camera reports 'error_of_newer_firmware'"),
    ],
)
def test_an_error_of_the_camera_is_the_reason(result: str, reason: str) -> None:
    flown = Flown()
    number = flown.stills.take_still()
    flown.ready()
    flown.progress(result)
    assert flown.stills.still(number) == Still(state=StillState.FAILED, reason=reason)
    flown.drone.observe()
    assert flown.asked[-1] == "recording"


@pytest.mark.parametrize(
    ("physical", "content", "reason"),
    [
        ("undetected", "unknown", "the drone has no memory card"),
        ("too_small", "unknown", "the memory card is too small"),
        ("available", "format_needed", "the memory card must be formatted"),
    ],
)
def test_without_a_usable_card_nothing_is_sent(physical: str, content: str, reason: str) -> None:
    flown = Flown()
    state = {"physical_state": physical, "file_system_state": content}
    flown.sdk.event("user_storage.state", **state)
    assert flown.stills.still(flown.stills.take_still()).reason == reason
    assert flown.asked == []
    flown.sdk.event("user_storage.state", physical_state="available", file_system_state="ready")
    assert flown.stills.still(flown.stills.take_still()).state is StillState.TAKING


@pytest.mark.parametrize(
    ("mode", "file_format", "reason"),
    [
        ("burst", "jpeg", "the camera is set to 'burst': choose single photographs"),
        ("single", "dng", "the camera is set to 'dng': choose JPEG"),
    ],
)
def test_another_choice_of_the_pilot_is_left_as_it_is(
    mode: str, file_format: str, reason: str
) -> None:
    flown = Flown()
    flown.event("photo_mode", mode=mode, file_format=file_format)
    assert flown.stills.still(flown.stills.take_still()).reason.startswith(reason)
    assert flown.asked == []
    flown.event("photo_mode", mode="single", file_format="dng_jpeg")
    assert flown.stills.still(flown.stills.take_still()).state is StillState.TAKING


def test_events_of_another_photograph_do_not_count() -> None:
    flown = Flown()
    first = flown.stills.take_still()
    flown.progress("photo_saved", "error")  # before the command
    flown.event("camera_mode", cam_id=1, mode="photo")
    flown.drone.observe()
    assert flown.asked == ["photo"]
    flown.ready()
    flown.progress("taking_photo")
    second = flown.stills.take_still()
    assert flown.stills.still(first).reason == "another one was asked for"
    flown.progress("photo_saved")  # of the first
    assert flown.stills.still(second) == Still()
    flown.progress("taking_photo", "photo_taken", "photo_saved")
    assert flown.stills.still(second) == SAVED
    assert flown.asked == ["photo", "take_photo", "take_photo"]
    flown.drone.observe()
    assert flown.asked[-1] == "recording"


def test_the_mode_is_restored_before_the_drone_is_left() -> None:
    flown = Flown()
    stills = flown.stills
    number = stills.take_still()
    flown.ready()
    flown.drone.disconnect()
    assert flown.asked == ["photo", "take_photo", "recording"]
    assert stills.still(number).reason == "the drone was disconnected"
    assert flown.drone.stills is None


def test_an_unknown_mode_is_not_restored() -> None:
    flown = Flown(mode=None)
    flown.stills.take_still()
    flown.ready()
    flown.progress("taking_photo", "photo_saved")
    flown.drone.observe()
    assert flown.asked == ["photo", "take_photo"]


def test_a_command_that_fails_ends_the_photograph_and_not_the_flight(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flown = Flown()

    def refuse(_: FakeSdkDrone, message: object) -> None:
        raise RuntimeError(f"no such message: {message}")

    monkeypatch.setattr(FakeSdkDrone, "__call__", refuse)
    number = flown.stills.take_still()
    flown.drone.observe()
    assert flown.stills.still(number).reason.startswith("the command to the camera failed: no such")
