"""The pytest plug-in's options: coverage of tree files, and their collection as tests."""

from __future__ import annotations

import pytest

from uav_bt.testing import coverage_plugin
from uav_bt.tree import NodeRegistry

pytest_plugins = ["pytester"]


@pytest.fixture(scope="module", autouse=True)
def _loaded() -> None:
    """Load the modules of the inner runs once, not once per run."""
    assert coverage_plugin
    NodeRegistry.installed()


TREE = """<root BTCPP_format="4">
  <BehaviorTree ID="Main">
    <Fallback name="f">
      <Look name="look"/>
      <Sequence>
        <Fly/>
        <AlwaysSuccess/>
      </Sequence>
    </Fallback>
  </BehaviorTree>
</root>
"""

TESTS = """
import pytest
from uav_bt.testing import load_tree
from uav_bt.tree import Leaf, NodeRegistry, Status


class Look(Leaf):
    condition = True


class Fly(Leaf):
    pass


REGISTRY = NodeRegistry([Look, Fly])


@pytest.mark.parametrize(("look", "fly", "ends"), [{cases}])
def test_mission(look, fly, ends):
    bench = load_tree("mission.xml", REGISTRY, mocks={{"Look": look, "Fly": fly}})
    bench.tick_until(Status[ends], max_ticks=2)


def test_halt():
    bench = load_tree("mission.xml", REGISTRY, mocks={{"Look": "F", "Fly": "R"}})
    bench.tick()
    bench.halt()
"""
ONE = '("S", "S", "SUCCESS")'
ALL = f'{ONE}, ("F", "S", "SUCCESS"), ("F", "RF", "FAILURE")'


# Unrelated plug-ins that take seconds to load.
WITHOUT = ("-p", "no:cacheprovider", "-p", "no:hypothesispytest", "-p", "no:benchmark")


def project(pytester: pytest.Pytester, cases: str) -> None:
    pytester.makepyfile(test_mission=TESTS.format(cases=cases))
    pytester.path.joinpath("mission.xml").write_text(TREE, encoding="utf-8")


def run(pytester: pytest.Pytester, *options: str) -> pytest.RunResult:
    return pytester.runpytest_inprocess(*WITHOUT, "-p", "no:xdist", *options)


def test_coverage_tells_what_never_happened(pytester: pytest.Pytester) -> None:
    """Each node with a missing branch has a line with its position; kinds come from the run."""
    project(pytester, ONE)
    result = run(pytester, "--tree-coverage=mission.xml")
    assert result.ret == pytest.ExitCode.OK
    result.stdout.fnmatch_lines(
        [
            "*- tree coverage -*",
            "mission.xml: 4 of 5 nodes ticked, 4 of 10 branches taken, 40 %",
            "  mission.xml:3:5: Fallback 'f': never FAILURE",
            "  mission.xml:5:7: Sequence: never SUCCESS, FAILURE",
            "  mission.xml:6:9: Fly: never SUCCESS, FAILURE",
            "  mission.xml:7:9: AlwaysSuccess: never ticked",
            "tree coverage: 40 %",
        ],
        consecutive=True,
    )


def test_a_covered_file_is_a_hundred_percent(pytester: pytest.Pytester) -> None:
    """If all branches were taken, none is listed, and the threshold is met."""
    project(pytester, ALL)
    result = run(pytester, "--tree-coverage=mission.xml", "--tree-coverage-fail-under=100")
    assert result.ret == pytest.ExitCode.OK
    assert "never" not in result.stdout.str()
    result.stdout.fnmatch_lines(
        ["mission.xml: 5 of 5 nodes ticked, 10 of 10 branches taken, 100 %", "tree coverage: 100 %"]
    )


def test_too_little_coverage_fails_the_run(pytester: pytest.Pytester) -> None:
    """The ini file may request coverage; a folder means all its tree files."""
    project(pytester, ONE)
    pytester.path.joinpath("other.xml").write_text("<config/>", encoding="utf-8")
    pytester.makeini("[pytest]\nuav_bt_tree_coverage = .\nuav_bt_tree_coverage_fail_under = 40.5\n")
    result = run(pytester)
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    result.stdout.fnmatch_lines(["FAIL: expected a tree coverage of at least 40.5 %, got 40 %"])
    assert "other.xml" not in result.stdout.str()


