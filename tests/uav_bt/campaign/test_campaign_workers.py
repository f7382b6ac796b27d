"""Worker processes, here and of a cluster: a crash, a hang or a fault loses one flight."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import uav_bt
from tests.uav_bt.campaign.campaign_world import comparable, fly, plan
from tests.worlds.processes import ROOT, python
from uav_bt.campaign import make_plan, run
from uav_bt.campaign.plan import FlightTask
from uav_bt.campaign.runner import LocalBackend
from uav_bt.campaign.workers import WorkerPool
from uav_bt.errors import InputError


def task(fate: str) -> FlightTask:
    return next(plan(policies={"0": fate}, faults=["random"]).tasks())


@pytest.fixture(scope="module")
def worker() -> Iterator[WorkerPool]:
    one = WorkerPool(fly, workers=1)
    yield one
    one.close()


def flown(pool: WorkerPool, fate: str, timeout_s: float = 60.0) -> dict[str, Any]:
    return pool.line_of(pool.start(task(fate), timeout_s))


def test_what_a_flight_leaves_is_gone_before_the_next(worker: WorkerPool, tmp_path: Path) -> None:
    collected = tmp_path / "collected"
    for fate in (f"leaves a cycle to {collected}", "lands"):
        flown(worker, fate)
    assert collected.exists()


@pytest.mark.parametrize(
    ("fate", "reason", "details", "processes"),
    [
        ("raises", "RuntimeError: out of luck", "campaign_world.py", 1),
        ("calls sys.exit", "SystemExit: 3", "sys.exit", 1),
        ("has an answer that cannot be sent", "its answer was lost: ", "", 1),
        ("crashes", "its process was ended by SIGABRT", "a library's last words", 2),
        ("exits", "its process ended by itself, with exit code 3", "", 2),
        ("hangs", "no end after 5 s of wall time; its process was stopped", "", 2),
    ],
)
def test_a_flight_that_ends_unusually_is_an_error_and_the_next_one_flies(
    worker: WorkerPool, fate: str, reason: str, details: str, processes: int
) -> None:
    before = flown(worker, "is chatty")
    lost = flown(worker, fate, 60.0 if fate != "hangs" else 5.0)
    assert (lost["outcome"], lost["tree"], lost["scene"]) == ("error", "one.xml", "lab")
    assert lost["faults"] == ["random"]
    assert lost["reason"].startswith(reason)
    assert details in lost["details"]
    after = flown(worker, "lands")
    assert before["outcome"] == after["outcome"] == "success"
    assert len({flight["wall_s"] for flight in (before, after)}) == processes


TERMINATED = """
import os, signal
from uav_bt.tree import Leaf, Status

class Stop(Leaf):
    def update(self):
        {}
        return Status.RUNNING
"""


@pytest.mark.parametrize(
    ("code", "reason", "has_path"),
    [
        ("os.kill(os.getpid(), signal.SIGTERM)", "its process was ended by SIGTERM", False),
        ("os.kill(os.getpid(), signal.SIGHUP)", "its process was ended by SIGHUP", False),
        ("raise ValueError('of a leaf')", "ValueError: of a leaf", True),
    ],
)
def test_what_ends_a_flight_in_a_worker_is_its_error(
    code: str, reason: str, tmp_path: Path, *, has_path: bool
) -> None:
    leaves, tree = tmp_path / "leaves.py", tmp_path / "tree.xml"
    leaves.write_text(TERMINATED.format(code))
    tree.write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence>'
        "<TakeOff/><Stop/><Land/></Sequence></BehaviorTree></root>"
    )
    planned = make_plan([tree], scenes=["val-a"], flights=1, drone="plain", leaves=[leaves])
    (flight,) = run(planned, tmp_path / "out").flights
    assert flight["outcome"] == "error"
    assert reason in flight["reason"]
    assert ("path" in flight) == has_path, "a flight that has a report keeps it"


def test_closing_stops_what_flies_and_what_waits_and_leaves_no_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    pool = WorkerPool(fly, workers=1)
    for fate in ("lands", "crashes"):
        flown(pool, fate)
    (folder,) = tmp_path.glob("uav-bt-workers-*")
    assert [path.is_dir() for path in folder.iterdir()] == [True, True]
    flights = [pool.start(task("hangs"), 600.0) for _ in range(2)]
    pool.close()
    assert [pool.line_of(one)["reason"] for one in flights] == ["the campaign was stopped"] * 2
    assert list(tmp_path.iterdir()) == []


KILLED = """
import os, signal
from tests.uav_bt.campaign.campaign_world import fly
from tests.uav_bt.campaign.test_campaign_workers import task
from uav_bt.campaign.workers import WorkerPool

