"""Worker processes: a crash, a hang and a fault cost one flight and say what happened."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.uav_bt.campaign.campaign_world import FLY, plan
from uav_bt.campaign.worker_process import FAILED, FLOWN, REFUSED
from uav_bt.campaign.workers import Worker, WorkerPool


def task(fate: str, seed: int = 0) -> dict[str, Any]:
    return next(plan(policies={str(seed): fate}, seed_from=seed).tasks()).to_json()


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    one = Worker(FLY)
    yield one
    one.close()


def test_a_worker_flies_one_task_after_the_other_in_one_process(worker: Worker) -> None:
    first, second = (worker.fly(task("lands", seed), 60.0)[FLOWN] for seed in (0, 1))
    assert (first["seed"], second["seed"]) == (0, 1)
    assert first["wall_s"] == second["wall_s"]


def test_what_a_flight_leaves_behind_is_gone_before_the_next(
    worker: Worker, tmp_path: Path
) -> None:
    collected = tmp_path / "collected"
    for fate in (f"leaves a cycle to {collected}", "lands"):
        assert FLOWN in worker.fly(task(fate), 60.0)
    assert collected.exists()


def test_what_libraries_print_does_not_land_among_the_answers(worker: Worker) -> None:
    assert worker.fly(task("is chatty"), 60.0)[FLOWN]["outcome"] == "success"


def test_a_fault_is_told_with_where_it_came_from(worker: Worker) -> None:
    answer = worker.fly(task("raises"), 60.0)
    assert answer[FAILED] == "RuntimeError: out of luck"
    assert "campaign_world.py" in answer["details"]


def test_refused_input_is_no_failed_flight(worker: Worker) -> None:
    assert worker.fly(task("is refused"), 60.0) == {REFUSED: "no such weights"}


def test_a_crash_is_told_by_its_signal_and_its_last_words(worker: Worker) -> None:
    answer = worker.fly(task("crashes"), 60.0)
    assert answer[FAILED] == "its process was ended by SIGABRT"
    assert "a library's last words" in answer["details"]


def test_a_process_that_leaves_is_told_by_its_exit_code(worker: Worker) -> None:
    assert worker.fly(task("exits"), 60.0)[FAILED] == (
        "its process ended by itself, with exit code 3"
    )


def test_a_flight_that_hangs_is_stopped(worker: Worker) -> None:
    assert worker.fly(task("hangs"), 0.2)[FAILED].startswith("no end after 0.2 s of wall time")


def test_after_a_lost_process_the_next_task_flies_in_a_new_one(worker: Worker) -> None:
    before = worker.fly(task("lands"), 60.0)[FLOWN]["wall_s"]
    lost = worker.fly(task("exits"), 60.0)
    answer = worker.fly(task("lands"), 60.0)
    assert FAILED in lost
    assert answer[FLOWN]["wall_s"] != before


def test_closing_stops_what_still_flies() -> None:
    pool = WorkerPool(FLY)
    answers: list[dict[str, Any]] = []
    asked = threading.Thread(target=lambda: answers.append(pool.fly(task("hangs"), 600.0)))
    asked.start()
    while not pool.flying:
        asked.join(0.01)
    pool.close()
    asked.join(60.0)
    assert not asked.is_alive()
    assert FAILED in answers[0]
    assert pool.fly(task("lands"), 60.0) == {FAILED: "the campaign was stopped"}


@pytest.mark.parametrize("fate", ["lands", "crashes", "hangs"])
def test_a_worker_leaves_no_temporary_files(
    fate: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not even one that was killed in flight, which could not tidy up."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    worker = Worker(FLY)
    (folder,) = tmp_path.glob("uav-bt-worker-*")
    answer = worker.fly({**task(fate), "litters": True}, 20.0 if fate != "hangs" else 5.0)
    assert (FLOWN in answer) == (fate == "lands")
    assert list(folder.iterdir())
    worker.close()
    assert list(tmp_path.iterdir()) == []


def test_a_worker_whose_campaign_is_gone_tidies_up_itself(tmp_path: Path) -> None:
    folder = tmp_path / "worker"
    folder.mkdir()
    command = [sys.executable, "-m", "uav_bt.campaign.worker_process", FLY, str(folder)]
    subprocess.run(command, stdin=subprocess.DEVNULL, timeout=60, check=True)  # noqa: S603
    assert not folder.exists()
