"""The shared flight of the tests of views; its recording takes some seconds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.uav_bt.app.view.recorded_world import MISSION, OPTIONS, Seen
from tests.worlds.trees import tree_file
from uav_bt import app


@pytest.fixture(scope="session")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Seen]:
    """Return the record of a short flight, and the ticks that a live follower saw."""
    folder, seen = tmp_path_factory.mktemp("flown"), Seen()
    options = replace(OPTIONS, record=folder / "flight.mcap")
    app.fly(tree_file(folder, MISSION), options, listeners=[seen.follow])
    return folder / "flight.mcap", seen
