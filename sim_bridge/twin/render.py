"""Renderer of the twin: colours, class ids and depth of a camera view, at any size.

Only movers move and the drone is not drawn, so MuJoCo's list of geoms is made once. After that, an
image needs only the poses of the camera and the movers. A size with another aspect than the
camera's gives the same view resized, never cropped.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sim_bridge.anafi import FOCAL_SHARE
from sim_bridge.twin.builder import LabModel
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.gl import mujoco, no_gl, open_context
from uav_bt.errors import ValueRangeError
from uav_bt.types import MoverState

_ASPECT = 9.0 / 16.0


class Renderer:
    """Renders images of one compiled lab.

    Use it in the thread that made it, and close it when done. Where OpenGL does not work, the error
    names the remedy.
    """

    def __init__(self, lab: LabModel) -> None:
        model = lab.model
        # Without a GPU four samples double the time of an image, and the lens blur softens edges.
        model.vis.quality.offsamples = 0
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
        self.scene = self._static_scene()
        self._class_of_segment = np.zeros(self.scene.ngeom + 1, np.uint8)
        self._moving = []  # movers only change their position; they do not turn
        for geom in self.scene.geoms[: self.scene.ngeom]:
            if geom.objtype != mujoco.mjtObj.mjOBJ_GEOM:
                continue
            if geom.segid >= 0:
                self._class_of_segment[geom.segid + 1] = lab.class_of_geom[geom.objid]
            if model.body_mocapid[model.geom_bodyid[geom.objid]] >= 0:
                self._moving.append(geom)

    def _static_scene(self) -> Any:
        model, data = self._model, self._data
        mujoco.mj_forward(model, data)
        scene = mujoco.MjvScene(model, maxgeom=model.ngeom + 16)
        every, camera = mujoco.mjtCatBit.mjCAT_ALL.value, mujoco.MjvCamera()
        mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, camera, every, scene)
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

    def rgb(
        self, pose: CameraPose, width_px: int, height_px: int, movers: Sequence[MoverState] = ()
    ) -> NDArray[np.uint8]:
        """Return the image of a camera, (height_px, width_px, 3) uint8 RGB.

        Without states of the scene's movers they are at the start of their paths.
        """
        image = np.empty((height_px, width_px, 3), np.uint8)
        rect = self._draw(pose, width_px, height_px, movers, segments=False)
        mujoco.mjr_readPixels(image, None, rect, self._context)
        return np.ascontiguousarray(image[::-1])

    def ids_and_depth(
        self, pose: CameraPose, width_px: int, height_px: int, movers: Sequence[MoverState] = ()
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Return exact class ids, and depth along the optical axis in metres, uint8 and float32."""
        colours = np.empty((height_px, width_px, 3), np.uint8)
        buffer = np.empty((height_px, width_px), np.float32)
        rect = self._draw(pose, width_px, height_px, movers, segments=True)
        mujoco.mjr_readPixels(colours, buffer, rect, self._context)
        numbers: NDArray[Any] = colours[::-1, :, 0]
        if len(self._class_of_segment) > 256:  # the first channel holds fewer numbers
            numbers = numbers + 256 * colours[::-1, :, 1].astype(np.int32)
        near, far = np.float32(self._near), np.float32(self._far)
        depth = near * far / (near + buffer[::-1] * (far - near))
        return self._class_of_segment[numbers], np.ascontiguousarray(depth, np.float32)

    def class_ids(
        self, pose: CameraPose, width_px: int, height_px: int, movers: Sequence[MoverState] = ()
    ) -> NDArray[np.uint8]:
        """Return the exact class ids, (height_px, width_px) uint8."""
        return self.ids_and_depth(pose, width_px, height_px, movers)[0]

    def _place(self, movers: Sequence[MoverState]) -> None:
        """Set the positions of the movers in the list of geoms."""
        data = self._data
        data.mocap_pos[:] = self._starts_m
        for row, mover in enumerate(movers):
            data.mocap_pos[row, :2] = mover.pose.x_m, mover.pose.y_m
        mujoco.mj_kinematics(self._model, data)
        for drawn in self._moving:
            drawn.pos[:] = data.geom_xpos[drawn.objid]

    def _draw(
        self,
        pose: CameraPose,
        width_px: int,
        height_px: int,
        movers: Sequence[MoverState],
        *,
        segments: bool,
    ) -> Any:
        """Draw colours or numbered segments; return the rectangle to read."""
        if self._context is None:
            raise ValueRangeError("this renderer is closed; make another one")
        if width_px < 1 or height_px < 1:
            raise ValueRangeError(f"image size must be positive, got {width_px}x{height_px}")
        self._gl.make_current()
        if width_px > self._size[0] or height_px > self._size[1]:
            self._size = max(width_px, self._size[0]), max(height_px, self._size[1])
            mujoco.mjr_resizeOffscreen(*self._size, self._context)
        if self._moving:
            self._place(movers)
        axis, up = pose.axes()
        for camera in self.scene.camera:
            camera.pos[:] = (pose.x_m, pose.y_m, pose.z_m)
            camera.forward[:] = axis
            camera.up[:] = up
        flags = self.scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = segments
        flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = segments
        rect = mujoco.MjrRect(0, 0, width_px, height_px)
        mujoco.mjr_render(rect, self.scene, self._context)
        return rect

    def close(self) -> None:
        """Free the GL context; safe to call twice."""
        if self._context is not None:
            self._gl.make_current()
            self._context.free()
            self._gl.free()
            self._context = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
