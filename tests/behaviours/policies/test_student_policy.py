"""The control student as a leaf policy: pixels and movements in, a decision out."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from behaviours.fly.explore import Explore
from behaviours.policies import student
from behaviours.policies.student import StudentPolicy
from perception.control.ego_state import ControlNetConfig
from perception.control.runtime import OnnxControlStudent
from perception.control.training.network import STUDENT_FILES, ControlNet
from tests.behaviours.policies import cast_world
from tests.worlds import values
from uav_bt.answers import Advance, Blocked
from uav_bt.errors import InputError, MissionError
from uav_bt.plugins import make_policy
from uav_bt.protocols import PolicyView
from uav_bt.testing import LeafBench
from uav_bt.tree import Status
from uav_bt.types import PastView, RecentViews
from uav_bt.types.dead_reckoning import OdometryPose

NET = ControlNetConfig(
    width_px=32, height_px=16, channels=(4, 8), bottleneck=4, embedding=8, hidden=8
)
GO = (3.0, 0.0, 0.7, -3.0, 0.9)  # advance, clockwise, step, ground ends, free


@pytest.fixture
def policy_saying(tmp_path: Path) -> Any:
    """Return a function that makes a policy whose network says the same of everything."""

    def make(*outputs: float) -> StudentPolicy:
        net = ControlNet(NET).eval()
        with torch.no_grad():
            net.head.weight.zero_()
            net.head.bias.copy_(torch.tensor(outputs))
        path = tmp_path / "student.safetensors"
        STUDENT_FILES.save(path, net, notes={})
        STUDENT_FILES.export(path, path.with_suffix(".onnx"))
        return StudentPolicy(path.with_suffix(".onnx"))

    return make


def seen(**changed: Any) -> PolicyView:
    """Return what a drone sees that flew ahead, with twelve views, ten a second."""
    rng = np.random.default_rng(0)
    views = []
    for index in range(12):
        image = rng.integers(0, 256, (36, 64, 3), dtype=np.uint8)
        pose = OdometryPose(time_s=0.1 * index, x_m=0.04 * index, y_m=0.0, yaw_rad=0.0)
        frame = values.frame(image, captured_s=0.1 * index, index=index)
        views.append(PastView(frame=frame, pose=pose))
    recent = RecentViews(views=tuple(views))
    return cast_world.view(cast_world.cast(), recent=recent, **changed)


@pytest.mark.parametrize(("said_m", "flown_m"), [(0.05, 0.3), (0.7, 0.7), (7.0, 1.0)])
def test_steps_keep_to_the_rules_lengths(policy_saying: Any, said_m: float, flown_m: float) -> None:
    decision = policy_saying(3.0, 0.0, said_m, -3.0, said_m).decide(seen())
    assert decision.forward_m == pytest.approx(flown_m)
    assert decision.free_m == pytest.approx(min(said_m, 1.0))
    assert (decision.yaw_rad, decision.reason) == (0.0, "clear 0.95")


def test_it_turns_to_the_side_the_network_says(policy_saying: Any) -> None:
    for said, shown, side, reason in (
        ((-3.0, 1.0, 0.7, 3.0, 0.2), {}, 1, "edge 0.05"),
        ((-3.0, -1.0, 0.7, 3.0, 0.2), {}, -1, "edge 0.05"),
        # Where the ground ends it turns, however free the way.
        ((3.0, 1.0, 0.7, 2.0, 1.0), {}, 1, "edge 0.95"),
        ((3.0, 1.0, 0.7, 2.0, 1.0), {"full_turns": 3}, 1, "edge 0.95"),
        ((-3.0, 3.0, 0.0, -3.0, 0.0), {"turning": -1}, -1, "obstacle 0.05"),  # the held side
        # A share of 0.43 is not enough before a full turn.
        ((-0.3, 0.1, 0.5, -3.0, 0.5), {}, 1, "obstacle 0.43"),
        ((-0.3, 0.1, 0.5, -3.0, 0.5), {"full_turns": 1}, None, "clear 0.43"),
    ):
        decision = policy_saying(*said).decide(seen(**shown))
        assert decision.reason == reason
        assert isinstance(decision, Advance if side is None else Blocked)
        if side is not None:
            assert decision.yaw_rad == pytest.approx(side * math.radians(30))
            assert decision.ground_ends == reason.startswith("edge")


def test_it_looks_back_as_far_as_it_was_trained_to(
    policy_saying: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(
        student,
        "state_vector",
        lambda poses, **told: asked.append((poses, told)) or np.zeros(14, "f"),
    )
    policy_saying(*GO).decide(seen(turning=1, full_turns=2))
    poses, told = asked[0]
    assert [pose.time_s for pose in poses] == pytest.approx([1.1, 0.6, 0.1])
    assert (told["turning"], told["full_turns"]) == (1, 2)


def test_each_picture_is_shrunk_once(policy_saying: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    policy, shrunk = policy_saying(*GO), []
    preprocess = OnnxControlStudent.preprocess
    monkeypatch.setattr(
        OnnxControlStudent,
        "preprocess",
        lambda self, rgb: shrunk.append(1) or preprocess(self, rgb),
    )
    view = seen()
    policy.decide(view)
    policy.decide(view)
    assert len(shrunk) == 3


def test_without_remembered_views_it_says_what_is_missing(policy_saying: Any) -> None:
    with pytest.raises(MissionError, match="put <RememberViews/> ahead"):
        policy_saying(*GO).decide(cast_world.view(cast_world.cast()))


def test_a_tree_and_a_bench_find_the_network_behind_a_colon(
    policy_saying: Any, tmp_path: Path
) -> None:
    policy_saying(*GO)
    policy = f"student:{tmp_path / 'student.onnx'}"
    assert isinstance(make_policy(policy).decide(seen()), Advance)
    bench = LeafBench(Explore, policy=policy)
    bench.hover()
    assert bench.tick() is Status.RUNNING
    with pytest.raises(InputError, match="'segmentation' takes no argument, got 'segmentation:x'"):
        make_policy("segmentation:x")
