"""Recorded flights of a scripted drone that sees noise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from uav_bt import app
from uav_bt.testing import ScriptedDrone
from uav_bt.types import Observation

MISSION = """
<Sequence>
  <TakeOff height_m="1.5"/>
  <Turn name="away" degrees="60"/>
  <HoverFor seconds="0.5"/>
  <Turn name="back" degrees="-60"/>
  <Land/>
</Sequence>
"""


class NoisyDrone(ScriptedDrone):
    """Its frames are noise of their own, so that none passes for another."""

    def observe(self) -> Observation:
        seen = super().observe()
        if seen.frame is None:
            return seen
        image = np.random.default_rng(seen.frame.index).integers(
            0, 256, seen.frame.image.shape, dtype=np.uint8
        )
        return replace(seen, frame=replace(seen.frame, image=image))


def record_flight(folder: Path, name: str = "flight.mcap") -> Path:
    """Fly and return the record."""
    tree = folder / "mission.xml"
    tree.write_text(
        f'<root BTCPP_format="4"><BehaviorTree ID="Main">{MISSION}</BehaviorTree></root>',
        encoding="utf-8",
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("uav_bt.app.flight.make_drone", lambda _: NoisyDrone())
        app.fly(tree, app.FlightOptions(record=folder / name))
    return folder / name
