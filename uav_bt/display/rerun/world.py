"""The lab in 3D in Rerun: objects, drone, lens, path, corridor and remembered obstacles.

The world has z up and yaw counter-clockwise. The body's telemetry has z down and yaw clockwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from uav_bt.display.canvas import ACCENT, ALARM, INK, Colour
from uav_bt.display.flown_path import FlownPath
from uav_bt.display.lab_map import GROUND_COLOUR, LabMap, MapItem, phase_colours
from uav_bt.display.rerun.layout import Entities
from uav_bt.display.rerun.setting import (
    BODY,
    CORRIDOR,
    DEPTH_LENS,
    FIX,
    LAB,
    LENS,
    OBSTACLES,
    PATH,
    WORLD,
    CorridorSize,
    ViewSetting,
)
from uav_bt.types import (
    CameraModel,
    Corridor,
    Frame,
    MarkFix,
    MoverState,
    NearObstacles,
    Pose,
    projection,
    rotate,
)
from uav_bt.types.dead_reckoning import PoseHistory

_PLANE: Final = (120, 170, 255, 26)
_INTRUDED: Final = (*ALARM, 110)
_THIN_M: Final = 0.004
_KEPT_S: Final = 2.0  # history of poses; older frames are not drawn
_OBSTACLE_M: Final = 0.03


def camera_axes(yaw_rad: float, pitch_rad: float) -> NDArray[np.float64]:
    """Return the rotation from the camera frame (x right, y down, z forward) to the world frame.

    Args:
        yaw_rad: heading of the body, counter-clockwise from world x.
        pitch_rad: pitch of the gimbal, 0 level, negative down.

    Returns:
        (3, 3) matrix; its columns are the camera's axes in the world.
    """
    forward, right = rotate(1.0, 0.0, yaw_rad), rotate(0.0, -1.0, yaw_rad)
    level = np.array([[*forward, 0.0], [*right, 0.0], [0.0, 0.0, -1.0]]).T
    return np.asarray(level @ projection.camera_axes(pitch_rad))


def corridor_planes(
    size: CorridorSize,
) -> dict[str, tuple[tuple[float, ...], tuple[float, ...]]]:
    """Return centre and half sizes of the five planes: forward, left and up from the body."""
    a, b, c = size.front_m / 2.0, size.side_m, size.up_down_m
    return {
        "left": ((a, b, 0.0), (a, _THIN_M, c)),
        "right": ((a, -b, 0.0), (a, _THIN_M, c)),
        "front": ((2.0 * a, 0.0, 0.0), (_THIN_M, b, c)),
        "up": ((a, 0.0, c), (a, b, _THIN_M)),
        "down": ((a, 0.0, -c), (a, b, _THIN_M)),
    }


class WorldView:
    """Draws the lab once, and its moving parts at each tick.

    Args:
        stream: the recording.
        setting: the constants of the flight.
    """

    def __init__(self, stream: rr.RecordingStream, setting: ViewSetting) -> None:
        self._stream = stream
        self._camera = setting.camera
        self._corridor = setting.corridor
        self._history = PoseHistory[Pose](_KEPT_S)
        self._frame_index: int | None = None
        self._corridor_s: float | None = None
        self._before: Pose | None = None
        self._entities = Entities(stream)
        stream.log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        half = [size_m / 2.0 for size_m in setting.airframe.body_size_m]
        body = rr.Boxes3D(half_sizes=[half], colors=[INK], fill_mode="solid")
        stream.log(f"{BODY}/hull", body, static=True)
        nose = rr.Arrows3D(
            origins=[[half[0], 0.0, 0.0]], vectors=[[0.15, 0.0, 0.0]], colors=[ACCENT], radii=0.012
        )
        stream.log(f"{BODY}/nose", nose, static=True)
        self._movers = () if setting.lab_map is None else setting.lab_map.movers
        if setting.lab_map is not None:
            draw_lab(stream, setting.lab_map)

    def show_drone(self, time_s: float, flown: FlownPath) -> None:
        """Draw the drone and the newest piece of its path."""
        pose = flown.pose
        if pose is None:
            return
        self._history.add(time_s, pose)
        self._stream.log(BODY, _placed(pose))
        phase = flown.points[-1].phase
        if self._before is not None:
            ends = [[one.x_m, one.y_m, one.z_m] for one in (self._before, pose)]
            colour = phase_colours(flown.phases)[phase]
            self._stream.log(PATH, rr.LineStrips3D([ends], colors=[colour], radii=0.012))
        self._before = pose

    def show_movers(self, states: Sequence[MoverState]) -> None:
        """Draw the movers."""
        for mover, state in zip(self._movers, states, strict=False):
            size_m, colour = mover.item.size_m, mover.item.colour
            shape: rr.AsComponents = (
                rr.Cylinders3D(lengths=[size_m[2]], radii=[size_m[0] / 2.0], colors=[colour])
                if mover.round
                else rr.Boxes3D(half_sizes=[[side / 2.0 for side in size_m]], colors=[colour])
            )
            self._entities.draw(f"{LAB}/{state.name}", _placed(state.pose), shape)

    def show_lens(self, frame: Frame | None) -> None:
        """Draw the lens at its pose when the newest frame was captured."""
        if frame is None or frame.index == self._frame_index:
            return
        self._frame_index = frame.index
        pose = self._history.at(frame.captured_s)
        if pose is not None:
            for entity in (LENS, DEPTH_LENS):
                self._stream.log(entity, _lens(pose, frame.gimbal_pitch_rad, self._camera))

    def show_corridor(self, corridor: Corridor | None) -> None:
        """Draw the five planes at their pose when the corridor's frame was captured."""
        if self._corridor is None or corridor is None:
            self._entities.clear(CORRIDOR)
            self._corridor_s = None
            return
        if corridor.captured_s == self._corridor_s:
            return
        self._corridor_s = corridor.captured_s
        pose = self._history.at(corridor.captured_s)
        if pose is None:
            return
        planes = corridor_planes(self._corridor)
        colours = [_INTRUDED if side == corridor.nearest_side else _PLANE for side in planes]
        boxes = rr.Boxes3D(
            centers=[centre for centre, _ in planes.values()],
            half_sizes=[half for _, half in planes.values()],
            colors=colours,
            fill_mode="transparentfillmajorwireframe",
            radii=0.004,
        )
        self._entities.draw(CORRIDOR, _placed(pose), boxes)

    def show_near(self, near: NearObstacles | None, fix: MarkFix | None) -> None:
        """Draw obstacles and edges near the drone, and the mark at its estimated position."""
        pose = self._before
        if pose is None:
            return
        if near is None or not len(near.points_m) + len(near.edges_m):
            self._entities.clear(OBSTACLES)
        else:
            points = rr.Points3D(
                _on_ground(pose, np.vstack([near.points_m, near.edges_m])),
                colors=[ALARM] * len(near.points_m) + [INK] * len(near.edges_m),
                radii=_OBSTACLE_M,
            )
            self._entities.draw(OBSTACLES, points)
        if fix is None:
            self._entities.clear(FIX)
            return
        at = _on_ground(pose, np.array([[fix.forward_m, fix.right_m]]))
        colour = ACCENT if fix.detected else INK
        sure_m = max(fix.std_m, 0.05)
        mark = rr.Points3D(at, colors=[colour], radii=sure_m, labels=["mark"])
        self._entities.draw(FIX, mark)


