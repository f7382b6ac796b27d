"""Dask: the same flights as on this machine, and a clear error without a cluster."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from distributed import LocalCluster

import uav_bt
from tests.uav_bt.campaign.campaign_world import comparable, fly, plan
from uav_bt.campaign.cluster import DaskBackend
from uav_bt.campaign.runner import LocalBackend, run
from uav_bt.errors import InputError


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    with LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as one:
        yield one


def test_a_cluster_flies_the_same_flights(cluster: LocalCluster, tmp_path: Path) -> None:
    dask, wanted = DaskBackend(cluster.scheduler_address), plan(flights=3, policies={"1": "exits"})
    there = run(wanted, tmp_path / "there", backend=dask, fly=fly)
    here = run(wanted, tmp_path / "here", backend=LocalBackend(2), fly=fly)
    assert [comparable(one) for one in there.flights] == [comparable(one) for one in here.flights]
    assert [one["outcome"] for one in there.flights] == ["success", "error", "success"]
    both = [run(plan(flights=6), tmp_path / name, backend=dask, fly=fly) for name in "ab"]
    first, second = ({one["wall_s"] for one in each.flights} for each in both)
    assert not first & second, "each campaign ends its processes"


def test_workers_with_another_version_are_refused(
    cluster: LocalCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uav_bt, "__version__", "99.0")
    backend = DaskBackend(cluster.scheduler_address)
    with pytest.raises(InputError, match=r"workers need uav-bt 99\.0, and there are \{'"):
        next(backend.run(fly, plan().tasks(), 60.0))


def test_a_cluster_without_workers_is_refused() -> None:
    with (
        LocalCluster(n_workers=0, host="127.0.0.1", dashboard_address="127.0.0.1:0") as empty,
        pytest.raises(InputError, match="there are none; start some with `dask worker"),
    ):
        next(DaskBackend(empty.scheduler_address, connect_s=0.2).run(fly, plan().tasks(), 60.0))


@pytest.mark.parametrize("address", ["a silent one", "nowhere", "127.0.0.1:1", "no scheme://x"])
def test_what_does_not_answer_is_refused_in_time(address: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        silent = f"127.0.0.1:{server.getsockname()[1]}"
        asked = silent if address == "a silent one" else address
        with pytest.raises(InputError, match=f"no Dask scheduler answers at {asked} within 0.2 s"):
            next(DaskBackend(asked, connect_s=0.2).run(fly, plan().tasks(), 60.0))
