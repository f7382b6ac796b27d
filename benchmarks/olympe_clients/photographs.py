# ruff: noqa: S101 - as a user of the SDK would write it
"""Take two photographs, list them, and download one with its checksum."""

import os
import tempfile
import time
from pathlib import Path

import olympe
from olympe.media import download_resource, indexing_state
from olympe.messages.camera import photo_progress, set_camera_mode, take_photo

drone = olympe.Drone(os.environ.get("DRONE_IP", "127.0.0.1"))
assert drone.connect()
assert drone.media(indexing_state(state="indexed")).wait(_timeout=10).success()
assert drone(set_camera_mode(cam_id=0, value="photo")).wait(_timeout=5).success()
for _ in range(2):
    saved = drone(photo_progress(result="photo_saved", _policy="wait"))
    drone(take_photo(cam_id=0)).wait(_timeout=5)
    assert saved.wait(_timeout=10).success()
media_id = saved.received_events().last().args["media_id"]
for _ in range(100):  # the SDK's list follows notifications of the web server
    if media_id not in drone.media.list_media():
        time.sleep(0.1)
assert media_id in drone.media.list_media(), drone.media.list_media()
assert len(drone.media.list_media()) == 2
(resource_id,) = drone.media.list_resources(media_id)
with tempfile.TemporaryDirectory() as folder:
    drone.media.download_dir = folder
    fetched = drone.media(download_resource(resource_id, integrity_check=True)).wait(_timeout=10)
    assert fetched.success(), fetched.explain()
    data = (Path(folder) / resource_id).read_bytes()
assert data.startswith(b"\xff\xd8")
assert drone.disconnect()
print(f"{resource_id}: {len(data)} bytes")
