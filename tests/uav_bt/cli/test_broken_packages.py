"""A broken third-party package is named, and affects only its users."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.uav_bt.cli.test_root import python
from tests.worlds.cli import HOP, assert_refused, run, tree_file


@dataclass(frozen=True)
class Broken:
    """A package whose module `broken_NAME` registers something that cannot be used."""

    name: str
    source: str  # source of its module
    words: tuple[str, ...]  # words of the messages

    def install(self, folder: Path) -> None:
        module = f"broken_{self.name}"
        (folder / f"{module}.py").write_text(self.source, encoding="utf-8")
        info = folder / f"{module}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(
            f"[uav_bt.behaviours]\n{self.name} = {module}:NODES\n"
            f"[uav_bt.policies]\n{self.name} = {module}:Policy\n"
            f"[uav_bt.drones]\n{self.name} = {module}:Drone\n"
        )


BROKEN = [
    Broken("absent", "import no_such_package\n", ("broken_absent.py:1:", "'no_such_package'")),
    Broken("raises", "x = 1\n1 / 0\n", ("broken_raises.py:2:", "ZeroDivisionError")),
    Broken("syntax", "def\n", ("SyntaxError", "broken_syntax.py")),
    Broken("exits", "import sys\nsys.exit(3)\n", ("broken_exits.py:2:", "SystemExit")),
    Broken("nothing", "", ("has no attribute 'NODES'",)),
    Broken("number", "NODES = 3\n", ("'number'", "must name an iterable of node classes, got int")),
    Broken("text", "NODES = 'Land'\n", ("'text'", "must name an iterable", "got str")),
    Broken("kind", "NODES = [dict]\n", ("'kind'", "expected a node class", "dict")),
]


@pytest.fixture(params=BROKEN, ids=lambda broken: str(broken.name))
def broken(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Broken:
    package: Broken = request.param
    folder = tmp_path / "site"
    folder.mkdir()
    package.install(folder)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, f"broken_{package.name}", raising=False)
    return package


def test_commands_that_do_not_need_it_work_and_warn(
    broken: Broken, caplog: pytest.LogCaptureFixture
) -> None:
    result = run("check", "land_only")
    assert result.exit_code == 0, result.output
    (warning,) = caplog.messages
    for word in broken.words:
        assert word in warning


def test_a_tree_that_asks_for_its_node_is_refused_with_the_reason(
    broken: Broken, tmp_path: Path
) -> None:
    tree = tree_file(tmp_path, "<Sequence><TakePicture/></Sequence>")
    for command in ("check", "fly"):
        result = run(command, tree)
        assert_refused(result, "unknown node 'TakePicture'", "not loaded:", *broken.words)


def test_the_doctor_names_it(broken: Broken) -> None:
    result = run("doctor")
    assert result.exit_code == 1
    (line,) = (each for each in result.stdout.split("\n") if each.startswith("behaviours:"))
    assert "NOT READY" in line
    assert "behaviours (" in line  # those of our packages
    for word in broken.words:
        assert word in result.stdout


@pytest.mark.parametrize(
    ("arguments", "kind"),
    [
        (("--drone", "raises"), "drone 'raises' (broken_raises:Drone)"),
        (("--policy", "ReturnToBase=raises"), "policy 'raises' (broken_raises:Policy)"),
    ],
)
def test_a_flight_on_its_drone_or_policy_is_refused(
    arguments: tuple[str, ...], kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    BROKEN[1].install(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    words = ("cannot be imported", "broken_raises.py:2: ZeroDivisionError", "'broken_raises'")
    assert_refused(run("fly", "land_only", *arguments), kind, *words)


def test_a_mission_flies_beside_it_with_one_line_of_warning(tmp_path: Path) -> None:
    BROKEN[1].install(tmp_path)
    tree = tree_file(tmp_path, HOP)
    done = python(
        f"import sys\nsys.path.insert(0, {str(tmp_path)!r})\n"
        "from uav_bt.cli import main\n"
        f"sys.argv[1:] = ['fly', {str(tree)!r}, '--image-size', '160x90', '--profile', 'ideal']\n"
        "main()"
    )
    assert done.returncode == 0, done.stderr
    warnings = [line for line in done.stderr.splitlines() if "Warning" in line]
    assert len(warnings) == 1, done.stderr
    assert "broken_raises.py:2: ZeroDivisionError" in warnings[0]
