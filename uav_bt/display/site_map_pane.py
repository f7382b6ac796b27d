"""Drawing of the mission's site map, with the outlines of the real objects."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from uav_bt.display.canvas import BACKDROP, INK, Colour, line, polygon, put, text_width_px
from uav_bt.display.lab_map import LabMap, MapFrame, draw_scale
from uav_bt.lab.classes import LabClasses
from uav_bt.mission.map_check import MapPlacement
from uav_bt.types.arrays import Image
from uav_bt.types.site_map import MapMover, MapObject, SiteMap

UNKNOWN: Final[Colour] = BACKDROP
SEEN: Final[Colour] = (47, 62, 56)
PASSED: Final[Colour] = (62, 104, 78)
OUTSIDE: Final[Colour] = (58, 38, 42)
FREE: Final[Colour] = (36, 42, 50)  # free space whose ground was not seen

BASES: Final[Colour] = (255, 110, 90)
EDGES: Final[Colour] = (214, 204, 150)
MOVERS: Final[Colour] = (255, 200, 40)
_TRUE: Final[Colour] = (120, 190, 255)
_POINT_PX: Final = 1
_OBJECT_PX: Final = 2  # line width of an object's outline
FOOTER_PX: Final = 24  # height of the legend
_AHEAD_S: Final = 2.0  # drawn length of a mover's predicted course, s
_LEGEND: Final = (("covered", PASSED), ("seen", SEEN), ("outside", OUTSIDE), ("true", _TRUE))


def cells_image(site_map: SiteMap) -> Image:
    """Return the colours of a map's cells by their state, (rows, columns, 3) uint8 RGB."""
    image: Image = np.full((*site_map.free.shape, 3), UNKNOWN, dtype=np.uint8)
    for cells, colour in (
        (site_map.free, FREE),
        (site_map.ground, SEEN),
        (site_map.outside, OUTSIDE),
        (site_map.passed & site_map.ground, PASSED),
    ):
        image[cells] = colour
    return image


def draw_site_map(
    site_map: SiteMap, placement: MapPlacement, frame: MapFrame, lab_map: LabMap | None
) -> Image:
    """Return the mission's map, with the outlines of the real objects on top.

    Args:
        site_map: the mission's map.
        placement: pose of the map in the world.
        frame: conversion of world metres to pixels.
        lab_map: content of the lab; None draws no outlines.

    Returns:
        (H, W, 3) uint8 RGB.
    """
    image = _cells_in_world(site_map, placement, frame)
    if lab_map is not None:
        pad = [] if lab_map.mark is None else [lab_map.mark]
        outlines = (item.corners() for item in (*lab_map.boxes, *pad))
        for outline in (lab_map.outline(), *outlines):
            polygon(image, frame.all_to_px(outline), None, _TRUE)
    for points_m, colour in ((site_map.edges_m, EDGES), (site_map.obstacles_m, BASES)):
        for x_m, y_m in placement.to_world(points_m).tolist():
            x, y = (round(each) for each in frame.to_px(x_m, y_m))
            cv2.circle(image, (x, y), _POINT_PX, colour, cv2.FILLED)
    for each in site_map.objects:
        _draw_object(image, each, site_map.classes, placement, frame)
    for mover in site_map.movers:
        _draw_mover(image, mover, placement, frame)
    _draw_legend(image)
    draw_scale(image, frame)
    return image


def _cells_in_world(site_map: SiteMap, placement: MapPlacement, frame: MapFrame) -> Image:
    """Return the cells in world orientation, at the size of the frame."""
    # The centres of three cells define the affine transform; OpenCV's x is the column.
    corner, cell_m = np.array(site_map.corner_m), site_map.cell_m
    centres = corner + cell_m * np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]])
    there = frame.all_to_px([(x, y) for x, y in placement.to_world(centres).tolist()])
    turn = cv2.getAffineTransform(
        np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], dtype=np.float32),
        np.array(there, dtype=np.float32),
    )
    cells = cv2.warpAffine(
        cells_image(site_map),
        turn,
        frame.size_px,
        flags=cv2.INTER_NEAREST,
        borderValue=UNKNOWN,
    )
    return np.asarray(cells, dtype=np.uint8)


def _draw_object(
    image: Image,
    item: MapObject,
    classes: LabClasses,
    placement: MapPlacement,
    frame: MapFrame,
) -> None:
    places_m = placement.to_world(np.vstack([item.corners_m(), [[item.x_m, item.y_m]]]))
    *corners, (x, y) = frame.all_to_px([(x_m, y_m) for x_m, y_m in places_m.tolist()])
    red, green, blue = (int(value) for value in classes.colours[item.class_id])
    line(image, [*corners, corners[0]], (red, green, blue), _OBJECT_PX)
    words = str(item.id)
    left = round(x - text_width_px(words, 0.36) / 2)
    put(image, words, (left, round(y + 4)), scale=0.36, colour=INK)


def _draw_mover(image: Image, mover: MapMover, placement: MapPlacement, frame: MapFrame) -> None:
    places_m = placement.to_world(mover.at(np.array([0.0, _AHEAD_S])))
    here, ahead = (frame.to_px(x_m, y_m) for x_m, y_m in places_m.tolist())
    reach_px = max(round(mover.radius_m * frame.scale_px_per_m), 3)
    cv2.circle(image, (round(here[0]), round(here[1])), reach_px, MOVERS, _OBJECT_PX, cv2.LINE_AA)
    line(image, [here, ahead], MOVERS, _OBJECT_PX)


def _draw_legend(image: Image) -> None:
    image[-FOOTER_PX:] = BACKDROP  # the cells below have the colours of the legend
    left, base = 12, image.shape[0] - 10
    for words, colour in _LEGEND:
        line(image, [(left, base - 4), (left + 10, base - 4)], colour, 5)
        put(image, words, (left + 16, base), scale=0.36)
        left += 16 + text_width_px(words, 0.36) + 14
