"""Images of the twin by plans."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uav_bt.lab.shipped import load_lab
from uav_bt.learning.views import ViewPlan, twin_views

PLAN = ViewPlan(scenes=("train-a", "train-b"), views=2, size_px=(320, 180))


def test_a_plan_gives_the_same_pictures_whichever_scenes_stand_beside() -> None:
    both = list(twin_views(PLAN))
    alone = list(twin_views(replace(PLAN, scenes=("train-b",))))
    _, other, _ = next(twin_views(replace(PLAN, seed=1)))
    assert (both[0][1] != other).mean() > 0.5
    names = [f"train-{scene}-0000{number}.png" for scene in "ab" for number in range(2)]
    assert [name for name, _, _ in both] == names
    for (name, rgb, ids), (other_name, other_rgb, other_ids) in zip(both[2:], alone, strict=True):
        assert name == other_name
        np.testing.assert_array_equal(rgb, other_rgb)
        np.testing.assert_array_equal(ids, other_ids)


def test_a_lab_with_a_tag_and_objects_is_drawn_with_its_classes() -> None:
    lab = load_lab("depot")
    plan = replace(PLAN, scenes=(str(lab.scenes["depot-val-a"]),), views=6)
    views = list(twin_views(plan))
    assert views[0][0] == "depot-val-a-00000.png"
    seen = set(np.unique(np.stack([ids for _, _, ids in views])))
    assert {lab.classes.id_of(name) for name in ("hall", "concrete", "drum")} <= seen
    assert max(seen) < len(lab.classes)
