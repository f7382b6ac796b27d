"""The fuzzing of files: a few of each kind here, hundreds with the command itself."""

from __future__ import annotations

import contextlib
from concurrent.futures import Future
from pathlib import Path
from random import Random

import pytest

from benchmarks import fuzz_files
from benchmarks.fuzz_files import READERS, fuzz, table
from benchmarks.fuzz_mutations import MUTATIONS
from benchmarks.fuzz_seeds import SEEDS
from uav_bt.campaign.workers import Answer, WorkerPool
from uav_bt.errors import InputError

SLOW = {"record", "replay", "view", "film", "onnx", "weights"}  # each imports for seconds
QUICK = [kind for kind in READERS if kind not in SLOW]


def answered(answer: Answer) -> Future[Answer]:
    future: Future[Answer] = Future()
    future.set_result(answer)
    return future


@pytest.mark.parametrize("kind", QUICK)
def test_damaged_files_are_read_or_refused(kind: str, tmp_path: Path) -> None:
    """In this process; the same damage every time."""
    seeds = SEEDS[kind](tmp_path)
    rng = Random(kind)  # noqa: S311 - the same files every time
    for number in range(20):
        path = tmp_path / f"{number}{seeds[0].suffix}"
        whole = rng.choice(seeds).read_bytes()
        path.write_bytes(rng.choice(MUTATIONS[path.suffix])(whole, rng))
        with contextlib.suppress(InputError):
            READERS[kind](path)


def test_a_damaged_record_is_read_or_refused(tmp_path: Path) -> None:
    """In processes of its own, as the command does it."""
    row = fuzz("record", 6, tmp_path, jobs=1)
    assert row.faults == []
    assert row.ends["read"] + row.ends["refused"] == 6


def test_every_kind_has_files_and_mutations() -> None:
    assert set(SEEDS) == set(READERS)


def test_what_is_no_refusal_is_a_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An exception of another kind, and a process that ends: named, and the file is kept."""
    answers = iter([{"flown": {}}, {"refused": "no"}, {"failed": "KeyError: 3"}, {"flown": {}}])
    monkeypatch.setattr(WorkerPool, "fly", lambda *_: answered(next(answers)))
    row = fuzz("site", 3, tmp_path, jobs=1)
    assert (row.ends["read"], row.ends["refused"], row.ends["fault"]) == (1, 1, 1)
    assert row.faults == [f"{tmp_path / '1.yaml'}: KeyError: 3"]
    assert [path.name for path in tmp_path.glob("[0-9]*")] == ["1.yaml"]
    assert "| site | 3 | 1 | 1 | 1 | 0 |" in table([row], 3)


def test_a_whole_file_that_is_refused_is_a_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise mutations of a file that nobody can read would all pass."""
    monkeypatch.setattr(WorkerPool, "fly", lambda *_: answered({"refused": "not today"}))
    row = fuzz("site", 2, tmp_path, jobs=1)
    assert len(row.faults) == 1
    assert "a whole file was refused" in row.faults[0]


def test_a_fault_makes_the_exit_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(WorkerPool, "fly", lambda *_: answered({"failed": "KeyError: 3"}))
    monkeypatch.setattr(
        "sys.argv", ["fuzz_files.py", "site", "--cases", "2", "--out", str(tmp_path)]
    )
    assert fuzz_files.main() == 1
    assert "KeyError: 3" in capsys.readouterr().err
