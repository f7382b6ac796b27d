"""An unknown name is refused wherever names are looked up, with the nearest known one."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from perception.depth.metric import MetricDepthMaker
from perception.depth.runtime import load_depth_estimator
from perception.networks.mapping import class_id_of
from perception.networks.weights_file import segmentation_file
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene_file import load_scene
from tests.paper_lab import CLASSES
from tests.perception.marks.mark_views import tag_mark
from uav_bt import app, plugins
from uav_bt.board.blackboard import Blackboard
from uav_bt.board.keys import MISSION_KEYS
from uav_bt.clock import ManualClock
from uav_bt.errors import UavBtError
from uav_bt.lab.shipped import load_lab
from uav_bt.testing.faults import Fault
from uav_bt.tree import NodeRegistry, shipped_subtree
from uav_bt.tree.shipped import resolve_tree, write_starter

TAG: Final = {"id": 7, "size_m": 0.36}
LOOK_UPS: Final[dict[str, tuple[Callable[[str], object], str]]] = {
    "node": (lambda name: NodeRegistry.installed()[name], "TakeOff"),
    "policy": (plugins.make_policy, "corridor"),
    "drone": (lambda name: plugins.load(plugins.DRONES, name), "twin"),
    "landing mark": (lambda name: plugins.make_mark_finder(tag_mark(kind=name)), "apriltag"),
    "family of tags": (
        lambda name: plugins.make_mark_finder(tag_mark(options={**TAG, "family": name})),
        "36h11",
    ),
    "mission": (resolve_tree, "land_only"),
    "tree of the library": (shipped_subtree, "ReturnToBase"),
    "starter": (lambda name: write_starter(Path("x.xml"), name), "hover"),
    "lab": (load_lab, "depot"),
    "scene": (load_scene, "train-a"),
    "profile": (Profile.named, "harsh"),
    "class": (CLASSES.id_of, "helipad_box"),
    "class or role": (lambda name: class_id_of(name, CLASSES), "carpet"),
    "segmentation network": (segmentation_file, "unet"),
    "depth network": (load_depth_estimator, "depth"),
    "depth source": (
        lambda name: MetricDepthMaker(None, source=name, generator=np.random.default_rng(0)),
        "fused",
    ),
    "board key": (Blackboard(ManualClock(), MISSION_KEYS).key, "odometry"),
    "landing place": (lambda name: app.JudgeConfig(land_on=name), "mark"),
    "fault": (Fault.parse, "black"),
    "option of a flight": (lambda name: app.fly("land_only", **{name: "val-a"}), "scene"),
}
"""A look-up by name, and a name that it knows."""


@pytest.mark.parametrize("kind", LOOK_UPS)
def test_an_unknown_name_is_refused_with_the_nearest_known_one(kind: str) -> None:
    look_up, known = LOOK_UPS[kind]
    typed = known[:-2] + known[-1]
    with pytest.raises(UavBtError, match=rf"{re.escape(typed)}\b.*did you mean '{known}'"):
        look_up(typed)
