"""Live map of a flight: the path, the drone, and the field of view of its camera.

If the mission keeps a site map, that map is drawn, with the outlines of the real objects on top.
"""

from __future__ import annotations

import math
from itertools import groupby
from typing import Final

from uav_bt.display.canvas import (
    ACCENT,
    BACKDROP,
    INK,
    Colour,
    Point,
    blend_polygon,
    circle,
    hull,
    line,
    polygon,
    put,
)
from uav_bt.display.flown_path import FlownPath
from uav_bt.display.lab_map import (
    HEADER_PX,
    LabMap,
    MapFrame,
    draw_lab,
    draw_movers,
    phase_colours,
)
from uav_bt.display.site_map_pane import FOOTER_PX, draw_site_map
from uav_bt.mission.map_check import MapAlignment
from uav_bt.types import CameraModel, MarkFix, Pose
from uav_bt.types.arrays import Image
from uav_bt.types.projection import pixel_rays
from uav_bt.types.site_map import SiteMap

_VIEW_OPACITY: Final = 0.25
_VIEW_REACH_M: Final = 1.8  # length of the drawn field of view
_VIEW_COLOUR: Final[Colour] = (200, 220, 255)
_PATH_PX: Final = 2
_ROTOR_M: Final = 0.11  # size of the drawn rotors, about that of the ANAFI
_ARM_M: Final = 0.14
_NO_LAB_M: Final = (6.0, 6.0)  # extent around the start if the lab is unknown


def ground_view(
    camera: CameraModel, pitch_rad: float, height_m: float, reach_m: float = _VIEW_REACH_M
) -> list[Point]:
    """Return the ground in a camera's view: the intersections of the corner rays with the ground.

    Args:
        camera: intrinsics; distortion is ignored.
        pitch_rad: pitch of the gimbal, 0 level, negative down.
        height_m: height of the camera above the ground.
        reach_m: length limit of the rays.

    Returns:
        Four points (forward, right), metres from the body's centre, clockwise from the upper left.
    """
    left, right = -0.5, camera.width_px - 0.5
    top, bottom = -0.5, camera.height_px - 0.5
    corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
    points: list[Point] = []
    for forward, across, down in pixel_rays(corners, camera, pitch_rad).tolist():
        longest = reach_m / max(math.hypot(forward, across), 1e-6)
        length = min(height_m / down, longest) if down > 0.0 else longest
        points.append((camera.forward_offset_m + forward * length, across * length))
    return points


