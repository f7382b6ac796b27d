"""Whether a flight takes place where its network was learned."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.adaptation.head import GroundHead
from perception.segmentation.adaptation.learned_lab import LearnedPlace, write_learned_lab
from perception.segmentation.adaptation.place_check import PlaceCheck, statement_of
from perception.segmentation.adaptation.place_statement import STATEMENT_FILE
from perception.segmentation.adaptation.role_network import OnnxRoleNetwork, RoleView
from tests.perception.segmentation.adaptation.learned_world import STATEMENT
from uav_bt.errors import FileError
from uav_bt.types import Attitude, Frame
from uav_bt.types.arrays import Image


class Uniform:
    """A network whose features are the image's mean, in hundreds of grey levels."""

    def infer(self, rgb: Image) -> RoleView:
        """Return the same features everywhere."""
        features = np.full((24, 2, 4), rgb.mean() / 100.0, np.float32)
        return RoleView(scores=np.zeros((3, 4, 8), np.float32), features=features)


def _frame(time_s: float, *, height_m: float = 1.5, yaw_rad: float = 0.0, grey: int = 0) -> Frame:
    return Frame(
        image=np.full((8, 16, 3), grey, np.uint8),
        index=int(10 * time_s),
        captured_s=time_s,
        gimbal_pitch_rad=-0.5,
        attitude=Attitude(yaw_rad=yaw_rad),
        altitude_m=height_m,
        height_m=height_m,
        height_above_ground_m=height_m,
    )


def _flown(*, height_m: float = 1.5, grey: int = 0) -> PlaceCheck:
    """Return a check after a climb and half a turn."""
    check = PlaceCheck(STATEMENT, Uniform())
    for tick in range(20):
        check.add(_frame(0.1 * tick, height_m=height_m * tick / 20, grey=255))
    assert not check.is_complete
    for tick in range(20, 200):
        if not check.is_complete:
            check.add(_frame(0.1 * tick, height_m=height_m, yaw_rad=0.05 * tick, grey=grey))
    assert check.is_complete
    return check


def test_the_climb_does_not_count() -> None:
    """Its images are white, and those of the learned place are black."""
    assert _flown().foreign() is None


def test_another_height_and_another_look_are_foreign() -> None:
    assert "1.5 m above the ground, not 2.4 m" in (_flown(height_m=2.4).foreign() or "")
    assert "images differ" in (_flown(grey=200).foreign() or "")


def test_a_drone_that_hovers_is_judged_later() -> None:
    check = PlaceCheck(STATEMENT, Uniform())
    for tick in range(100):
        check.add(_frame(0.1 * tick))
    assert not check.is_complete
    for tick in range(100, 300):
        check.add(_frame(0.1 * tick))
    assert check.is_complete


@pytest.fixture
def learned(tmp_path: Path) -> Path:
    """Return the network of a learned lab."""
    network = OnnxRoleNetwork(SHIPPED_WEIGHTS / "any.onnx")
    place = LearnedPlace(head=GroundHead.unchanged(24), statement=STATEMENT, labels=())
    lab = write_learned_lab(tmp_path / "hall", place, network)
    return Path(lab.network["model"])


def test_an_adapted_network_needs_its_statement(learned: Path) -> None:
    assert statement_of(learned) == STATEMENT
    assert statement_of(SHIPPED_WEIGHTS / "any.onnx") is None
    file = learned.parent / STATEMENT_FILE
    file.unlink()
    with pytest.raises(FileError, match="learn the place again"):
        statement_of(learned)
    replace(STATEMENT, base="1").write(learned.parent)
    with pytest.raises(FileError, match="copy both files of one learned lab"):
        statement_of(learned)
    replace(STATEMENT, feature_means=((0.0,) * 7,), feature_spread=(1.0,) * 7).write(learned.parent)
    with pytest.raises(FileError, match="has 24 features, got one from 0 with 7"):
        statement_of(learned)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("focal_px", [0.0, 1.0], "focal_px"),
        ("height_m", float("nan"), "height_m"),
        ("feature_spread", [1.0], "expected 1 numbers as in feature_spread, got 24"),
        ("feature_means", [["x"] * 24], "feature_means"),
        ("version", 2, "version"),
    ],
)
def test_a_damaged_statement_is_one_error(
    learned: Path, key: str, value: object, message: str
) -> None:
    file = learned.parent / STATEMENT_FILE
    file.write_text(yaml.safe_dump({**yaml.safe_load(file.read_text()), key: value}))
    with pytest.raises(FileError, match=message):
        statement_of(learned)