def _placed(pose: Pose) -> rr.Transform3D:
    return rr.Transform3D(
        translation=[pose.x_m, pose.y_m, pose.z_m],
        rotation=rr.RotationAxisAngle(axis=[0.0, 0.0, 1.0], radians=pose.yaw_rad),
    )


def _lens(pose: Pose, pitch_rad: float, camera: CameraModel) -> rr.Transform3D:
    ahead_m = camera.forward_offset_m
    return rr.Transform3D(
        translation=[*pose.to_world(ahead_m, 0.0), pose.z_m],
        mat3x3=camera_axes(pose.yaw_rad, pitch_rad),
    )


def _on_ground(pose: Pose, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points on the ground, given forward and right of the body, as world points (N, 3)."""
    return np.column_stack([pose.points_to_world(points_m * (1.0, -1.0)), np.zeros(len(points_m))])


def draw_lab(stream: rr.RecordingStream, lab: LabMap) -> None:
    """Draw the constant content of the lab: ground, boxes and mark."""
    wide, deep = lab.ground_size_m
    ground = rr.Boxes3D(
        centers=[[0.0, 0.0, -0.005]],
        half_sizes=[[wide / 2.0, deep / 2.0, 0.005]],
        colors=[GROUND_COLOUR],
        fill_mode="solid",
    )
    stream.log(f"{LAB}/ground", ground, static=True)
    things = [part for box in lab.boxes for part in _parts(box)]
    if lab.mark is not None:
        things.append(lab.mark)
    if things:
        filled = _boxes(things, [thing.colour for thing in things], filled=True)
        stream.log(f"{LAB}/things", filled, static=True)
        stream.log(f"{LAB}/edges", _boxes(things, [INK], filled=False), static=True)
    if lab.mark is not None:
        stream.log(f"{LAB}/h", _letter(lab.mark), static=True)


def _parts(item: MapItem) -> list[MapItem]:
    """Return the boxes that an object consists of; itself if it is solid."""
    return [
        replace(
            item,
            x_m=part.footprint.x_m,
            y_m=part.footprint.y_m,
            size_m=(
                2.0 * part.footprint.half_x_m,
                2.0 * part.footprint.half_y_m,
                part.top_m - part.base_m,
            ),
            base_m=part.base_m,
        )
        for part in item.parts
    ] or [item]


def _boxes(things: list[MapItem], colours: list[Colour], *, filled: bool) -> rr.Boxes3D:
    return rr.Boxes3D(
        centers=[[thing.x_m, thing.y_m, thing.base_m + thing.size_m[2] / 2.0] for thing in things],
        half_sizes=[[side / 2.0 for side in thing.size_m] for thing in things],
        rotations=[
            rr.RotationAxisAngle(axis=[0.0, 0.0, 1.0], radians=thing.yaw_rad) for thing in things
        ],
        colors=colours,
        radii=0.004,
        fill_mode="solid" if filled else "majorwireframe",
    )


def _letter(pad: MapItem) -> rr.LineStrips3D:
    top_m = pad.size_m[2] + 0.005
    lines = [[(*end, top_m) for end in stroke] for stroke in pad.letter()]
    return rr.LineStrips3D(lines, colors=[(255, 255, 255)], radii=0.02)
