"""Heights of objects from their upper edges in exact views of both labs."""

import math

import numpy as np
import pytest

from perception.mapping.upper_edges import upper_edges
from perception.mapping.view import View
from sim_bridge.anafi import CAMERA_FORWARD_M
from sim_bridge.plain.caster import Caster
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import ObjectSpec
from sim_bridge.twin.scene import Scene, TakeOffSpec
from tests.worlds import values
from uav_bt.types import ClassMap, Pose2D
from uav_bt.types.site_map import MapObject

HEIGHT_M, FROM_X_M = 1.5, -2.0


def heights(lab: str, *specs: ObjectSpec, pitch_deg: float, off_m: float = 0.0) -> list[float]:
    """Return the heights seen from x = 0; the map has the objects too far away by `off_m`."""
    scene = Scene(name="drawn", lab=lab, objects=specs, take_off=TakeOffSpec(random=True))
    caster, pitch_rad = Caster(scene, (320, 180)), math.radians(pitch_deg)
    camera = CameraPose(x_m=FROM_X_M, y_m=0.0, z_m=HEIGHT_M, yaw_rad=0.0, pitch_rad=pitch_rad)
    class_map = ClassMap(ids=caster.cast(camera)[0], classes=scene.classes, captured_s=0.0)
    frame = values.frame((4, 8), pitch_rad, HEIGHT_M, captured_s=0.0)
    pose = Pose2D(x_m=FROM_X_M - CAMERA_FORWARD_M, y_m=0.0, yaw_rad=0.0)
    view = View.of(class_map, frame, caster.camera, pose)
    assert view is not None
    known = []
    for item in scene.placed:
        base = item.footprint
        known.append(
            MapObject(
                class_id=item.shape.class_id,
                x_m=base.x_m + off_m,
                y_m=-base.y_m,
                yaw_rad=-base.yaw_rad,
                size_m=2 * base.half_x_m,
                width_m=2 * base.half_y_m,
                std_m=0.05,
                seen_s=0.0,
            )
        )
    return upper_edges(view, known).tolist()


def box(x_m: float, height_m: float, kind: str = "box-3", y_m: float = 0.0) -> ObjectSpec:
    size_m = (0.4, 0.4, height_m)
    return ObjectSpec(kind=kind, position_m=(FROM_X_M + x_m, y_m), yaw_deg=20, size_m=size_m)


def test_print() -> None:
    paper, depot = "paper", "depot"
    for s, p in (((box(1.5,.8),),-42),((box(2,1.9),),12),((box(2,1.9),),-42),((box(3.5,1.9),),-5),((box(1.5,1.4),),-10),((box(1.5,.8),box(2.6,1.9,'box-5')),12),((box(1.5,.8),box(2.6,1.9)),12),((box(2,1.9),box(2,1.2,y_m=.8)),0)):
        print([(a.position_m,a.size_m) for a in s],p,heights(paper,*s,pitch_deg=p),heights(paper,*s,pitch_deg=p,off_m=.1))
    for k in ('rack','table','drum','crate','tall_crate','barrier'):
        for yaw in (0,30,90):
            for x in (1.5,2.5):
                for p in (-30,-15,12):
                    print(k,yaw,x,p,np.round(heights(depot,ObjectSpec(kind=k,position_m=(x-2,0),yaw_deg=yaw),pitch_deg=p),3))
