"""Foxglove's messages, made from ours; times are on the record's timeline."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from foxglove import messages as foxglove
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from uav_bt.lab.classes import LabClasses
from uav_bt.record import Quality
from uav_bt.record.images import ENCODINGS, encode_image
from uav_bt.types import Attitude, CameraModel, Corridor, MarkFix, Pose
from uav_bt.types.ground import Block, Footprint, Ground

Colour = tuple[int, int, int]

_WORLD: Final = "world"  # z up, origin in the ground's middle
_BODY: Final = "drone"  # x forward, y left, z up: the convention of viewers
_CAMERA: Final = "camera"  # OpenCV's: x right, y down, z forward

_OPTICAL: Final = (-0.5, 0.5, -0.5, 0.5)  # from OpenCV's axes to forward, left, up
_NS: Final = 1_000_000_000

_SHOWN_NS: Final = 300_000_000  # an entity that is not repeated goes: three ticks
_WAY_M: Final = 2.0  # drawn length of a way without an end
_HEAD_M: Final = 0.15  # length of the arrow's head
_GROUND: Final = (52, 66, 54)
_UNNAMED: Final = (150, 156, 166)  # of objects without a class
_FREE: Final = (120, 170, 255)
_INTRUDED: Final = (255, 92, 92)
_MARK: Final = (255, 196, 0)


def camera_image(image: NDArray[np.uint8], captured_ns: int, quality: Quality) -> bytes:
    """Return a frame's image, (H, W, 3) RGB, as a CompressedImage."""
    data, name = encode_image(image, quality)
    return foxglove.CompressedImage(
        timestamp=_stamp(captured_ns), frame_id=_CAMERA, data=data, format=name
    ).encode()


def raw(array: NDArray[Any], captured_ns: int) -> bytes:
    """Return an array, (H, W) of uint8, uint16 or float32, as a RawImage."""
    height, width = array.shape
    return foxglove.RawImage(
        timestamp=_stamp(captured_ns),
        frame_id=_CAMERA,
        width=width,
        height=height,
        encoding=ENCODINGS[array.dtype.name],
        step=width * array.itemsize,
        data=array.tobytes(),
    ).encode()


def calibration(camera: CameraModel, time_ns: int) -> bytes:
    """Return a camera as a CameraCalibration."""
    fx, fy, cx, cy = camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px
    return foxglove.CameraCalibration(
        timestamp=_stamp(time_ns),
        frame_id=_CAMERA,
        width=camera.width_px,
        height=camera.height_px,
        distortion_model="plumb_bob" if camera.distortion else "",
        D=list(camera.distortion),
        K=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    ).encode()


def transforms(
    where: Pose, attitude: Attitude, gimbal_pitch_rad: float, camera: CameraModel, time_ns: int
) -> tuple[bytes, bytes]:
    """Return the poses of body and camera in the world, as FrameTransforms."""
    body = _body(where, attitude)
    at_m = np.array([where.x_m, where.y_m, where.z_m])
    lens_m = at_m + body.apply([camera.forward_offset_m, 0.0, 0.0])
    return (
        _transform(_BODY, at_m, body, time_ns),
        _transform(_CAMERA, lens_m, _lens(where, gimbal_pitch_rad), time_ns),
    )


def log_line(level: str, message: str, name: str, time_ns: int) -> bytes:
    """Return a line of a logger; `level` is "Info", "Warning" or "Error"."""
    return foxglove.Log(
        timestamp=_stamp(time_ns),
        level=getattr(foxglove.LogLevel, level),
        message=message,
        name=name,
    ).encode()


def lab_scene(ground: Ground, classes: LabClasses, time_ns: int) -> bytes:
    """Return ground and objects in the colours of their classes, as a SceneUpdate."""
    wide_m, deep_m = ground.size_m
    floor = Footprint(x_m=0.0, y_m=0.0, half_x_m=wide_m / 2, half_y_m=deep_m / 2)
    cubes = [
        foxglove.CubePrimitive(**_solid(Block(footprint=floor, base_m=-0.01, top_m=0.0), _GROUND))
    ]
    cylinders = []
    for item in ground.standing:
        colour = _UNNAMED if item.class_id is None else classes.colours[item.class_id].tolist()
        for block in item.blocks:
            solid = _solid(block, colour)
            if block.footprint.round:
                cylinders.append(
                    foxglove.CylinderPrimitive(**solid, bottom_scale=1.0, top_scale=1.0)
                )
            else:
                cubes.append(foxglove.CubePrimitive(**solid))
    return _scene(time_ns, {"lab": {"cubes": cubes, "cylinders": cylinders}})


