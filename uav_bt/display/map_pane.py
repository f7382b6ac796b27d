"""Map pane of a film: lab or site map, path, drone and its view."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from uav_bt.display import canvas
from uav_bt.display.canvas import ACCENT, BACKDROP, INK, Colour, Size
from uav_bt.display.lab_map import HEADER_PX, LabMap, MapFrame, draw_lab, draw_movers, draw_scale
from uav_bt.display.shown import FlightFacts, FlownPath, Shown, phase_colours
from uav_bt.mission.map_check import MapAlignment, MapPlacement
from uav_bt.types import CameraModel, MarkFix, Pose
from uav_bt.types.arrays import Floats, Image
from uav_bt.types.projection import pixel_rays
from uav_bt.types.site_map import SiteMap

FREE: Final[Colour] = (36, 42, 50)  # free space whose ground was not seen
SEEN: Final[Colour] = (47, 62, 56)
PASSED: Final[Colour] = (62, 104, 78)
OUTSIDE_COLOUR: Final[Colour] = (58, 38, 42)
_BASES: Final[Colour] = (255, 110, 90)
_EDGES: Final[Colour] = (214, 204, 150)
_MOVERS: Final[Colour] = (255, 200, 40)
_TRUE: Final[Colour] = (120, 190, 255)
_VIEW: Final[Colour] = (200, 220, 255)
_LEGEND: Final = (("covered", PASSED), ("seen", SEEN), ("outside", OUTSIDE_COLOUR), ("true", _TRUE))
FOOTER_PX: Final = 24  # height of the legend
_LINE_PX: Final = 2  # width of the path and of the outlines of objects
_SPOT: Final = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))  # drawn shape of a point
_AHEAD_S: Final = 2.0  # drawn length of a mover's predicted course, s
_VIEW_OPACITY: Final = 0.25
_VIEW_REACH_M: Final = 1.8  # length of the drawn field of view
_ROTOR_M: Final = 0.11  # size of the drawn rotors, about that of the ANAFI
_ARM_M: Final = 0.14
_NO_LAB_M: Final = (6.0, 6.0)  # extent around the start if the lab is unknown


def _draw_site_map(
    site_map: SiteMap, placement: MapPlacement, frame: MapFrame, lab_map: LabMap | None
) -> Image:
    """Return the mission's map in the world, below the true outlines."""
    image = _draw_cells(site_map, placement, frame)
    if lab_map is not None:
        items = (*lab_map.boxes, lab_map.mark)
        outlines = [lab_map.ground.corners_m, *(item.corners() for item in items if item)]
        for outline in outlines:
            canvas.polygon(image, frame.to_px(outline), None, _TRUE)
    for points_m, colour in ((site_map.edges_m, _EDGES), (site_map.obstacles_m, _BASES)):
        spots = np.zeros(image.shape[:2], dtype=np.uint8)
        x, y = np.rint(frame.to_px(placement.to_world(points_m))).astype(int).T
        shown = (x >= 0) & (x < frame.size_px[0]) & (y >= 0) & (y < frame.size_px[1])
        spots[y[shown], x[shown]] = 1
        image[cv2.dilate(spots, _SPOT) > 0] = colour
    for item in site_map.objects:
        places_m = placement.to_world(np.vstack([item.corners_m(), [[item.x_m, item.y_m]]]))
        *corners, (x, y) = frame.to_px(places_m)
        red, green, blue = site_map.classes.colours[item.class_id].tolist()
        canvas.line(image, [*corners, corners[0]], (red, green, blue), _LINE_PX)
        canvas.put_centred(image, str(item.id), (x, y + 4), scale=0.36)
    for mover in site_map.movers:
        here, ahead = frame.to_px(placement.to_world(mover.at(np.array([0.0, _AHEAD_S]))))
        reach_px = max(mover.radius_m * frame.scale_px_per_m, 3.0)
        canvas.line(image, canvas.circle(here, reach_px), _MOVERS, _LINE_PX)
        canvas.line(image, [here, ahead], _MOVERS, _LINE_PX)
    image[-FOOTER_PX:] = BACKDROP  # the cells below have the colours of the legend
    canvas.draw_legend(image, _LEGEND, (12, image.shape[0] - 10), 0.36)
    draw_scale(image, frame)
    return image


def _draw_cells(site_map: SiteMap, placement: MapPlacement, frame: MapFrame) -> Image:
    """Return the map's cells in the world, in colours of their states."""
    rows, columns = site_map.free.shape
    cells = canvas.blank((columns, rows), BACKDROP)
    cells[site_map.free] = FREE
    cells[site_map.ground] = SEEN
    cells[site_map.outside] = OUTSIDE_COLOUR
    cells[site_map.passed & site_map.ground] = PASSED
    # The centres of three cells define the affine transform; OpenCV's x is the column.
    columns_rows = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], dtype=np.float32)
    centres = np.array(site_map.corner_m) + site_map.cell_m * columns_rows[:, ::-1].astype(float)
    there = frame.to_px(placement.to_world(centres)).astype(np.float32)
    turn = cv2.getAffineTransform(columns_rows, there)
    drawn = cv2.warpAffine(
        cells, turn, frame.size_px, flags=cv2.INTER_NEAREST, borderValue=BACKDROP
    )
    return np.asarray(drawn, dtype=np.uint8)


