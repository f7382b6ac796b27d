"""Site map in Rerun: an image, with the outlines of the real objects on top."""

from __future__ import annotations

import math
from typing import Final

import rerun as rr

from uav_bt.display.flown_path import FlownPath
from uav_bt.display.lab_map import LabMap, MapFrame
from uav_bt.display.rerun.setting import SITE_MAP
from uav_bt.display.site_map_pane import FOOTER_PX, draw_site_map
from uav_bt.mission.map_check import MapAlignment
from uav_bt.mission.tick import TickRecord
from uav_bt.record.images import encode_image
from uav_bt.types.site_map import SiteMap

_SIZE_PX: Final = (640, 520)
_NO_LAB_M: Final = (6.0, 6.0)  # extent around the start if the lab is unknown
_EVERY_S: Final = 0.5  # time between images; the map changes with every view


class SiteMapView:
    """Draws the site map of the mission.

    Args:
        stream: the recording.
        lab_map: content of the lab; None if unknown.
    """

    def __init__(self, stream: rr.RecordingStream, lab_map: LabMap | None) -> None:
        self._stream = stream
        self._lab_map = lab_map
        extent_m = _NO_LAB_M if lab_map is None else lab_map.ground_size_m
        self._frame = MapFrame.around(extent_m, _SIZE_PX, margin_m=0.5, footer_px=FOOTER_PX)
        self._alignment = MapAlignment()
        self._drawn_s = -math.inf

    def show(self, record: TickRecord, flown: FlownPath, site_map: SiteMap | None) -> None:
        """Draw the map at a tick, if due.

        Args:
            record: record of the tick.
            flown: the path until now.
            site_map: the mission's map; None without one.
        """
        if flown.pose is None:
            return
        yaw_rad = record.observation.state.attitude.yaw_rad
        self._alignment.add(record.time_s, flown.pose, yaw_rad, site_map)
        placement = self._alignment.placement
        due = record.time_s - self._drawn_s >= _EVERY_S - 1e-6
        if placement is None or site_map is None or not due:
            return
        self._drawn_s = record.time_s
        image = draw_site_map(site_map, placement, self._frame, self._lab_map)
        jpeg, _ = encode_image(image, "high")
        self._stream.log(SITE_MAP, rr.EncodedImage(contents=jpeg, media_type="image/jpeg"))