class LiveMap:
    """Draws the map pane. Each point of the path is drawn once, so the time per tick is constant.

    Args:
        lab_map: content of the lab; None draws a grid around the start.
        camera: intrinsics, for the field of view.
        size_px: width and height of the pane.
        title: line of text above the lab.
    """

    def __init__(
        self,
        lab_map: LabMap | None,
        camera: CameraModel,
        size_px: tuple[int, int],
        title: str = "",
    ) -> None:
        extent_m = lab_map.ground_size_m if lab_map is not None else _NO_LAB_M
        self.size_px = size_px
        self._frame = MapFrame.around(extent_m, size_px, header_px=HEADER_PX, footer_px=FOOTER_PX)
        self._camera = camera
        self._lab_map = lab_map
        self._lab = draw_lab(lab_map, self._frame)
        put(self._lab, title, (12, 22), colour=INK, scale=0.48)
        self._title = title
        self._alignment = MapAlignment()
        self._site_map: SiteMap | None = None
        self._believed: Image | None = None  # the mission's map, without the path
        self._drawn = 1  # number of drawn points of the path

    def believe(
        self, time_s: float, flown: FlownPath, reported_yaw_rad: float, site_map: SiteMap | None
    ) -> None:
        """Set the mission's map, which is then drawn instead of the lab.

        Args:
            time_s: time of the tick.
            flown: the path until now.
            reported_yaw_rad: heading of the drone in its telemetry.
            site_map: the mission's map; None keeps the last one.
        """
        if flown.pose is None:
            return
        self._alignment.add(time_s, flown.pose, reported_yaw_rad, site_map)
        placement = self._alignment.placement
        if placement is None or site_map is None or site_map is self._site_map:
            return
        self._site_map = site_map
        self._believed = draw_site_map(site_map, placement, self._frame, self._lab_map)
        put(self._believed, self._title, (12, 22), colour=INK, scale=0.48)

    def draw(
        self, flown: FlownPath, *, pitch_rad: float, height_m: float, fix: MarkFix | None
    ) -> Image:
        """Return the present map, (H, W, 3) uint8 RGB.

        Args:
            flown: the path until now.
            pitch_rad: pitch of the camera, 0 level, negative down.
            height_m: height of the camera above the ground.
            fix: the drone's estimate of the mark's position.
        """
        self._draw_new_path(flown)
        if self._believed is None:
            image = self._lab.copy()
        else:
            image = self._believed.copy()
            self._draw_path(image, flown, 1)
        if self._lab_map is not None:
            places_m = [(mover.pose.x_m, mover.pose.y_m) for mover in flown.movers]
            draw_movers(image, self._frame, self._lab_map, places_m)
        if flown.pose is not None:
            seen = ground_view(self._camera, pitch_rad, max(height_m, 0.0))
            # The hull includes the lens: a wedge if it looks ahead, a rectangle if it looks down.
            lens = (self._camera.forward_offset_m, 0.0)
            view_px = hull([self._around(flown.pose, *point) for point in (lens, *seen)])
            blend_polygon(image, view_px, _VIEW_COLOUR, _VIEW_OPACITY)
            if fix is not None:
                self._draw_fix(image, flown.pose, fix)
            self._draw_drone(image, flown.pose)
        return image

    def _draw_new_path(self, flown: FlownPath) -> None:
        self._draw_path(self._lab, flown, self._drawn)
        self._drawn = max(len(flown.points), 1)

    def _draw_path(self, image: Image, flown: FlownPath, first: int) -> None:
        """Draw the path from the predecessor of a point, in one line per phase."""
        colours, points = phase_colours(flown.phases), flown.points
        for phase, run in groupby(range(first, len(points)), lambda at: points[at].phase):
            places = list(run)
            ends = [(p.x_m, p.y_m) for p in points[places[0] - 1 : places[-1] + 1]]
            line(image, self._frame.all_to_px(ends), colours[phase], _PATH_PX)

    def _around(self, pose: Pose, forward_m: float, right_m: float) -> Point:
        """Return the pixel position of a point given relative to the body's centre."""
        return self._frame.to_px(*pose.to_world(forward_m, -right_m))

    def _draw_fix(self, image: Image, pose: Pose, fix: MarkFix) -> None:
        x, y = self._around(pose, fix.forward_m, fix.right_m)
        arm = 9 if fix.detected else 6
        for dx, dy in ((arm, arm), (arm, -arm)):
            line(image, [(x - dx, y - dy), (x + dx, y + dy)], ACCENT, 2)
        spread_px = max(fix.std_m * self._frame.scale_px_per_m, 1.0)
        line(image, circle(x, y, spread_px), ACCENT)

    def _draw_drone(self, image: Image, pose: Pose) -> None:
        rotor_px = _ROTOR_M * self._frame.scale_px_per_m
        for forward, right in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
            hub = self._around(pose, forward * _ARM_M, right * _ARM_M)
            line(image, [self._around(pose, 0.0, 0.0), hub], INK, 2)
            polygon(image, circle(*hub, rotor_px), None, INK)
        nose = [(0.26, 0.0), (0.08, 0.07), (-0.1, 0.06), (-0.1, -0.06), (0.08, -0.07)]
        polygon(image, [self._around(pose, *point) for point in nose], INK, BACKDROP)