def ground_view(
    camera: CameraModel, pitch_rad: float, height_m: float, reach_m: float = _VIEW_REACH_M
) -> Floats:
    """Return where the corner rays of a camera meet the ground, at most `reach_m` from it.

    The points are (4, 2), forward and right in metres from the body's centre, clockwise from the
    upper left. The lens is taken as free of distortion. The gimbal's pitch is negative down.
    """
    right, bottom = camera.width_px - 0.5, camera.height_px - 0.5
    corners = [(-0.5, -0.5), (right, -0.5), (right, bottom), (-0.5, bottom)]
    rays = pixel_rays(corners, camera, pitch_rad)
    level, down = np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2]
    ways = np.minimum(height_m / np.maximum(down, 1e-6), reach_m / np.maximum(level, 1e-6))
    return np.asarray(rays[:, :2] * ways[:, None] + (camera.forward_offset_m, 0.0))


class MapPane:
    """Draws the map pane, each piece of the path once: the time per tick is constant."""

    def __init__(self, facts: FlightFacts, size_px: Size) -> None:
        self._facts = facts
        extent_m = _NO_LAB_M if facts.lab_map is None else facts.lab_map.ground.size_m
        margins = {"above_px": HEADER_PX, "below_px": FOOTER_PX}
        self._frame = MapFrame.around(extent_m, size_px, **margins)
        self._ground = draw_lab(facts.lab_map, self._frame)  # all below the path
        self._alignment = MapAlignment()
        self._site_map: SiteMap | None = None
        # The path: its colours on black, and its opacity.
        self._path = canvas.blank(size_px, (0, 0, 0))
        self._opacity = canvas.blank(size_px, (0, 0, 0))
        self._drawn = 1  # number of drawn points of the path

    def draw(self, shown: Shown) -> Image:
        """Return the present map: the lab, or the mission's newest map."""
        flown, state, fix = shown.flown, shown.record.observation.state, shown.fix.value
        pose, lab_map = flown.pose, self._facts.lab_map
        if pose is not None:
            reported_rad = state.attitude.yaw_rad
            self._alignment.add(shown.record.time_s, pose, reported_rad, shown.site_map)
        placement, site_map = self._alignment.placement, shown.site_map
        if placement is not None and site_map is not None and site_map is not self._site_map:
            self._site_map = site_map
            self._ground = _draw_site_map(site_map, placement, self._frame, lab_map)
        image = self._with_path(flown)
        canvas.put(image, self._facts.title, (12, 22), scale=0.48)
        if lab_map is not None:
            places_m = [(mover.pose.x_m, mover.pose.y_m) for mover in flown.movers]
            draw_movers(image, self._frame, lab_map, places_m)
        if pose is not None:
            height_m = max(state.height_above_ground_m, 0.0)
            self._draw_view(image, pose, state.gimbal_pitch_rad, height_m)
            if fix is not None:
                self._draw_fix(image, pose, fix)
            self._draw_drone(image, pose)
        return image

    def _with_path(self, flown: FlownPath) -> Image:
        """Draw the new pieces of the path, and return a copy of the map with all of it."""
        colours, points = phase_colours(flown.phases), flown.points
        new = zip(points[self._drawn - 1 :], points[self._drawn :], strict=False)
        for (start_m, _), (end_m, phase) in new:
            ends = self._frame.to_px([start_m, end_m])
            canvas.line(self._path, ends, colours[phase], _LINE_PX)
            canvas.line(self._opacity, ends, (255, 255, 255), _LINE_PX)
        self._drawn = max(len(points), 1)
        below = cv2.multiply(self._ground, 255 - self._opacity, scale=1.0 / 255.0)
        return np.asarray(cv2.add(below, self._path), dtype=np.uint8)

    def _around(self, pose: Pose, forward_m: float, right_m: float) -> Floats:
        """Return the pixel position of a point given relative to the body's centre."""
        return self._frame.to_px(pose.to_world(forward_m, -right_m))

    def _draw_view(self, image: Image, pose: Pose, pitch_rad: float, height_m: float) -> None:
        # The hull includes the lens: a wedge if it looks ahead.
        camera = self._facts.camera
        seen = [(camera.forward_offset_m, 0.0), *ground_view(camera, pitch_rad, height_m).tolist()]
        around = [self._around(pose, *point) for point in seen]
        hull = cv2.convexHull(np.asarray(around, dtype=np.float32)).reshape(-1, 2)
        layer = image.copy()
        canvas.polygon(layer, hull, _VIEW)
        cv2.addWeighted(layer, _VIEW_OPACITY, image, 1.0 - _VIEW_OPACITY, 0.0, dst=image)

    def _draw_fix(self, image: Image, pose: Pose, fix: MarkFix) -> None:
        x, y = self._around(pose, fix.forward_m, fix.right_m)
        arm = 9 if fix.detected else 6
        for dx, dy in ((arm, arm), (arm, -arm)):
            canvas.line(image, [(x - dx, y - dy), (x + dx, y + dy)], ACCENT, 2)
        doubt_px = max(fix.std_m * self._frame.scale_px_per_m, 1.0)
        canvas.line(image, canvas.circle((x, y), doubt_px), ACCENT)

    def _draw_drone(self, image: Image, pose: Pose) -> None:
        rotor_px = _ROTOR_M * self._frame.scale_px_per_m
        for forward, right in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
            hub = self._around(pose, forward * _ARM_M, right * _ARM_M)
            canvas.line(image, [self._around(pose, 0.0, 0.0), hub], INK, 2)
            canvas.polygon(image, canvas.circle(hub, rotor_px), None, INK)
        nose = [(0.26, 0.0), (0.08, 0.07), (-0.1, 0.06), (-0.1, -0.06), (0.08, -0.07)]
        canvas.polygon(image, [self._around(pose, *point) for point in nose], INK, BACKDROP)
