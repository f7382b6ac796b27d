"""Mistakes in a picks file are found before a teacher is trained."""

from pathlib import Path

import numpy as np
import pytest

from perception.segmentation.training.pick_images import check_picks
from perception.segmentation.training.picks import Pick, write_picks
from tests.perception.segmentation.training.pick_places import CRATE, FLOOR, PAD, PLACE, write_image
from uav_bt.errors import FileError

USES = {"a.png": "train", "b.png": "train", "c.png": "check"}
THIRDS = {"floor": (5, 45), "crate": (60, 100), "pad": (115, 155)}  # columns


@pytest.fixture
def place(tmp_path: Path) -> Path:
    for number, name in enumerate(USES):
        write_image(tmp_path / "frames" / name, FLOOR, CRATE, PAD, seed=number)
    return tmp_path


def _picks(*names: str, images: tuple[str, ...] = tuple(USES), count: int = 12) -> list[Pick]:
    rng = np.random.default_rng(0)
    return [
        Pick(image=image, x=x, y=y, class_id=PLACE.id_of(name))
        for image in images
        for name in names
        for x, y in rng.integers((THIRDS[name][0], 5), (THIRDS[name][1], 85), (count, 2)).tolist()
    ]


def _checked(place: Path, picks: list[Pick]) -> list[str]:
    write_picks(place / "picks.csv", picks, PLACE)
    return check_picks(place / "picks.csv", place / "frames", PLACE, USES)


def test_good_picks_have_only_the_class_that_is_not_there(place: Path) -> None:
    assert _checked(place, _picks("floor", "crate", "pad")) == [
        "class 'wall' has no picks on images for training: it is never predicted"
    ]


def test_a_pick_at_no_place_names_its_line(place: Path) -> None:
    for image, x, y, words in (
        ("a.png", 160, 3, r"160x90 pixels of 'a\.png', got \(160, 3\)"),
        ("a.png", 3, 90, r"got \(3, 90\)"),
        ("aa.png", 3, 3, r"got 'aa\.png'; did you mean 'a\.png'"),
    ):
        pick = Pick(image=image, x=x, y=y, class_id=1)
        with pytest.raises(FileError, match=words) as found:
            _checked(place, [*_picks("floor", "crate", count=1), pick])
        assert found.value.line == 8


def test_classes_with_few_or_no_picks_are_named(place: Path) -> None:
    """On images for training and for the check."""
    check = ("c.png",)
    with pytest.raises(FileError, match="two classes at least on images for training, got 1"):
        _checked(place, _picks("floor") + _picks("crate", images=check))
    with pytest.raises(FileError, match=r"picks of the ground \('floor'\).*got none"):
        _checked(place, _picks("crate", "pad") + _picks("floor", images=check))
    found = _checked(place, _picks("floor", "pad") + _picks("crate", count=2))
    assert "class 'crate' has only 4 picks on images for training: 20 or more are better" in found
    learned = _picks("floor", "crate", images=("a.png", "b.png"))
    unseen = "no image for the check has picks"
    assert f"{unseen}: the network cannot be scored" in _checked(place, learned)
    found = _checked(place, learned + _picks("floor", images=check))
    assert f"{unseen} of 'crate': they cannot be scored" in found


def test_classes_of_one_colour_are_named(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(THIRDS, "pad", THIRDS["crate"])
    for images, count in ((tuple(USES), 12), (("a.png",), 30)):
        picks = _picks("floor", "crate", "pad", images=images, count=count)
        (found,) = (line for line in _checked(place, picks) if "alike" in line)
        assert found.startswith("classes 'crate' and 'pad' look alike: ")
