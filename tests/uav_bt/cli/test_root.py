"""`uav-bt` itself: fast start, errors in one line, no imports from foreign folders."""

from __future__ import annotations

import inspect
import json
from pathlib import Path

import click
import pytest

from tests.worlds.cli import all_commands, run
from tests.worlds.processes import python
from uav_bt import __version__
from uav_bt.cli.declare import Number, WholeNumber
from uav_bt.cli.root import COMMANDS
from uav_bt.errors import InputError
from uav_bt.plugins import check_packages
from uav_bt.tree import shipped

HEAVY = "av control cv2 filterpy matplotlib mujoco onnx openvino rich scipy sklearn torch yaml"
TOOLS_NEED_NO = "av cv2 mujoco openvino rich scipy sklearn torch zmq"


def without(*modules: str) -> str:
    """Return code after which these modules cannot be imported, as if they were not installed."""
    return (
        "import sys\n"
        "class Absent:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        f"        if name.partition('.')[0] in {modules!r}:\n"
        "            raise ModuleNotFoundError(f'No module named {name!r}', name=name)\n"
        "sys.meta_path.insert(0, Absent())\n"
    )


def test_flying_needs_no_extra() -> None:
    """`make fly` installs none of them."""
    extras = (
        *("foxglove", "mcap", "rerun", "zmq", "msgpack", "jinja2", "dask", "distributed"),
        *("control", "torch", "onnx", "onnxruntime", "nncf", "olympe"),
    )
    done = python(
        "-c",
        f"{without(*extras)}"
        "from uav_bt.cli import check, doctor, fly, lab, tree\n"
        "from uav_bt import app\n"
        "app.make_drone(app.FlightOptions())\n",
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("arguments", [("tree", "nodes"), ("--version",)], ids=" ".join)
def test_a_full_disk_behind_standard_output_is_one_clear_error(arguments: tuple[str, ...]) -> None:
    with Path("/dev/full").open("w") as full:
        done = python("-m", "uav_bt", *arguments, stdout=full)
    words = "Error: standard output cannot be written: No space left on device\n"
    assert (done.returncode, done.stderr) == (1, words)


def answer_without(heavy: str, *arguments: str, **environment: str) -> list[str]:
    """Run `uav-bt`, assert that it imports none of these modules, and return its lines."""
    done = python(
        "-c",
        "import atexit, os, sys\n"
        f"heavy = {heavy.split()!r}\n"
        "atexit.register(lambda: print('>', *[m for m in heavy if m in sys.modules]))\n"
        f"os.environ.update({environment!r})\n"
        f"sys.argv = {['uav-bt', *arguments]!r}\n"
        "from uav_bt.cli import main\n"
        "main()",
    )
    *lines, imported = done.stdout.splitlines()
    assert (imported, done.stderr) == (">", "")
    return lines


@pytest.mark.parametrize(
    ("line", "heavy"),
    [
        ("--help", f"{HEAVY} numpy py_trees uav_bt.app"),
        ("net train --help", f"{HEAVY} numpy py_trees uav_bt.app"),
        ("check trees/land_only.xml", HEAVY),
        ("check trees/explore_and_land_depth.xml", HEAVY),
        ("tree nodes --format json", HEAVY),
        ("tree schema", TOOLS_NEED_NO),
        ("tree render trees/land_only.xml --format svg", TOOLS_NEED_NO),
        ("fly --help", "av control filterpy matplotlib mujoco onnx openvino scipy sklearn torch"),
        ("campaign --help", "control jinja2 matplotlib openvino sklearn torch"),
    ],
)
def test_what_must_answer_at_once_imports_nothing_heavy(line: str, heavy: str) -> None:
    assert answer_without(heavy, *line.split())


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ("uav-bt re", "report replay record"),
        ("uav-bt net ", "perceive collect train evaluate export"),
        ("uav-bt net tr", "train"),
    ],
)
def test_completing_a_command_imports_no_command(words: str, found: str) -> None:
    """The shell waits for it at each press of the tab key."""
    shell = {"COMP_WORDS": words, "COMP_CWORD": str(words.count(" "))}
    heavy = f"{HEAVY} numpy py_trees uav_bt.app uav_bt.tree"
    completed = answer_without(heavy, _UAV_BT_COMPLETE="bash_complete", **shell)
    assert [line.removeprefix("plain,") for line in completed] == found.split()


def test_help_has_a_line_for_each_command_and_then_for_each_group() -> None:
    assert run("--version").stdout == f"uav-bt, version {__version__}\n"
    commands, groups = run("--help").stdout.partition("Commands:")[2].split("Groups of commands:")
    names = "fly check new simulate campaign report shrink view replay lsp doctor serve-anafi"
    assert [line.split()[0] for line in commands.splitlines() if line] == names.split()
    heads = [line.split()[0] for line in groups.splitlines() if line]
    assert heads == ["tree", "record", "net", "lab"]


