"""The record that the tests of data sets share."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.uav_bt.learning.dataset.dataset_world import record_flight


@pytest.fixture(scope="session")
def kept_record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_flight(tmp_path_factory.mktemp("recorded"))


@pytest.fixture
def record(kept_record: Path, tmp_path: Path) -> Path:
    """Return a copy of a record in a folder of its own."""
    return Path(shutil.copy(kept_record, tmp_path / "flight.mcap"))