def perceived_scene(
    pose: Pose, corridor: Corridor | None, fix: MarkFix | None, time_ns: int
) -> bytes:
    """Return the free way ahead and the mark, seen from a pose, as a SceneUpdate."""
    entities: dict[str, Any] = {}
    if corridor is not None:
        way_m = min(corridor.free_distance_m, _WAY_M)
        head_m = min(_HEAD_M, way_m)
        arrow = foxglove.ArrowPrimitive(
            pose=_placed(pose),
            shaft_length=way_m - head_m,
            shaft_diameter=0.04,
            head_length=head_m,
            head_diameter=0.1,
            color=_colour(_FREE if corridor.nearest_side is None else _INTRUDED),
        )
        entities["way"] = {"arrows": [arrow]}
    if fix is not None:
        x_m, y_m = pose.to_world(fix.forward_m, -fix.right_m)
        where = Pose(x_m=x_m, y_m=y_m, z_m=fix.height_m, yaw_rad=0.0)
        wide_m = 2 * max(fix.std_m, 0.05)
        size = foxglove.Vector3(x=wide_m, y=wide_m, z=wide_m)
        ball = foxglove.SpherePrimitive(pose=_placed(where), size=size, color=_colour(_MARK))
        entities["mark"] = {"spheres": [ball]}
    return _scene(time_ns, entities, lifetime=foxglove.Duration(0, _SHOWN_NS))


def _scene(time_ns: int, entities: dict[str, Any], **about: Any) -> bytes:
    made = [
        foxglove.SceneEntity(
            timestamp=_stamp(time_ns), frame_id=_WORLD, id=name, **content, **about
        )
        for name, content in entities.items()
    ]
    return foxglove.SceneUpdate(entities=made).encode()


def _solid(block: Block, colour: Colour) -> dict[str, Any]:
    outline, high_m = block.footprint, block.top_m - block.base_m
    middle_m = block.base_m + high_m / 2
    where = Pose(x_m=outline.x_m, y_m=outline.y_m, z_m=middle_m, yaw_rad=outline.yaw_rad)
    size = foxglove.Vector3(x=2 * outline.half_x_m, y=2 * outline.half_y_m, z=high_m)
    return {"pose": _placed(where), "size": size, "color": _colour(colour)}


def _placed(where: Pose) -> foxglove.Pose:
    return foxglove.Pose(
        position=foxglove.Vector3(x=where.x_m, y=where.y_m, z=where.z_m),
        orientation=_quaternion(_body(where, Attitude())),
    )


def _colour(rgb: Colour) -> foxglove.Color:
    red, green, blue = (channel / 255 for channel in rgb)
    return foxglove.Color(r=red, g=green, b=blue, a=1.0)


def _stamp(time_ns: int) -> foxglove.Timestamp:
    return foxglove.Timestamp(time_ns // _NS, time_ns % _NS)


def _transform(child: str, at_m: NDArray[np.float64], turn: Rotation, time_ns: int) -> bytes:
    return foxglove.FrameTransform(
        timestamp=_stamp(time_ns),
        parent_frame_id=_WORLD,
        child_frame_id=child,
        translation=foxglove.Vector3(x=float(at_m[0]), y=float(at_m[1]), z=float(at_m[2])),
        rotation=_quaternion(turn),
    ).encode()


def _quaternion(turn: Rotation) -> foxglove.Quaternion:
    x, y, z, w = turn.as_quat()
    return foxglove.Quaternion(x=x, y=y, z=z, w=w)


def _body(where: Pose, attitude: Attitude) -> Rotation:
    """Return the turn from the body to the world; the attitude's yaw is not used."""
    # With y to the left and z up, raising the nose is a negative turn about y.
    return Rotation.from_euler("ZYX", [where.yaw_rad, -attitude.pitch_rad, attitude.roll_rad])


def _lens(where: Pose, gimbal_pitch_rad: float) -> Rotation:
    level = Rotation.from_euler("ZY", [where.yaw_rad, -gimbal_pitch_rad])
    return level * Rotation.from_quat(_OPTICAL)
