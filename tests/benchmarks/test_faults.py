"""The command `benchmarks/faults.py`: its table, its exit codes, and how it resumes."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest

from benchmarks.fault_flight import Case, fly
from benchmarks.faults import main
from tests.benchmarks.test_fault_reactions import TREE

pytestmark = pytest.mark.flight


class Done(NamedTuple):
    """What a command left."""

    returncode: int | str | None
    stdout: str
    stderr: str


@pytest.fixture
def run(capfd: pytest.CaptureFixture[str]) -> Callable[..., Done]:
    """Return a function that runs the command in this process."""

    def run(*arguments: str | Path) -> Done:
        code: int | str | None
        try:
            code = main(list(map(str, arguments)))
        except SystemExit as error:
            code = error.code
        return Done(code, *capfd.readouterr())

    return run


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let flights be flown in this process: another one takes seconds to start."""

    def fly_each(cases: Sequence[Case], folder: Path, _: int) -> Iterator[tuple[Case, object]]:
        yield from ((case, fly(case, folder)) for case in cases)

    monkeypatch.setattr("benchmarks.faults.fly_each", fly_each)


def short(tmp_path: Path, *arguments: str) -> list[str]:
    tree = tmp_path / "short.xml"
    tree.write_text(TREE, encoding="utf-8")
    where = [
        "--drone",
        "plain",
        "--tree",
        str(tree),
        "--out",
        str(tmp_path / "out"),
        "--explore-s",
        "20",
    ]
    return [*where, "--land-anywhere", "--time-limit-s", "9", *arguments]


def test_flights_are_tabulated_kept_and_gone_on_with(
    tmp_path: Path, run: Callable[..., Done], request: pytest.FixtureRequest
) -> None:
    wanted = short(tmp_path, "--phase", "explore+0.5", "--kind", "battery-low")
    done = run(*wanted)
    assert (done.returncode, done.stderr) == (0, "")
    assert "| battery-low | right |" in done.stdout
    assert done.stdout.endswith("1 of 1 reactions right, 1 flights survived\n")
    flights = tmp_path / "out" / "flights.jsonl"
    first = flights.read_text()
    flights.write_text(first + '{"case": {"fau')  # the process was killed during a write

    request.getfixturevalue("in_process")
    more = run(*wanted, "slow")
    assert more.returncode == 1
    assert "2 flights, 1 of them are there" in more.stdout
    assert "| slow | not named: timeout: not over after 9 s |" in more.stdout
    assert (tmp_path / "out" / "table.md").read_text() in more.stdout
    lines = flights.read_text().splitlines(keepends=True)
    assert lines[0] == first
    assert [json.loads(line)["case"]["fault"] for line in lines] == [
        "battery-low@explore+0.5",
        "slow@explore+0.5",
    ]


@pytest.mark.usefixtures("in_process")
def test_a_phase_that_does_not_come_is_no_success(tmp_path: Path, run: Callable[..., Done]) -> None:
    done = run(*short(tmp_path, "--phase", "search", "--kind", "battery-low"))
    assert done.returncode == 1
    assert "| battery-low | not reached |" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--kind", "blakc"], "unknown fault 'blakc'; did you mean 'black'?"),
        (["--kind", "late=soon"], "expected a number as level, got 'soon'"),
        (["--scene", "moon"], "moon"),
        (["--tree", "land_only"], 'and no duration_ms="...", which --explore-s would set'),
        (["--workers", "two"], "invalid int value"),
    ],
)
def test_what_cannot_be_flown_is_refused(
    tmp_path: Path, arguments: list[str], message: str, run: Callable[..., Done]
) -> None:
    done = run("--out", tmp_path, *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "flights.jsonl").exists()


def test_a_damaged_file_is_named_with_its_line(tmp_path: Path, run: Callable[..., Done]) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "flights.jsonl").write_text("{}\n{}\n")
    done = run(*short(tmp_path, "--kind", "battery-low", "--phase", "land"))
    assert done.returncode == 2
    assert "flights.jsonl:1: damaged" in done.stderr


def test_all_kinds_are_listed(run: Callable[..., Done]) -> None:
    done = run("--list")
    assert done.returncode == 0
    assert "disk-full" in done.stdout
    assert "late              late frames, of this age [1 s]" in done.stdout


@pytest.mark.parametrize(
    ("drone", "why"),
    [
        ("anafi", "to loopback ANAFIs only"),
        ("anafi:192.168.42.1", "to loopback ANAFIs only"),
        ("anafi:drone.example", "to loopback ANAFIs only"),
        ("sphinx:10.202.0.1", "to loopback ANAFIs only"),
        ("anafi:127.0.0.2", "one flight at a time"),
    ],
)
def test_over_olympe_only_loopback_anafis_are_flown_one_at_a_time(
    tmp_path: Path, drone: str, why: str, run: Callable[..., Done]
) -> None:
    wanted = short(tmp_path, "--kind", "black", "--phase", "explore")
    done = run(*wanted, "--drone", drone, "--workers", "2")
    assert done.returncode == 2
    assert why in done.stderr
    assert not (tmp_path / "out" / "flights.jsonl").exists()
