"""Commands and events of the memory card."""

from __future__ import annotations

from sim_bridge.loopback.media import MAX_BYTES, Card, MediaStore
from tests.sim_bridge.loopback.loopback_world import PHOTO, Bench, taken


def file_system(bench: Bench) -> list[str]:
    return [one["file_system_state"] for one in bench.values("user_storage.state")]


def test_a_client_reads_the_card_and_its_media_when_it_connects(bench: Bench) -> None:
    bench.send("common.Common.AllStates")
    assert bench.values("mediastore.state") == [{"state": "indexed"}]
    assert bench.values("mediastore.counters")[-1]["photo_media_count"] == 0
    info = bench.values("user_storage.info")[-1]
    assert info["capacity"] == MAX_BYTES
    assert info["name"]
    state = bench.values("user_storage.state")[-1]
    assert (state["physical_state"], state["file_system_state"]) == ("available", "ready")
    assert state["monitor_enabled"] == 0


def test_photographs_are_counted_and_take_room(bench: Bench) -> None:
    bench.send("user_storage.start_monitoring", period=2)
    bench.send("camera.take_photo", cam_id=0)
    bench.run(1.0)
    assert [one["photo_media_count"] for one in bench.values("mediastore.counters")] == [1]
    bench.run(2.0)
    free = [one["available_bytes"] for one in bench.values("user_storage.monitor")]
    assert free == [MAX_BYTES, MAX_BYTES - len(PHOTO.jpeg)]
    bench.media.format()  # as by the web interface
    assert bench.values("mediastore.counters")[-1]["photo_media_count"] == 0


def test_monitoring_has_a_period_and_an_end(bench: Bench) -> None:
    bench.send("user_storage.start_monitoring", period=0)
    bench.run(3.5)
    assert len(bench.values("user_storage.monitor")) == 4
    assert bench.values("user_storage.state")[-1]["monitor_period"] == 1
    bench.send("user_storage.stop_monitoring")
    bench.run(3.0)
    assert len(bench.values("user_storage.monitor")) == 4
    assert bench.values("user_storage.state")[-1]["monitor_enabled"] == 0


def test_formatting_deletes_all_media_and_names_the_card(bench: Bench) -> None:
    bench.media.add(PHOTO)
    bench.events.clear()
    bench.send("user_storage.format", label="card")
    assert file_system(bench) == ["formatting", "ready"]
    assert bench.values("user_storage.format_result") == [{"result": "success"}]
    assert bench.values("user_storage.info")[-1]["name"] == "card"
    assert len(bench.media) == 0
    bench.send("user_storage.format_with_type", label="", type="quick")
    assert bench.values("user_storage.info")[-1]["name"] != "card"


def test_nothing_is_formatted_in_flight(bench: Bench) -> None:
    bench.media.add(PHOTO)
    bench.fly()
    bench.send("user_storage.format", label="card")
    assert bench.values("user_storage.format_result") == [{"result": "denied"}]
    assert file_system(bench) == []
    assert len(bench.media) == 1


def test_without_a_card_photographs_and_formatting_fail() -> None:
    media = MediaStore(card=Card.ABSENT)
    bench = Bench(shoot=taken(), media=media)
    bench.send("common.Common.AllStates")
    state = bench.values("user_storage.state")[-1]
    assert (state["physical_state"], state["file_system_state"]) == ("undetected", "unknown")
    bench.send("camera.take_photo", cam_id=0)
    bench.run(1.0)
    results = [one["result"] for one in bench.values("camera.photo_progress")]
    assert results == ["error_no_storage_space"]
    bench.send("user_storage.format", label="card")
    assert bench.values("user_storage.format_result") == [{"result": "error"}]
    assert bench.values("user_storage.state")[-1]["physical_state"] == "undetected"


def test_a_card_that_is_full_at_first_has_room_once_it_is_formatted() -> None:
    media = MediaStore(card=Card.FULL)
    bench = Bench(shoot=taken(), media=media)
    bench.send("user_storage.start_monitoring", period=1)
    assert bench.values("user_storage.monitor")[-1] == {"available_bytes": 0}
    bench.send("camera.take_photo", cam_id=0)
    bench.run(1.0)
    bench.send("user_storage.format", label="card")
    bench.send("camera.take_photo", cam_id=0)
    bench.run(1.0)
    results = [one["result"] for one in bench.values("camera.photo_progress")]
    assert results == ["error_no_storage_space", "taking_photo", "photo_taken", "photo_saved"]