def test_a_run_without_tests_is_not_judged(pytester: pytest.Pytester) -> None:
    """Listing the tests runs none, so the threshold does not apply."""
    project(pytester, ONE)
    options = ["--tree-coverage=mission.xml", "--tree-coverage-fail-under=90", "--collect-only"]
    result = run(pytester, *options)
    assert result.ret == pytest.ExitCode.OK
    assert "tree coverage" not in result.stdout.str()


def test_included_files_have_their_own_coverage(pytester: pytest.Pytester) -> None:
    """A library is measured through the missions that include it."""
    root = '<root BTCPP_format="4" main_tree_to_execute="Main">'
    trees = "".join(
        f'<BehaviorTree ID="{name}"><AlwaysSuccess/></BehaviorTree>' for name in ("Used", "Not")
    )
    files = {
        "library": f'<root BTCPP_format="4">{trees}</root>',
        "mission": f'{root}<include path="library.xml"/><BehaviorTree ID="Main"><Sequence>'
        '<SubTree ID="Used"/><SubTree ID="Used"/></Sequence></BehaviorTree></root>',
    }
    for name, text in files.items():
        pytester.path.joinpath(f"{name}.xml").write_text(text, encoding="utf-8")
    pytester.makepyfile(
        """
        from uav_bt.tree import Status

        def test_mission(tree_bench):
            assert tree_bench("mission.xml").tick() is Status.SUCCESS
        """
    )
    result = run(pytester, "--tree-coverage=.")
    result.stdout.fnmatch_lines(
        [
            "library.xml: 1 of 2 nodes ticked, 1 of 2 branches taken, 50 %",
            "  library.xml:1:*: AlwaysSuccess: never ticked",
            "mission.xml: 3 of 3 nodes ticked, 3 of 3 branches taken, 100 %",
            "tree coverage: 80 %",
        ],
        consecutive=True,
    )


def test_a_file_that_no_test_loads_has_no_coverage(pytester: pytest.Pytester) -> None:
    """Its nodes were never ticked; a damaged file does not count as covered."""
    project(pytester, ONE)
    other = TREE.replace("Look", "Foreign")
    pytester.path.joinpath("other.xml").write_text(other, encoding="utf-8")
    pytester.path.joinpath("worse.xml").write_text(TREE[:60], encoding="utf-8")
    options = [f"--tree-coverage={name}.xml" for name in ("other", "worse")]
    result = run(pytester, *options, "--tree-coverage-fail-under=1")
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    result.stdout.fnmatch_lines(
        [
            "other.xml: 0 of 5 nodes ticked, 0 of 11 branches taken, 0 %",
            "  other.xml:3:5: Fallback 'f': never ticked",
            "worse.xml: not measured: *worse.xml: refused, 1 error",
            "tree coverage: 0 %",
        ]
    )


def test_workers_hand_their_share_over(pytester: pytest.Pytester) -> None:
    """With two processes the result is the same."""
    project(pytester, ALL)
    result = pytester.runpytest_subprocess(
        *WITHOUT, "-n2", "--tree-coverage=mission.xml", "--tree-coverage-fail-under=100"
    )
    assert result.ret == pytest.ExitCode.OK
    result.stdout.fnmatch_lines(
        ["mission.xml: 5 of 5 nodes ticked, 10 of 10 branches taken, 100 %"]
    )
    assert result.stdout.str().count("tree coverage: 100 %") == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--tree-coverage=nope.xml"], "--tree-coverage: *nope.xml*no such tree file*"),
        (["--tree-coverage=empty"], "--tree-coverage: *empty: no tree file (*"),
        (
            ["--tree-coverage=mission.xml", "--tree-coverage-fail-under=much"],
            "--tree-coverage-fail-under: expected 0 to 100, got 'much'",
        ),
        (
            ["--tree-coverage=mission.xml", "--tree-coverage-fail-under=101"],
            "--tree-coverage-fail-under: expected 0 to 100, got '101'",
        ),
    ],
)
def test_wrong_options_are_refused(
    pytester: pytest.Pytester, options: list[str], message: str
) -> None:
    """The refusal is like that of pytest's own options."""
    project(pytester, ONE)
    pytester.mkdir("empty").joinpath("other.xml").write_text("<config/>", encoding="utf-8")
    result = run(pytester, *options)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"*{message}"])