pool = WorkerPool(fly, workers=1)
pool.line_of(pool.start(task("lands"), 60.0))
pool.start(task("hangs"), 60.0)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_workers_whose_campaign_was_killed_end_and_tidy_up(tmp_path: Path) -> None:
    assert python("-c", KILLED, environment={"TMPDIR": str(tmp_path)}).returncode == -9
    deadline_s = time.monotonic() + 20.0
    while list(tmp_path.glob("uav-bt-workers-*")) and time.monotonic() < deadline_s:
        time.sleep(0.05)
    assert list(tmp_path.glob("uav-bt-workers-*")) == []


def test_a_script_without_a_main_guard_gets_the_remedy(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "from tests.uav_bt.campaign.campaign_world import fly, plan\n"
        "from uav_bt.campaign.runner import run\n"
        "from pathlib import Path\n"
        f"run(plan(), Path({str(tmp_path / 'out')!r}), fly=fly)\n"
    )
    done = python(script, environment={"PYTHONPATH": str(ROOT)})
    assert done.returncode == 1
    assert 'must call it below `if __name__ == "__main__":`' in done.stderr
    assert (tmp_path / "out" / "flights.jsonl").read_text() == ""


# --- Dask -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as one:
        yield one


def dask(address: str, **how: Any) -> Any:
    from uav_bt.campaign.cluster import DaskBackend

    return DaskBackend(address, **how)


def test_a_cluster_flies_the_same_flights(cluster: Any, tmp_path: Path) -> None:
    backend, wanted = dask(cluster.scheduler_address), plan(flights=3, policies={"1": "exits"})
    there = run(wanted, tmp_path / "there", backend=backend, fly=fly)
    here = run(wanted, tmp_path / "here", backend=LocalBackend(2), fly=fly)
    assert [comparable(one) for one in there.flights] == [comparable(one) for one in here.flights]
    assert [one["outcome"] for one in there.flights] == ["success", "error", "success"]
    both = [run(plan(flights=6), tmp_path / name, backend=backend, fly=fly) for name in "ab"]
    first, second = ({one["wall_s"] for one in each.flights} for each in both)
    assert not first & second, "each campaign ends its processes"


def test_other_versions_are_refused(cluster: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uav_bt, "__version__", "99.0")
    backend = dask(cluster.scheduler_address)
    with pytest.raises(InputError, match=r"workers need uav-bt 99\.0, and there are \{'"):
        next(backend.run(fly, plan().tasks(), 60.0))


def test_a_cluster_without_workers_is_refused() -> None:
    from distributed import LocalCluster

    with (
        LocalCluster(n_workers=0, host="127.0.0.1", dashboard_address="127.0.0.1:0") as empty,
        pytest.raises(InputError, match="there are none; start some with `dask worker"),
    ):
        next(dask(empty.scheduler_address, connect_s=0.2).run(fly, plan().tasks(), 60.0))


@pytest.mark.parametrize("address", ["a silent one", "nowhere", "127.0.0.1:1", "no scheme://x"])
def test_what_does_not_answer_is_refused_in_time(address: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        silent = f"127.0.0.1:{server.getsockname()[1]}"
        asked = silent if address == "a silent one" else address
        with pytest.raises(InputError, match=f"no Dask scheduler answers at {asked} within 0.2 s"):
            next(dask(asked, connect_s=0.2).run(fly, plan().tasks(), 60.0))
