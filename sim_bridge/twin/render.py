"""Renderer of the twin: colours, class ids and depth of a camera view, at any size.

Only movers move and the drone is not drawn, so MuJoCo's list of geoms is made once. After that, an
image needs only the poses of the camera and the movers. A size with another aspect than the
camera's gives the same view resized, never cropped.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType
from typing import Any, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim_bridge.anafi import FOCAL_SHARE
from sim_bridge.twin.builder import LabModel
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.gl import no_gl, open_context
from uav_bt.errors import ValueRangeError
from uav_bt.types import MoverState

_ASPECT = 9.0 / 16.0


class Renderer:
    """Renders images of one lab. Use it in the thread that made it, and close it when done.

    Args:
        lab: the compiled scene.
        samples: anti-aliasing samples per pixel. The default is 0: without a GPU four samples
            double the time of an image, and the lens blur softens the edges.

    Raises:
        MissingDependencyError: OpenGL does not work here; the message names the remedy.
        InputError: this process was forked from one that has drawn.
    """

    def __init__(self, lab: LabModel, *, samples: int = 0) -> None:
        model = lab.model
        model.vis.quality.offsamples = samples
        self._size = (model.vis.global_.offwidth, model.vis.global_.offheight)
        self._near = float(model.vis.map.znear * model.stat.extent)
        self._far = float(model.vis.map.zfar * model.stat.extent)
        try:
            self._gl = open_context(64, 64)  # of any size: drawing goes to the off-screen buffer
            self._gl.make_current()
            self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        except (ImportError, AttributeError, RuntimeError, mujoco.FatalError) as error:
            raise no_gl(error) from error
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        self._model, self._data = model, mujoco.MjData(model)
        self._starts_m = np.array(self._data.mocap_pos)
        self.scene = self._static_scene(model)
        self._moving = [  # movers only change their position; they do not turn
            geom
            for geom in self.scene.geoms[: self.scene.ngeom]
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM
            and model.body_mocapid[model.geom_bodyid[geom.objid]] >= 0
        ]
        self._class_of_segment = self._segment_table(lab)

    def _static_scene(self, model: Any) -> Any:
        data = self._data
        mujoco.mj_forward(model, data)
        scene = mujoco.MjvScene(model, maxgeom=model.ngeom + 16)
        option = mujoco.MjvOption()
        mujoco.mjv_updateScene(
            model,
            data,
            option,
            None,
            mujoco.MjvCamera(),
            mujoco.mjtCatBit.mjCAT_ALL.value,
            scene,
        )
        scene.stereo = mujoco.mjtStereo.mjSTEREO_NONE
        half_width = self._near / (2.0 * FOCAL_SHARE)
        for camera in scene.camera:
            camera.frustum_near, camera.frustum_far = self._near, self._far
            camera.frustum_center = 0.0
            camera.frustum_width = half_width
            camera.frustum_top = half_width * _ASPECT
            camera.frustum_bottom = -half_width * _ASPECT
            camera.orthographic = 0
        return scene

    def _segment_table(self, lab: LabModel) -> NDArray[np.uint8]:
        table = np.zeros(self.scene.ngeom + 1, np.uint8)
        for geom in self.scene.geoms[: self.scene.ngeom]:
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and geom.segid >= 0:
                table[geom.segid + 1] = lab.class_of_geom[geom.objid]
        return table

    def rgb(
        self, pose: CameraPose, width_px: int, height_px: int, movers: Sequence[MoverState] = ()
    ) -> NDArray[np.uint8]:
        """Return the image, (height_px, width_px, 3) uint8 RGB.

        Args:
            pose: pose of the camera.
            width_px: image width, pixels.
            height_px: image height, pixels.
            movers: states of the scene's movers; by default they are at the start of their paths.
        """
        image = np.empty((height_px, width_px, 3), np.uint8)
        self._place(movers)
        self._draw(pose, width_px, height_px, segments=False)
        mujoco.mjr_readPixels(image, None, self._rect, self._context)
        return np.ascontiguousarray(image[::-1])

    def ids_and_depth(
        self, pose: CameraPose, width_px: int, height_px: int, movers: Sequence[MoverState] = ()
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Return the exact class ids and the exact depth of one view.

        Returns:
            Ids (height_px, width_px) uint8, and depth (height_px, width_px) float32, metres along
            the optical axis.
        """
        colours = np.empty((height_px, width_px, 3), np.uint8)
        buffer = np.empty((height_px, width_px), np.float32)
        self._place(movers)
        self._draw(pose, width_px, height_px, segments=True)
        mujoco.mjr_readPixels(colours, buffer, self._rect, self._context)
        ids = self._classes_at(colours)
        near, far = np.float32(self._near), np.float32(self._far)
        depth = near * far / (near + buffer[::-1] * (far - near))
        return ids, np.ascontiguousarray(depth, np.float32)

    def class_ids(
        self, pose: CameraPose, width_px: int, height_px: int, movers: Sequence[MoverState] = ()
    ) -> NDArray[np.uint8]:
        """Return the exact class ids, (height_px, width_px) uint8."""
        colours = np.empty((height_px, width_px, 3), np.uint8)
        self._place(movers)
        self._draw(pose, width_px, height_px, segments=True)
        mujoco.mjr_readPixels(colours, None, self._rect, self._context)
        return self._classes_at(colours)

    def _classes_at(self, colours: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the class ids of numbered colours, the rows reversed."""
        numbers: NDArray[Any] = colours[::-1, :, 0]
        if len(self._class_of_segment) > 256:  # the first channel holds fewer numbers
            numbers = numbers + 256 * colours[::-1, :, 1].astype(np.int32)
        return np.asarray(self._class_of_segment[numbers], np.uint8)

    def _place(self, movers: Sequence[MoverState]) -> None:
        """Set the positions of the movers in the list of geoms."""
        if not self._moving:
            return
        data = self._data
        data.mocap_pos[:] = self._starts_m
        for row, mover in enumerate(movers):
            data.mocap_pos[row, :2] = mover.pose.x_m, mover.pose.y_m
        mujoco.mj_kinematics(self._model, data)
        for drawn in self._moving:
            drawn.pos[:] = data.geom_xpos[drawn.objid]

    def _draw(self, pose: CameraPose, width_px: int, height_px: int, *, segments: bool) -> None:
        if self._context is None:
            raise ValueRangeError("this renderer is closed; make another one")
        self._gl.make_current()
        self._fit(width_px, height_px)
        axis, up = pose.axes()
        for camera in self.scene.camera:
            camera.pos[:] = (pose.x_m, pose.y_m, pose.z_m)
            camera.forward[:] = axis
            camera.up[:] = up
        flags = self.scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = segments
        flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = segments
        self._rect = mujoco.MjrRect(0, 0, width_px, height_px)
        mujoco.mjr_render(self._rect, self.scene, self._context)

    def _fit(self, width_px: int, height_px: int) -> None:
        if width_px < 1 or height_px < 1:
            raise ValueRangeError(f"image size must be positive, got {width_px}x{height_px}")
        if width_px > self._size[0] or height_px > self._size[1]:
            self._size = max(width_px, self._size[0]), max(height_px, self._size[1])
            mujoco.mjr_resizeOffscreen(*self._size, self._context)

    def close(self) -> None:
        """Free the GL context; safe to call twice."""
        if self._context is not None:
            self._gl.make_current()
            self._context.free()
            self._gl.free()
            self._context = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
