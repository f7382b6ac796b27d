"""The errors: messages with a remedy, exit codes, and attributes."""

from __future__ import annotations

import copy
import importlib
from pathlib import Path

import pytest

from behaviours.fly.explore import Explore
from tests.worlds.leaves import steering_bench
from uav_bt import errors
from uav_bt.errors import (
    FileError,
    InputError,
    NodeFailedError,
    ShapeError,
    TreeError,
    UavBtError,
    UnknownNameError,
)
from uav_bt.testing import LeafBench, TreeBench
from uav_bt.testing.world import live
from uav_bt.tree import MissionTree, leaf_of
from uav_bt.tree.nodes import ScriptNode


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (ShapeError("map", expected="HxW", actual=(2, 3, 4)), "map must be HxW, got 2x3x4"),
        (FileError("lab.yaml", "no boxes", line=12), "lab.yaml:12: no boxes"),
        (TreeError("m.xml", ["a", "b"]), "m.xml: refused, 2 errors\n  a\n  b"),
        (
            UnknownNameError("policy", "segmentaton", ["wander", "segment"]),
            "unknown policy 'segmentaton'; did you mean 'segment'? (known: segment, wander)",
        ),
        (UnknownNameError("drone", "zzz", ["alpha"]), "unknown drone 'zzz' (known: alpha)"),
        (NodeFailedError("M/leaf", LookupError("gone")), "node 'M/leaf' failed: LookupError: gone"),
    ],
)
def test_messages(error: UavBtError, text: str) -> None:
    assert str(error) == text
    assert error.exit_code == (2 if isinstance(error, InputError) else 1)


# --- where a leaf failed --------------------------------------------------------------------------


LEAVES = """\
import json
from behaviours.fly.moving_leaf import MovingLeaf
from py_trees.behaviour import Behaviour
from uav_bt.tree import Leaf

def sensor():
    return json.loads("gone")
class Boom(Leaf):
    def update(self):
        return sensor()
class Plain(Behaviour):
    def update(self):
        if True:
            raise RuntimeError("sensor gone")
class Asks(MovingLeaf):
    def work(self, state):
        pass
    def on_setup(self, mission):
        self.port_value("absent")
"""


def test_a_failed_node_names_the_innermost_line_of_its_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The author cannot fix the calling engine or the called library."""
    package = tmp_path / "my_package"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "leaves.py").write_text(LEAVES, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    leaves = importlib.import_module("my_package.leaves")
    bench = LeafBench(leaves.Boom)
    with pytest.raises(NodeFailedError) as caught:
        bench.tick()
    assert str(caught.value) == (
        "node 'Bench/Boom' failed: JSONDecodeError: Expecting value: line 1 column 1 (char 0) "
        "(my_package/leaves.py:7)"
    )
    with pytest.raises(NodeFailedError, match=r"sensor gone \(my_package/leaves\.py:14\)$"):
        LeafBench(leaf_of(leaves.Plain)).tick()
    with pytest.raises(NodeFailedError, match=r"no port 'absent' .*\(my_package/leaves\.py:19\)$"):
        LeafBench(leaves.Asks).setup()


def test_what_fails_within_the_engine_has_no_line() -> None:
    bench = TreeBench(MissionTree(ScriptNode("sum", code="n := 1 + absent")))
    with pytest.raises(NodeFailedError) as caught:
        bench.tick()
    assert ".py" not in str(caught.value)


POLICY = """\
class Broken:
    def decide(self, view):
        return view.site_map.passed
"""


def test_a_failed_policy_names_its_own_line_and_not_that_of_the_leaf(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "my_policy.py").write_text(POLICY, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    policy = importlib.import_module("my_policy").Broken()
    bench = steering_bench(Explore, policy)
    live(bench, seconds=0.5)
    with pytest.raises(NodeFailedError) as caught:
        live(bench, seconds=0.5)
    assert str(caught.value) == (
        "node 'Bench/Explore' failed: PolicyFailedError: policy Broken: AttributeError: "
        "'NoneType' object has no attribute 'passed' (my_policy.py:3)"
    )


@pytest.mark.parametrize(
    "error",
    [errors.FileError("a.csv", "is damaged", line=3), errors.TreeError("a.xml", ["no root"])],
)
def test_an_error_of_a_file_crosses_processes(error: errors.FileError) -> None:
    other = copy.copy(error)  # by the same method as between processes
    assert type(other) is type(error)
    assert (str(other), other.path, other.line) == (str(error), error.path, error.line)
