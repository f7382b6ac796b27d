"""The pytest plug-in, and shipped missions with leaves that answer as a test says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.worlds.processes import python
from tests.worlds.tables import cases
from uav_bt.testing import load_tree
from uav_bt.tree import NodeRegistry, Status

pytest_plugins = ["pytester"]


@pytest.fixture(scope="module", autouse=True)
def _loaded() -> None:
    """Load the modules of the inner runs once, not once per run."""
    NodeRegistry.installed()


# Unrelated plug-ins that take seconds to load.
WITHOUT = ("-p", "no:cacheprovider", "-p", "no:hypothesispytest", "-p", "no:benchmark")


def run(pytester: pytest.Pytester, *options: str) -> pytest.RunResult:
    return pytester.runpytest_inprocess(*WITHOUT, "-p", "no:xdist", *options)


GOOD = '<root BTCPP_format="4"><BehaviorTree ID="A"><AlwaysSuccess/></BehaviorTree></root>'
BAD = GOOD.replace("<AlwaysSuccess/>", '<Sequence><Alwayssuccess/><Sleep msecs="1"/></Sequence>')


def test_tree_files_are_collected_and_checked(pytester: pytest.Pytester) -> None:
    trees = pytester.mkdir("trees")
    for name, text in {
        "good": GOOD,
        "bad": BAD,
        "damaged": GOOD[:40],
        "other": "<config/>",
    }.items():
        trees.joinpath(f"{name}.xml").write_text(text, encoding="utf-8")
    result = run(pytester, "--check-trees")
    result.assert_outcomes(passed=1, failed=2)
    result.stdout.fnmatch_lines(
        [
            "trees/bad.xml:1:55: Alwayssuccess: unknown node 'Alwayssuccess'; *'AlwaysSuccess'[?]",
            "trees/bad.xml:1:78: Sleep: unknown attribute 'msecs'; did you mean 'msec'[?]",
            "trees/damaged.xml:1:24: not well-formed XML*",
        ]
    )
    assert "Traceback" not in result.stdout.str()
    assert "testing/plugin.py" not in result.stdout.str()


PART = GOOD.replace('ID="A"', 'ID="Part"')
USER = GOOD.replace("<AlwaysSuccess/>", '<SubTree ID="Part"/>')


def test_collected_tree_files_use_each_others_trees(pytester: pytest.Pytester) -> None:
    """As the files of a folder that `uav-bt check FOLDER` takes."""
    pytester.path.joinpath("main.xml").write_text(USER, encoding="utf-8")
    pytester.path.joinpath("part.xml").write_text(PART, encoding="utf-8")
    run(pytester, "--check-trees").assert_outcomes(passed=2)
    bad = PART.replace("Always", "Alway")
    pytester.path.joinpath("part.xml").write_text(bad, encoding="utf-8")
    result = run(pytester, "--check-trees")
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(["part.xml:1:48: AlwaySuccess: unknown node*"])


def test_the_ini_file_can_ask_for_the_collection(pytester: pytest.Pytester) -> None:
    pytester.path.joinpath("mission.xml").write_text(GOOD, encoding="utf-8")
    assert run(pytester).ret == pytest.ExitCode.NO_TESTS_COLLECTED
    pytester.makeini("[pytest]\nuav_bt_check_trees = true\n")
    run(pytester).assert_outcomes(passed=1)


def test_fixtures(pytester: pytest.Pytester) -> None:
    pytester.path.joinpath("mission.xml").write_text(GOOD, encoding="utf-8")
    pytester.makepyfile(
        """
        import pytest
        from uav_bt.board import HEIGHT
        from uav_bt.errors import BoardAccessError
        from uav_bt.board.blackboard import Key
        from uav_bt.tree import Status
        from uav_bt.tree.nodes import AlwaysFailure

        def test_tree(tree_bench):
            assert tree_bench("mission.xml", mocks={"AlwaysSuccess": "F"}).tick() is Status.FAILURE

        def test_leaf_and_drone(leaf_bench, scripted_drone, manual_clock):
            assert leaf_bench(AlwaysFailure).tick() is Status.FAILURE
            assert scripted_drone.clock is manual_clock

        def test_board(strict_board, manual_clock):
            strict_board.write(HEIGHT, 1.0)
            assert strict_board.read(HEIGHT).value == 1.0
            with pytest.raises(BoardAccessError, match="never declared on this board; did you"):
                strict_board.read(Key("height_above_ground", float, "misspelt"))
            with pytest.raises(BoardAccessError, match="declared as float, and is read as another"):
                strict_board.read(Key("height_above_ground_m", int, "mistyped"))
        """
    )
    run(pytester).assert_outcomes(passed=3)


def test_the_plug_in_loads_nothing_heavy() -> None:
    """It is loaded whenever somebody runs pytest."""
    heavy = "cv2 torch mujoco openvino sklearn matplotlib av rich onnx filterpy control"
    loaded = f"[name for name in {heavy.split()} if name in sys.modules]"
    assert python("-c", f"import sys, uav_bt.testing.plugin; print({loaded})").stdout == "[]\n"


# --- shipped missions -----------------------------------------------------------------------------

TREES = Path(__file__).parents[3] / "trees"
CASES = cases("shipped_missions")


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_a_mission_reacts_to_what_its_leaves_answer(case: dict[str, Any]) -> None:
    bench = load_tree(TREES / f"{case['mission']}.xml", mocks=case["mocks"])
    if "until" in case:
        ticks = bench.tick_until(case["until"], max_ticks=case["ticks"])
        bench.log.assert_started("Segment", times=ticks)
    else:
        for _ in range(case["ticks"]):
            bench.tick()
    bench.log.assert_order(*case.get("order", ()))
    for node, times in case.get("started", {}).items():
        bench.log.assert_started(node, times=times)
    for leaf in case.get("looks_down", ()):
        assert bench.tree.find(leaf).port_value("looks_down") is True


def test_exploring_ends_after_its_time_in_the_middle_of_a_step() -> None:
    """It turns away after a blocked step; after 90 s it returns, during any movement."""
    sees = {"Segment": "S", "FindMark": "S", "TrackMotion": "S", "MapSite": "S"}
    flies = {"TakeOff": "S", "Explore": "(RRF)", "Avoid": "(RS)", "HelipadCenter": "S", "Land": "S"}
    lands = {"ReturnToBase": "RS", "EmergencyLand": "F"}
    path = TREES / "explore_and_land_segmentation.xml"
    bench = load_tree(path, mocks={**sees, **flies, **lands}, tick_s=1.0)
    bench.tick_until(Status.SUCCESS, max_ticks=100)
    (start, *_), (home, *_) = (
        bench.log.of(node, "started") for node in ("ExploreFor", "ReturnToBase")
    )
    assert home.time_s - start.time_s == pytest.approx(90.0)
    bench.log.assert_order(
        *("Explore failed", "Avoid started", "Avoid succeeded", "Explore started"),
        *("step_or_turn halted", "Timeout failed", "explore_for succeeded", "Land started"),
    )
    bench.log.assert_not_started("EmergencyLand")