@pytest.mark.parametrize("line", COMMANDS)
def test_help_fits_a_terminal_and_keeps_the_lines_of_its_examples(line: str) -> None:
    command = dict(all_commands())[tuple(line.split())]
    done = run(*line.split(), "--help")
    assert done.exit_code == 0
    lines = done.stdout.splitlines()
    assert max(map(len, lines)) <= 80, done.stdout
    for text in inspect.cleandoc(str(command.help)).splitlines():
        # Indented text in the source is an example, a table or a file.
        assert not text.startswith("  ") or f"  {text.rstrip()}" in lines, text
    assert "RANGE" not in done.stdout
    for option in command.params:
        if isinstance(option, click.Option):
            assert option.help, option.name
            if isinstance(option.type, (click.IntRange, click.FloatRange)):
                assert isinstance(option.type, (Number, WholeNumber)), option.name
    assert command.get_short_help_str(200)


MISSING = [
    ("foxglove", ["view", "x.mcap", "--save", "x.rrd"], "record"),
    ("foxglove", ["fly", "land_only", "--record", "x.mcap"], "record"),
    ("mcap", ["replay", "x.mcap"], "record"),
    ("mcap", ["record", "info", "x.mcap"], "record"),
    ("zmq", ["fly", "land_only", "--groot"], "live"),
    ("msgpack", ["fly", "land_only", "--groot"], "live"),
    ("jinja2", ["report", "x"], "campaign"),
    ("nncf", ["net", "export", "depth"], "train"),
    ("torch", ["lab", "train", "paper"], "train"),
    ("onnx", ["net", "export", "depth"], "train"),
    ("pebble", ["campaign", "land_only"], "campaign"),
    ("control", ["lab", "tune-heading", "x.mcap"], "design"),
]
# Runs each command in a copy of a process that has imported what needs no extra.
EACH_WITHOUT = f"""
import json, os, sys
from uav_bt import app
from uav_bt.cli import main
for absent, arguments in {[(without(module), words) for module, words, _ in MISSING]!r}:
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.dup2(writer, 2)
        exec(absent)
        sys.argv[1:] = arguments
        main()
    os.close(writer)
    with open(reader) as stderr:
        printed = stderr.read()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    print(json.dumps([code, printed]), flush=True)
"""


@pytest.fixture(scope="module")
def answers() -> list[list[object]]:
    """Return the exit code and the errors of each command without its package."""
    done = python("-c", EACH_WITHOUT)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.mark.parametrize(
    ("number", "module", "extra"),
    [(number, module, extra) for number, (module, _, extra) in enumerate(MISSING)],
    ids=[f"{module}-{words[0]}" for module, words, _ in MISSING],
)
def test_a_missing_package_is_named_with_its_extra(
    answers: list[list[object]], number: int, module: str, extra: str
) -> None:
    words = (
        f'Error: this needs {module}; run `pip install -c constraints.txt -e ".[{extra}]"` in the '
        "folder of uav-bt's source\n"
    )
    assert answers[number] == [2, words]


def test_an_unexpected_exception_is_one_line_without_debug(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_: str) -> None:
        raise ZeroDivisionError("of the twin")

    monkeypatch.setattr(shipped, "resolve_tree", broken)
    result = run("check", "land_only")
    assert result.exit_code == 1
    assert result.stderr.count("\n") == 1
    assert "unexpected ZeroDivisionError: of the twin" in result.stderr
    assert "uav-bt --debug" in result.stderr
    debugged = run("--debug", "check", "land_only")
    assert debugged.exit_code == 1
    assert "Traceback" in debugged.stderr
    assert "uav-bt --debug" not in debugged.stderr


@pytest.mark.parametrize("hides", ["hangar", "hangar/__init__.py", "hangar.py"])
def test_what_shadows_a_package_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, hides: str
) -> None:
    check_packages()
    theirs, ours = tmp_path / "theirs", tmp_path / "ours"
    (ours / "hangar").mkdir(parents=True)
    shadow = theirs / hides
    shadow.parent.mkdir(parents=True, exist_ok=True)
    if shadow.suffix:
        shadow.touch()
    else:
        shadow.mkdir()
    monkeypatch.syspath_prepend(theirs)
    found = theirs / hides.removesuffix("/__init__.py")
    with pytest.raises(InputError, match=r"hangar(\.py)?' where uav-bt needs its own") as caught:
        check_packages(ours, ["hangar"])
    assert str(found) in str(caught.value)
    with pytest.raises(InputError, match=r"Python finds nothing .*; reinstall"):
        check_packages(names=["no_such_package"])


@pytest.mark.parametrize(
    ("command", "shadow", "code"),
    [
        (("-m", "uav_bt", "tree", "nodes"), "behaviours", 2),
        (("mine.py",), "perception", 1),
        (("mine.py",), "trees", 1),
    ],
)
def test_a_folder_that_hides_a_package_is_named(
    tmp_path: Path, command: tuple[str, ...], shadow: str, code: int
) -> None:
    """Python searches the folder of a script, or the working directory, before the packages."""
    (tmp_path / shadow).mkdir()
    (tmp_path / shadow / "__init__.py").touch()
    (tmp_path / "mine.py").write_text("from uav_bt import app\n", encoding="utf-8")
    done = python(*command, folder=tmp_path)
    assert done.returncode == code
    last = done.stderr.splitlines()[-1]
    assert f"Python finds '{tmp_path / shadow}' where uav-bt needs its own" in last
    assert "start from another folder" in last
