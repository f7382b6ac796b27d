"""Scores on held-out picks."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

from tests.uav_bt.learning.lab_world import draw_lab, write_colour_network
from uav_bt.errors import InputError
from uav_bt.learning.lab_data import picks_of_lab
from uav_bt.learning.lab_material import LabMaterial
from uav_bt.learning.pick_scores import PickScore, network_of_lab, score_picks, write_sheet


def scored(material: LabMaterial) -> PickScore:
    uses = material.uses()
    picks = [pick for pick in picks_of_lab(material, uses) if uses[pick.image] == "check"]
    segment = network_of_lab(material.lab).ids
    return score_picks(segment, picks, material.frames, material.lab.classes)


def test_confusions_and_worst_images_are_named_and_drawn(tmp_path: Path) -> None:
    """Crates are taken for carts, of the same role, and one wall pick lies on the floor."""
    material = draw_lab(tmp_path / "hall")
    write_colour_network(material.network, order=(2, 1, 3, 0))
    text = material.picks.read_text().replace("hall-007.png,20,20", "hall-007.png,20,120")
    material.picks.write_text(text)
    score = scored(material)
    assert score.confusions() == [("crate", "cart", 1.0), ("wall", "floor", 0.25)]
    assert [(each.image, each.wrong) for each in score.images] == [
        ("hall-007.png", 3),
        ("hall-006.png", 2),
    ]
    assert score.picks == {"wall": 4, "floor": 4, "crate": 4, "cart": 0}
    assert score.to_json()["class_iou"]["cart"] is None
    assert score.unchecked == ["cart"]
    outside, ground, _, obstacle = score.total.role_iou
    assert (outside, ground, obstacle) == (0.75, 0.8, 1.0)
    assert score.total.accuracy == pytest.approx(7 / 12)
    file = tmp_path / "s" / "x.png"
    write_sheet(score, network_of_lab(material.lab).ids, material.frames, file)
    sheet = cv2.imread(str(file))
    assert sheet is not None
    assert sheet.shape == (2 * 180, 3 * 320, 3)
    assert sheet[10, 320 + 5].tolist() == [0x40, 0x20, 0x20]  # BGR of the wall in the class map


def test_without_network_or_picks_the_command_is_named(tmp_path: Path) -> None:
    material = draw_lab(tmp_path / "hall", check=0)
    with pytest.raises(InputError, match="has no network: `uav-bt lab train"):
        network_of_lab(material.lab)
    write_colour_network(material.network)
    with pytest.raises(InputError, match="no picks on images for checks"):
        scored(material)
