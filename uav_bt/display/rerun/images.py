"""Images in Rerun with overlays: camera, mask edges, mark, intrusions, mask, metric depth."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from uav_bt.display.canvas import ACCENT, ALARM, INK, Colour, circle
from uav_bt.display.phrases import describe_corridor
from uav_bt.display.rerun.layout import Entities
from uav_bt.display.rerun.setting import DEPTH_LENS, LENS, MASK, ViewSetting
from uav_bt.display.video.depth_panes import FARTHEST_M, intruding_pixels
from uav_bt.display.video.panes import pad_circle
from uav_bt.lab.classes import OUTSIDE
from uav_bt.record.images import encode_image
from uav_bt.types import CameraModel, ClassMap, Corridor, DepthMap, Frame, MarkFix

_EDGE_PX: Final = 1.2  # half the width of drawn lines, pixels of the image
_SHOWN_M: Final = 0.35  # distance of the image from the lens in the 3D view
_NO_IMAGE_M: Final = 1e-3  # the same for depth: so small that its frustum is invisible

Strip = NDArray[np.float32]


def outlines(mask: NDArray[np.uint8], size_px: tuple[int, int]) -> list[Strip]:
    """Return the closed outlines of the non-zero parts of a mask, in pixels of an image.

    Args:
        mask: (h, w) uint8, of any size.
        size_px: width and height of the image; pixel centres have integer coordinates.
    """
    found, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    scale = np.array([size_px[0] / mask.shape[1], size_px[1] / mask.shape[0]], dtype=np.float32)
    strips = []
    for contour in found:
        points = contour.reshape(-1, 2).astype(np.float32)
        if len(points) > 2:  # lines of single pixels are noise
            closed = np.vstack([points, points[:1]]).astype(np.float32)
            strips.append(np.asarray((closed + 0.5) * scale - 0.5, dtype=np.float32))
    return strips


class ImageView:
    """Draws images and overlays when they change.

    Args:
        stream: the recording.
        setting: source of camera and classes.
    """

    def __init__(self, stream: rr.RecordingStream, setting: ViewSetting) -> None:
        self._stream = stream
        self._setting = setting
        camera = setting.camera
        self._size_px = (camera.width_px, camera.height_px)
        self._frame_index: int | None = None
        self._mask_s: float | None = None
        self._depth_s: float | None = None
        self._entities = Entities(stream)
        self._depth_size_px: tuple[int, int] | None = None
        stream.log(LENS, _pinhole(camera, _SHOWN_M), static=True)
        names = zip(setting.classes.names, setting.classes.colours, strict=True)
        stream.log(
            MASK,
            rr.AnnotationContext(
                [
                    (place, name, tuple(colour.tolist()))
                    for place, (name, colour) in enumerate(names)
                ]
            ),
            static=True,
        )

    def show_frame(self, frame: Frame | None, fix: MarkFix | None) -> None:
        """Draw the camera's image if it is new, and a ring around the landing mark."""
        if frame is None:
            return
        if frame.index != self._frame_index:
            self._frame_index = frame.index
            # A tenth of the raw size; the flight record keeps the lossless image.
            jpeg, _ = encode_image(frame.image, "high")
            image = rr.EncodedImage(contents=jpeg, media_type="image/jpeg")
            self._stream.log(f"{LENS}/image", image)
        ring = None if fix is None else pad_circle(fix, frame, self._setting.camera)
        if ring is None or fix is None:
            self._entities.clear(f"{LENS}/mark")
            return
        colour = ACCENT if fix.detected else INK
        strip = np.asarray(circle(*ring), dtype=np.float32)
        self._draw(f"{LENS}/mark", [strip], colour, [f"mark {fix.range_m:.2f} m"])

    def show_mask(self, class_map: ClassMap | None) -> None:
        """Draw the mask, and its edges on the camera's image."""
        if class_map is None:
            self._entities.clear(f"{MASK}/ids", f"{LENS}/mask_edges")
            self._mask_s = None
            return
        if class_map.captured_s == self._mask_s:
            return
        self._mask_s = class_map.captured_s
        self._entities.draw(f"{MASK}/ids", rr.SegmentationImage(class_map.ids))
        strips: list[Strip] = []
        colours: list[Colour] = []
        for class_ in np.unique(class_map.ids):
            if class_ == OUTSIDE:
                continue
            found = outlines((class_map.ids == class_).view(np.uint8), self._size_px)
            strips += found
            colours += [self._colour(int(class_))] * len(found)
        edges = rr.LineStrips2D(strips, colors=colours, radii=_EDGE_PX)
        self._entities.draw(f"{LENS}/mask_edges", edges)

    def _colour(self, class_: int) -> Colour:
        colours = self._setting.classes.colours
        if class_ >= len(colours):
            return ALARM
        red, green, blue = (int(value) for value in colours[class_])
        return red, green, blue

    def show_depth(
        self,
        depth: DepthMap | None,
        corridor: Corridor | None,
        frame: Frame | None,
        class_map: ClassMap | None,
    ) -> None:
        """Draw metric depth, and mark the inside of the corridor on the camera's image.

        Args:
            depth: fresh metric depth, or None.
            corridor: fresh corridor, or None.
            frame: the newest frame.
            class_map: the newest class map.
        """
        if depth is None:
            self._entities.clear(f"{DEPTH_LENS}/metres", f"{LENS}/intrusions")
            self._depth_s = None
            return
        if depth.captured_s == self._depth_s:
            return
        self._depth_s = depth.captured_s
        height_px, width_px = depth.depth.shape
        if self._depth_size_px != (width_px, height_px):
            self._depth_size_px = (width_px, height_px)
            lens = _pinhole(self._setting.camera.resized(width_px, height_px), _NO_IMAGE_M)
            self._stream.log(DEPTH_LENS, lens)
        # Half precision resolves 2 mm at 4 m and halves the size.
        metres = np.where(np.isfinite(depth.depth), depth.depth, np.nan).astype(np.float16)
        image = rr.DepthImage(metres, meter=1.0, colormap="turbo", depth_range=[0.0, FARTHEST_M])
        self._entities.draw(f"{DEPTH_LENS}/metres", image)
        self._show_intrusions(depth, corridor, frame, class_map)

    def _show_intrusions(
        self,
        depth: DepthMap,
        corridor: Corridor | None,
        frame: Frame | None,
        class_map: ClassMap | None,
    ) -> None:
        entity = f"{LENS}/intrusions"
        mask = intruding_pixels(self._setting.intruding, frame, class_map, depth)
        strips = [] if mask is None else outlines(mask.astype(np.uint8), self._size_px)
        if corridor is None or not strips:
            self._entities.clear(entity)
            return
        words = [describe_corridor(corridor), *[""] * (len(strips) - 1)]
        self._draw(entity, sorted(strips, key=len, reverse=True), ALARM, words)

    def _draw(self, entity: str, strips: list[Strip], colour: Colour, labels: list[str]) -> None:
        lines = rr.LineStrips2D(strips, colors=[colour], radii=2 * _EDGE_PX, labels=labels)
        self._entities.draw(entity, lines)


def _pinhole(camera: CameraModel, image_m: float) -> rr.Pinhole:
    return rr.Pinhole(
        focal_length=[camera.fx_px, camera.fy_px],
        # Rerun measures from the corner of a pixel, OpenCV from its centre.
        principal_point=[camera.cx_px + 0.5, camera.cy_px + 0.5],
        resolution=[camera.width_px, camera.height_px],
        camera_xyz=rr.ViewCoordinates.RDF,
        image_plane_distance=image_m,
    )