GOOD = '<root BTCPP_format="4"><BehaviorTree ID="A"><AlwaysSuccess/></BehaviorTree></root>'
BAD = GOOD.replace("<AlwaysSuccess/>", '<Sequence><Alwayssuccess/><Sleep msecs="1"/></Sequence>')


def test_tree_files_are_collected_and_checked(pytester: pytest.Pytester) -> None:
    """Valid files pass, invalid ones show only their findings, other XML is not collected."""
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


@pytest.mark.parametrize("way", ["option", "ini"])
def test_trees_includes_and_nodes_may_be_elsewhere(pytester: pytest.Pytester, way: str) -> None:
    parts, tests = pytester.mkdir("parts"), pytester.mkdir("tests")
    parts.joinpath("part.xml").write_text(PART, encoding="utf-8")
    parts.joinpath("more.xml").write_text(PART.replace("Part", "More"), encoding="utf-8")
    model = '<TreeNodesModel><Action ID="Fetch"/></TreeNodesModel>'
    palette = f'<root BTCPP_format="4">{model}</root>'
    pytester.path.joinpath("palette.xml").write_text(palette, encoding="utf-8")
    body = '<Sequence><SubTree ID="Part"/><SubTree ID="More"/><Fetch/></Sequence>'
    text = GOOD.replace("<AlwaysSuccess/>", body)
    text = text.replace("<BehaviorTree", '<include path="../parts/more.xml"/><BehaviorTree')
    tests.joinpath("main.xml").write_text(text, encoding="utf-8")
    given = {"folder": "parts", "include-root": ".", "palette": "palette.xml"}
    if way == "ini":
        lines = [f"uav_bt_check_trees_{name.replace('-', '_')} = {v}" for name, v in given.items()]
        pytester.makeini("\n".join(["[pytest]", *lines]))
        given = {}
    options = [f"--check-trees-{name}={value}" for name, value in given.items()]
    run(pytester, "--check-trees", *options, "tests").assert_outcomes(passed=1)


def test_a_folder_of_trees_that_is_not_there_is_refused(pytester: pytest.Pytester) -> None:
    pytester.path.joinpath("main.xml").write_text(GOOD, encoding="utf-8")
    result = run(pytester, "--check-trees", "--check-trees-folder=absent")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*--check-trees: absent: no such folder to look for tree files*"])


def test_the_ini_file_can_ask_for_the_collection(pytester: pytest.Pytester) -> None:
    """Without the option and the ini entry, tree files are not collected."""
    pytester.path.joinpath("mission.xml").write_text(GOOD, encoding="utf-8")
    assert run(pytester).ret == pytest.ExitCode.NO_TESTS_COLLECTED
    pytester.makeini("[pytest]\nuav_bt_check_trees = true\n")
    run(pytester).assert_outcomes(passed=1)


def test_fixtures(pytester: pytest.Pytester) -> None:
    """A tree bench and a strict board are available as fixtures."""
    pytester.path.joinpath("mission.xml").write_text(GOOD, encoding="utf-8")
    pytester.makepyfile(
        """
        import pytest
        from uav_bt.board import HEIGHT
        from uav_bt.errors import BoardAccessError
        from uav_bt.board.blackboard import Key
        from uav_bt.tree import Status

        def test_tree(tree_bench):
            assert tree_bench("mission.xml", mocks={"AlwaysSuccess": "F"}).tick() is Status.FAILURE

        def test_board(strict_board, manual_clock):
            strict_board.write(HEIGHT, 1.0)
            assert strict_board.read(HEIGHT).value == 1.0
            with pytest.raises(BoardAccessError, match="never declared on this board; did you"):
                strict_board.read(Key("height_above_ground", float, "misspelt"))
            with pytest.raises(BoardAccessError, match="declared as float, and is read as another"):
                strict_board.read(Key("height_above_ground_m", int, "mistyped"))
        """
    )
    run(pytester).assert_outcomes(passed=2)
