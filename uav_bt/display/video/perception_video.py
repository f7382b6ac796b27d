"""Video of the perception: image with mark, class map, metric depth, corridor."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.display.canvas import ACCENT, BACKDROP, DIM, blank, tag
from uav_bt.display.phrases import describe_fix
from uav_bt.display.video.panes import draw_frame
from uav_bt.display.video.perception_panes import draw_class_map, draw_corridor, draw_depth
from uav_bt.types import CameraModel, ClassMap, Corridor, DepthMap, Frame, MarkFix
from uav_bt.types.arrays import Image

_WIDTH_PX: Final = 1280
_GAP_PX: Final = 2
_FLATTEST: Final = 4.0  # largest aspect ratio of panes, wide or high


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """Data of one image of the video."""

    frame: Frame
    class_map: ClassMap
    depth: DepthMap | None  # metric depth
    refusal: str  # reason why depth is missing or reduced
    corridor: Corridor | None
    intruding: NDArray[np.bool_] | None  # (H, W) pixels inside the corridor
    mark: MarkFix | None


class PerceptionPanes:
    """Composes the four panes; the intrinsics give the true aspect of resized images."""

    def __init__(self, camera: CameraModel) -> None:
        self._camera = camera
        aspect = (camera.width_px / camera.fx_px) / (camera.height_px / camera.fy_px)
        aspect = min(max(aspect, 1.0 / _FLATTEST), _FLATTEST)
        self.size_px = (_WIDTH_PX, round(_WIDTH_PX / aspect / 2) * 2)
        self._pane_px = ((_WIDTH_PX - _GAP_PX) // 2, (self.size_px[1] - _GAP_PX) // 2)

    def draw(self, seen: Seen) -> Image:
        """Return one image of the video, (H, W, 3) RGB."""
        wide, high = size = self._pane_px
        image = blank(self.size_px, BACKDROP)
        image[:high, :wide] = self._draw_frame(seen)
        image[-high:, :wide] = draw_class_map(seen.class_map, size)
        image[:high, -wide:] = draw_depth(seen.depth, size, why_none=seen.refusal)
        image[-high:, -wide:] = draw_corridor(seen.frame.image, seen.corridor, seen.intruding, size)
        return image

    def _draw_frame(self, seen: Seen) -> Image:
        frame, fix = seen.frame, seen.mark
        image = draw_frame(frame, fix, self._camera, self._pane_px)
        tag(image, f"{frame.captured_s:.1f} s", (10, 10), colour=DIM)
        age_s = math.inf if fix is None else frame.captured_s - fix.captured_s
        words = f"mark: {describe_fix(fix, age_s)}"
        tag(image, words, (10, self._pane_px[1] - 30), colour=DIM if fix is None else ACCENT)
        return image
