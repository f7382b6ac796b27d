"""Worker processes: a crash, a hang or a fault loses one flight, with its reason."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.uav_bt.campaign.campaign_world import FLY, plan
from uav_bt.app.options import FlightOptions
from uav_bt.campaign import make_plan, run
from uav_bt.campaign.workers import FAILED, FLOWN, REFUSED, WorkerPool

HERE = Path(__file__).parents[3]


def task(fate: str, seed: int = 0) -> dict[str, Any]:
    return next(plan(policies={str(seed): fate}, seed_from=seed).tasks()).to_json()


@pytest.fixture(scope="module")
def worker() -> Iterator[WorkerPool]:
    one = WorkerPool(FLY, workers=1)
    yield one
    one.close()


def flown(pool: WorkerPool, fate: str, seed: int = 0, timeout_s: float = 60.0) -> dict[str, Any]:
    return pool.fly(task(fate, seed), timeout_s).result(90.0)


def test_a_worker_flies_one_task_after_the_other_in_one_process(worker: WorkerPool) -> None:
    first, second = (flown(worker, "lands", seed)[FLOWN] for seed in (0, 1))
    assert (first["seed"], second["seed"]) == (0, 1)
    assert first["wall_s"] == second["wall_s"]


def test_what_a_flight_leaves_behind_is_gone_before_the_next(
    worker: WorkerPool, tmp_path: Path
) -> None:
    collected = tmp_path / "collected"
    for fate in (f"leaves a cycle to {collected}", "lands"):
        assert FLOWN in flown(worker, fate)
    assert collected.exists()


def test_what_libraries_print_does_not_land_among_the_answers(worker: WorkerPool) -> None:
    assert flown(worker, "is chatty")[FLOWN]["outcome"] == "success"


def test_a_fault_is_reported_with_its_traceback(worker: WorkerPool) -> None:
    answer = flown(worker, "raises")
    assert answer[FAILED] == "RuntimeError: out of luck"
    assert "campaign_world.py" in answer["details"]


@pytest.mark.parametrize(
    ("fate", "reason"),
    [
        ("calls sys.exit", "SystemExit: 3"),
        ("has an answer that cannot be sent", "its answer was lost: "),
    ],
)
def test_a_flight_that_ends_unusually_fails_and_the_next_one_flies(
    worker: WorkerPool, fate: str, reason: str
) -> None:
    assert flown(worker, fate)[FAILED].startswith(reason)
    assert FLOWN in flown(worker, "lands")


TERMINATED = """
import os, signal
from uav_bt.tree import Leaf, Status

class Stop(Leaf):
    def update(self):
        os.kill(os.getpid(), signal.{})
        return Status.RUNNING
"""


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_a_signal_to_a_worker_in_flight_is_an_error_of_its_flight(
    name: str, tmp_path: Path
) -> None:
    leaves, tree = tmp_path / "leaves.py", tmp_path / "tree.xml"
    leaves.write_text(TERMINATED.format(name))
    tree.write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence>'
        "<TakeOff/><Stop/><Land/></Sequence></BehaviorTree></root>"
    )
    options = FlightOptions(drone="plain", leaves=[leaves])
    done = run(make_plan([str(tree)], options, scenes=["val-a"], flights=1), tmp_path / "out")
    (flight,) = done.flights
    assert flight["outcome"] == "error"
    assert flight["reason"] == f"its process was ended by {name}"


def test_refused_input_is_no_failed_flight(worker: WorkerPool) -> None:
    assert flown(worker, "is refused") == {REFUSED: "no such weights"}


def test_a_crash_is_reported_with_signal_and_last_output(worker: WorkerPool) -> None:
    answer = flown(worker, "crashes")
    assert answer[FAILED] == "its process was ended by SIGABRT"
    assert "a library's last words" in answer["details"]


def test_a_process_that_exits_is_reported_with_its_exit_code(worker: WorkerPool) -> None:
    assert flown(worker, "exits")[FAILED] == ("its process ended by itself, with exit code 3")


def test_a_flight_that_hangs_is_stopped(worker: WorkerPool) -> None:
    assert flown(worker, "hangs", timeout_s=0.2)[FAILED].startswith(
        "no end after 0.2 s of wall time"
    )


def test_after_a_lost_process_the_next_task_flies_in_a_new_one(worker: WorkerPool) -> None:
    before = flown(worker, "lands")[FLOWN]["wall_s"]
    lost = flown(worker, "exits")
    answer = flown(worker, "lands")
    assert FAILED in lost
    assert answer[FLOWN]["wall_s"] != before


def test_closing_stops_what_flies_and_what_waits() -> None:
    pool = WorkerPool(FLY, workers=1)
    answers = [pool.fly(task("hangs"), 600.0) for _ in range(2)]
    pool.close()
    assert [one.result(10.0) for one in answers] == [{FAILED: "the campaign was stopped"}] * 2


@pytest.mark.parametrize("fate", ["lands", "crashes", "hangs"])
def test_a_pool_leaves_no_temporary_files(
    fate: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """This includes the files of a worker that was killed in flight."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    pool = WorkerPool(FLY, workers=1)
    (folder,) = tmp_path.glob("uav-bt-workers-*")
    timeout_s = 20.0 if fate != "hangs" else 5.0
    answer = pool.fly({**task(fate), "litters": True}, timeout_s).result(90.0)
    assert (FLOWN in answer) == (fate == "lands")
    assert [path.is_dir() for path in folder.iterdir()] == [True]
    pool.close()
    assert list(tmp_path.iterdir()) == []


KILLED = """
import os, signal
from pathlib import Path
from tests.uav_bt.campaign.campaign_world import FLY
from tests.uav_bt.campaign.test_campaign_workers import task
from uav_bt.campaign.workers import WorkerPool

pool = WorkerPool(FLY, workers=1)
pool.fly({**task("lands"), "litters": True}, 60.0).result()
pool.fly({**task("hangs"), "litters": True}, 60.0)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_workers_whose_campaign_was_killed_end_and_tidy_up(tmp_path: Path) -> None:
    killed = subprocess.run(  # noqa: S603
        [sys.executable, "-c", KILLED],
        env={**os.environ, "TMPDIR": str(tmp_path)},
        timeout=90,
        check=False,
    )
    assert killed.returncode == -9
    deadline_s = time.monotonic() + 20.0
    while list(tmp_path.glob("uav-bt-workers-*")) and time.monotonic() < deadline_s:
        time.sleep(0.05)
    assert list(tmp_path.glob("uav-bt-workers-*")) == []


def test_a_script_without_a_main_guard_gets_the_remedy(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "from tests.uav_bt.campaign.campaign_world import FLY, plan\n"
        "from uav_bt.campaign.runner import run\n"
        "from pathlib import Path\n"
        f"run(plan(), Path({str(tmp_path / 'out')!r}), fly=FLY)\n"
    )
    done = subprocess.run(  # noqa: S603
        [sys.executable, str(script)],
        env={**os.environ, "PYTHONPATH": str(HERE)},
        capture_output=True,
        text=True,
        timeout=90,
        check=False,
    )
    assert done.returncode == 1
    assert 'must call it below `if __name__ == "__main__":`' in done.stderr
    assert (tmp_path / "out" / "flights.jsonl").read_text() == ""
