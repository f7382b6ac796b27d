"""Training flights and pictures of the twin, by plans."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_bridge.twin.scene_file import load_scene
from tests.worlds.trees import tree_file
from uav_bt.campaign.plan import FlightTask
from uav_bt.campaign.runner import Flown
from uav_bt.campaign.workers import Fly, fly_task, lost_line
from uav_bt.errors import InputError
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.collecting import CollectionPlan, collect, nodes_under_policy
from uav_bt.learning.views import ViewPlan, twin_views
from uav_bt.mission.judge import Outcome

ADVISED = "explore_and_land_advised"


class Pretends:
    """Backend without flights: each one succeeds with an empty record, except the broken ones."""

    def __init__(self, broken: Sequence[str] = ()) -> None:
        self.tasks: list[FlightTask] = []
        self._broken = broken

    def run(self, fly: Fly, tasks: Iterable[FlightTask], timeout_s: float) -> Flown:
        assert fly is fly_task
        assert timeout_s > 300.0
        for task in tasks:
            self.tasks.append(task)
            assert task.options.record is not None
            failed = task.scene in self._broken
            if not failed:
                Path(task.options.record).write_bytes(b"")
            yield task, lost_line(task, "it broke") if failed else _line(task)


def _line(task: FlightTask) -> dict[str, Any]:
    return {
        "tree": task.tree,
        "scene": task.scene,
        "seed": task.options.seed,
        "outcome": Outcome.SUCCESS.value,
        "reason": "",
    }


def collected(folder: Path, **changed: Any) -> tuple[list[Path], list[FlightTask]]:
    pretends = Pretends(changed.pop("broken", ()))
    plan = CollectionPlan(tree=changed.pop("tree", ADVISED), **changed)
    return collect(plan, folder, backend=pretends), pretends.tasks


ONE = {"scenes": ("train-a",), "profiles": ("lab",)}


def test_flights_are_shared_out_over_scenes_and_profiles(tmp_path: Path) -> None:
    records, tasks = collected(tmp_path, flights=15)
    assert len(records) == len(tasks) == 16  # rounded up
    assert sorted({task.options.profile for task in tasks}) == ["harsh", "lab"]
    assert {task.scene[:7] for task in tasks} == {"train-a", "train-b", "train-c", "train-d"}
    assert all(task.options.record_quality == "small" for task in tasks)


def test_every_flight_but_the_first_has_light_and_boxes_of_its_own(tmp_path: Path) -> None:
    _, tasks = collected(tmp_path / "a", flights=4, **ONE)
    scenes = [load_scene(str(task.options.scene)) for task in tasks]
    shipped = load_scene("train-a")
    assert [scene.lighting == shipped.lighting for scene in scenes] == [True, False, False, False]
    assert [scene.objects == shipped.objects for scene in scenes] == [True, False, False, False]
    assert len({scene.name for scene in scenes}) == 4
    assert {scene.helipad for scene in scenes} == {shipped.helipad}
    _, others = collected(tmp_path / "b", flights=4, seed=7, **ONE)
    assert load_scene(str(others[2].options.scene)).objects != scenes[2].objects
    assert (tasks[0].options.seed, others[0].options.seed) == (0, 7)
    _, tasks = collected(tmp_path / "kept", flights=2, layouts=False, **ONE)
    assert {load_scene(str(task.options.scene)).objects for task in tasks} == {shipped.objects}


def test_a_collection_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    before, _ = collected(tmp_path, flights=4, **ONE)
    assert collected(tmp_path, flights=4, **ONE) == (before, [])


def test_a_flight_that_broke_is_none_to_learn_from(tmp_path: Path) -> None:
    records, tasks = collected(tmp_path, flights=2, broken=("train-a",), **ONE)
    assert (len(tasks), len(records)) == (2, 1)


def test_a_tree_in_which_nobody_advises_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no leaf of 'explore_and_land_depth'"):
        collected(tmp_path, tree="explore_and_land_depth")
    assert not list(tmp_path.iterdir())


def test_all_leaves_that_fly_by_a_policy_are_found_whatever_they_are_called(tmp_path: Path) -> None:
    """The adviser keeps its rule. `ReturnToBase` contains three leaves with a policy."""
    tree = tree_file(
        tmp_path,
        """<ReactiveSequence><SubTree ID="Perceive"/><Advise policy="corridor"/>
        <Fallback><Explore name="wander"/><ReturnToBase/></Fallback></ReactiveSequence>""",
    )
    assert nodes_under_policy(tree) == ["wander", "SearchUnderPolicy", "look", "Detour"]


# --- pictures -------------------------------------------------------------------------------------

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
