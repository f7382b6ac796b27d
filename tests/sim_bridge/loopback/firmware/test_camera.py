"""Photos and recordings."""

from __future__ import annotations

from tests.sim_bridge.loopback.loopback_world import Bench


def test_a_photo_is_taken_and_saved(bench: Bench) -> None:
    bench.told.clear()
    bench.send("camera.take_photo", cam_id=0)
    bench.run(1.0)
    results = [one["result"] for one in bench.values("camera.photo_progress")]
    assert results == ["taking_photo", "photo_taken", "photo_saved"]
    assert [one["state"] for one in bench.values("camera.photo_state")] == ["active", "inactive"]


def test_a_recording_starts_and_stops(bench: Bench) -> None:
    bench.told.clear()
    bench.send("camera.stop_recording", cam_id=0)
    bench.send("camera.start_recording", cam_id=0)
    bench.send("camera.stop_recording", cam_id=0)
    results = [one["result"] for one in bench.values("camera.recording_progress")]
    assert results == ["error_bad_state", "started", "stopped"]
