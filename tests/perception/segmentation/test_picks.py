"""Picks of a person: their files, images and checks."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from perception.segmentation.features import patch_slices
from perception.segmentation.training import picks
from perception.segmentation.training.pick_images import (
    MAX_WIDTH_PX,
    check_picks,
    find_super_pixels,
)
from perception.segmentation.training.picks import Pick, write_picks
from tests.paper_lab import CLASSES, HELIPAD_H
from tests.perception.segmentation.patterned import PATTERNED, samples
from tests.perception.segmentation.pick_places import CRATE, FLOOR, PAD, PLACE, write_image
from tests.worlds.tables import cases
from uav_bt.errors import FileError, ValueRangeError

HEADER = "image,x,y,class,origin\n"


def test_written_picks_come_back(tmp_path: Path) -> None:
    made = [
        picks.Pick(image="a.jpg", x=3, y=4, class_id=HELIPAD_H),
        picks.Pick(image='odd, "name".png', x=0, y=9, class_id=16, origin="simulated"),
    ]
    path = tmp_path / "picks.csv"
    picks.write_picks(path, made, CLASSES)
    assert picks.read_picks(path, CLASSES) == made
    assert path.read_text(encoding="utf-8").startswith(HEADER)


@pytest.mark.parametrize(("row", "message"), cases("perception")["bad_pick_rows"])
def test_a_bad_row_is_refused_with_its_line(tmp_path: Path, row: str, message: str) -> None:
    path = tmp_path / "picks.csv"
    for text, words in (
        (f"{HEADER}a.png,1,2,carpet,hand\n{row}\n", f"picks.csv:3: .*{message}"),
        (HEADER, "holds no picks"),
        (f"{row}\n", "csv:1: the columns must be"),
    ):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(FileError, match=words):
            picks.read_picks(path, CLASSES)


def test_drawn_picks_lie_well_inside_their_class_on_seven_to_nine_pictures_each() -> None:
    exact = {name: ids for name, _, ids in samples(20, seed=4)}
    drawn, again = (
        picks.draw_picks(exact.items(), np.random.default_rng(0), patch_px=8, total=600)
        for _ in range(2)
    )
    assert drawn == again
    assert {pick.origin for pick in drawn} == {"simulated"}
    for pick in drawn:
        ids = exact[pick.image]
        assert ids[pick.y, pick.x] == pick.class_id
        patch = ids[patch_slices(pick.x, pick.y, patch_px=8, width_px=160, height_px=90)]
        assert (patch == pick.class_id).mean() > 0.8
    for class_id in PATTERNED:
        mine = [pick for pick in drawn if pick.class_id == class_id]
        assert 90 <= len(mine) <= 115
        assert 7 <= len({pick.image for pick in mine}) <= 9


def test_patches_count_every_pixel_of_their_class() -> None:
    (name, rgb, _) = next(samples(1, seed=0))
    pick = picks.Pick(image=name, x=40, y=40, class_id=1)
    gathered = picks.gather_patches([pick, pick], [(name, rgb)], 8, CLASSES)
    assert gathered.features.shape == (2, 190)
    assert gathered.colour_counts[1].sum() == gathered.colour_counts.sum() == 2 * 64
    outside = picks.Pick(image=name, x=400, y=4, class_id=1)
    with pytest.raises(ValueRangeError, match="outside the 160x90"):
        picks.gather_patches([outside], [(name, rgb)], 8, CLASSES)
    with pytest.raises(ValueRangeError, match=r"gone.jpg, which is not among"):
        picks.gather_patches([pick, replace(pick, image="gone.jpg")], [(name, rgb)], 8, CLASSES)


# --- super-pixels follow edges --------------------------------------------------------------------


def _scene(width: int, height: int) -> NDArray[np.uint8]:
    """A noisy image of two colours with a slanted edge."""
    rgb = np.full((height, width, 3), 60, dtype=np.uint8)
    corners = np.array([(0, 0), (width * 2 // 5, 0), (width * 3 // 5, height), (0, height)])
    cv2.fillPoly(rgb, [corners], (180, 150, 120))
    noise = np.random.default_rng(0).integers(0, 12, rgb.shape, dtype=np.uint8)
    return rgb + noise


@pytest.mark.parametrize("size", [(320, 180), (333, 77), (90, 160), (5, 3), (1, 1)])
def test_they_cover_the_image_without_gaps(size: tuple[int, int]) -> None:
    found = find_super_pixels(_scene(*size))
    assert found.ids.shape == size[::-1]
    assert np.array_equal(np.unique(found.ids), np.arange(len(found.innermost)))


def test_each_is_one_piece_of_about_the_same_size_on_one_side_of_an_edge() -> None:
    rgb = _scene(576, 324)
    found = find_super_pixels(rgb)
    sizes = np.bincount(found.ids.ravel())
    assert 400 < 576 * 324 / len(sizes) < 500  # the grid has cells of 20 pixels and more
    assert (sizes < 1600).mean() > 0.95
    for region, (x, y) in enumerate(found.innermost):
        mine = np.pad((found.ids == region).astype(np.uint8), 1)
        assert cv2.connectedComponents(mine, connectivity=8)[0] == 2  # the region and the rest
        if region % 20 == 0:  # the innermost pixel is far from the border
            distance = cv2.distanceTransform(mine, cv2.DIST_L2, 5)[1:-1, 1:-1]
            assert found.ids[y, x] == region
            assert distance[y, x] > distance.max() - 1.5
    share = np.bincount(found.ids.ravel(), weights=(rgb[..., 0] > 120).ravel()) / sizes
    assert (np.minimum(share, 1.0 - share) < 0.1).mean() > 0.99


@pytest.mark.parametrize("width", [1152, 1280, 1999, 3840])
def test_a_large_image_is_shrunk_and_its_pixels_are_found_again(width: int) -> None:
    found = find_super_pixels(_scene(width, width // 2))
    assert found.ids.shape[1] == MAX_WIDTH_PX
    for region in range(0, len(found.innermost), 7):
        x, y = found.innermost_of(region)
        assert 0 <= x < width
        assert found.at(x, y) == region
    assert found.at(width - 1, width // 2 - 1) == found.ids[-1, -1]


# --- mistakes in a picks file are found before a teacher is trained -------------------------------

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
