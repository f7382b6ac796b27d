"""The shared flight of the tests of views; its recording takes some seconds."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.uav_bt.app.view.recorded_world import Seen, fly


@pytest.fixture(scope="session")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Seen]:
    """Return the record of a short flight, and the ticks that a live follower saw."""
    record, seen, _ = fly(tmp_path_factory.mktemp("flown"))
    return record, seen
