"""Photographs of the drone's camera, fetched from its memory card after the landing."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

from uav_bt.board.context import FlightFolder
from uav_bt.errors import DroneError, FileError
from uav_bt.mission.flight_report import FlightReport
from uav_bt.protocols import StillCamera

# Chosen: over Wi-Fi an ANAFI sends some megabytes a second, and a photograph has about eight.
_FIRST_S: Final = 15.0
_EACH_S: Final = 10.0


def fetch_photos(
    report: FlightReport,
    camera: StillCamera,
    folder: FlightFolder,
    now: Callable[[], float] = time.monotonic,
) -> None:
    """Write the photographs that the drone's camera took into the flight's folder.

    Each photograph is tried within the time that is left for all of them.

    Args:
        report: Report of the flight, which names the photographs.
        camera: Camera of the connected drone.
        folder: Output folder of the flight.
        now: Monotonic clock, s.

    Raises:
        FileError: Photographs were not fetched; the message names them.
    """
    taken = [
        (photo.camera_file, photo.camera_media)
        for photo in report.photos
        if photo.camera_file is not None and photo.camera_media is not None
    ]
    if not taken:
        return
    until_s = now() + _FIRST_S + _EACH_S * len(taken)
    missing: dict[str, str] = {}
    reason = "the drone is still in the air" if report.airborne_at_end else ""
    for name, media in taken:
        try:
            if report.airborne_at_end:
                missing[name] = media
            else:
                folder.write(name, camera.fetch_still(media, max(0.0, until_s - now())))
        except (DroneError, FileError) as error:
            missing[name] = media
            reason = reason or str(error)
    if missing:
        raise FileError(
            folder.folder,
            f"{len(missing)} of {len(taken)} photographs of the drone's camera were not fetched "
            f"({', '.join(missing)}): {reason}. They stay on its memory card, as the media "
            f"{', '.join(missing.values())}",
        )
