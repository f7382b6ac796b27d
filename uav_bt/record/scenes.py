"""The lab, the free way and the mark in 3D, as Foxglove's SceneUpdate; viewers draw them."""

from __future__ import annotations

from typing import Any, Final

from foxglove import messages as foxglove

from uav_bt.lab.classes import LabClasses
from uav_bt.record.messages import WORLD, placed, stamp
from uav_bt.types import Corridor, MarkFix, Pose
from uav_bt.types.ground import Block, Footprint, Ground

Colour = tuple[int, int, int]

_SHOWN_NS: Final = 300_000_000  # an entity that is not repeated goes: three ticks
_WAY_M: Final = 2.0  # drawn length of a way without an end
_GROUND: Final = (52, 66, 54)
_UNNAMED: Final = (150, 156, 166)  # of objects without a class
_FREE: Final = (120, 170, 255)
_INTRUDED: Final = (255, 92, 92)
_MARK: Final = (255, 196, 0)


def lab_scene(ground: Ground, classes: LabClasses, time_ns: int) -> bytes:
    """Return the ground and its objects in the colours of their classes."""
    wide_m, deep_m = ground.size_m
    floor = Footprint(x_m=0.0, y_m=0.0, half_x_m=wide_m / 2, half_y_m=deep_m / 2)
    blocks = [(Block(footprint=floor, base_m=-0.01, top_m=0.0), _GROUND)]
    for item in ground.standing:
        red, green, blue = (
            _UNNAMED if item.class_id is None else classes.colours[item.class_id].tolist()
        )
        blocks += [(block, (red, green, blue)) for block in item.blocks]
    lab = foxglove.SceneEntity(
        timestamp=stamp(time_ns),
        frame_id=WORLD,
        id="lab",
        cubes=[
            foxglove.CubePrimitive(**_solid(*one)) for one in blocks if not one[0].footprint.round
        ],
        cylinders=[
            foxglove.CylinderPrimitive(**_solid(*one), bottom_scale=1.0, top_scale=1.0)
            for one in blocks
            if one[0].footprint.round
        ],
    )
    return foxglove.SceneUpdate(entities=[lab]).encode()


def _solid(block: Block, colour: Colour) -> dict[str, Any]:
    outline, high_m = block.footprint, block.top_m - block.base_m
    middle_m = block.base_m + high_m / 2
    where = Pose(x_m=outline.x_m, y_m=outline.y_m, z_m=middle_m, yaw_rad=outline.yaw_rad)
    size = foxglove.Vector3(x=2 * outline.half_x_m, y=2 * outline.half_y_m, z=high_m)
    return {"pose": placed(where), "size": size, "color": _colour(colour)}


def perceived_scene(
    pose: Pose, corridor: Corridor | None, fix: MarkFix | None, time_ns: int
) -> bytes:
    """Return the free way ahead, with the nearest intrusion, and the mark, seen from a pose."""
    entities = []

    def add(name: str, **what: Any) -> None:
        entity = foxglove.SceneEntity(
            timestamp=stamp(time_ns),
            frame_id=WORLD,
            id=name,
            lifetime=foxglove.Duration(0, _SHOWN_NS),
            **what,
        )
        entities.append(entity)

    if corridor is not None:
        way_m, side = min(corridor.free_distance_m, _WAY_M), corridor.nearest_side
        head_m = min(0.15, way_m)
        arrow = foxglove.ArrowPrimitive(
            pose=placed(pose),
            shaft_length=way_m - head_m,
            shaft_diameter=0.04,
            head_length=head_m,
            head_diameter=0.1,
            color=_colour(_FREE if side is None else _INTRUDED),
        )
        words = "" if side is None else f"{side}, {corridor.nearest_m:.2f} m"
        add("way", arrows=[arrow], texts=[_words(words, pose)] if words else [])
    if fix is not None:
        x_m, y_m = pose.to_world(fix.forward_m, -fix.right_m)
        where = Pose(x_m=x_m, y_m=y_m, z_m=fix.height_m, yaw_rad=0.0)
        wide_m = 2 * max(fix.std_m, 0.05)
        size = foxglove.Vector3(x=wide_m, y=wide_m, z=wide_m)
        ball = foxglove.SpherePrimitive(pose=placed(where), size=size, color=_colour(_MARK))
        add("mark", spheres=[ball], texts=[_words(f"mark {fix.range_m:.2f} m", where)])
    return foxglove.SceneUpdate(entities=entities).encode()


def _words(text: str, pose: Pose) -> foxglove.TextPrimitive:
    return foxglove.TextPrimitive(
        pose=placed(pose), billboard=True, font_size=0.1, color=_colour((255, 255, 255)), text=text
    )


def _colour(rgb: Colour) -> foxglove.Color:
    red, green, blue = (channel / 255 for channel in rgb)
    return foxglove.Color(r=red, g=green, b=blue, a=1.0)
