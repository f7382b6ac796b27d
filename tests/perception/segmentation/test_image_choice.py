"""Which frames are kept for a training, and which is picked next."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from perception.segmentation.training.frame_choice import clear_ones, different_ones, look_at
from perception.segmentation.training.pick_session import ImageChooser, PickSession, wanted_use
from tests.perception.segmentation import pick_places
from tests.perception.segmentation.pick_places import CRATE, FLOOR, PLACE, session_of
from uav_bt.errors import ValueRangeError

Grey = NDArray[np.uint8]


def pattern(seed: int) -> Grey:
    """Return 180x320 grey rectangles."""
    random = np.random.default_rng(seed)
    return np.kron(random.integers(40, 220, (18, 32)), np.ones((10, 10))).astype(np.uint8)


def blurred(grey: Grey, sigma_px: float) -> Grey:
    return np.asarray(cv2.GaussianBlur(grey, (0, 0), sigma_px), dtype=np.uint8)


def noisy(grey: Grey, seed: int) -> Grey:
    noise = np.random.default_rng(seed).normal(0.0, 4.0, grey.shape)
    return np.clip(grey + noise, 0, 255).astype(np.uint8)


def test_blur_lowers_the_sharpness_and_the_size_does_not() -> None:
    sharp, soft = (look_at(blurred(pattern(0), sigma)).sharpness for sigma in (0.5, 3.0))
    assert sharp > 10.0 * soft
    large = np.asarray(cv2.resize(pattern(0), (1280, 720), interpolation=cv2.INTER_NEAREST))
    assert look_at(large).sharpness == pytest.approx(look_at(pattern(0)).sharpness, rel=0.01)


def test_blurred_and_blank_images_are_left_out() -> None:
    """One colour, black, the noise of a dark image, dark."""
    plain, black = np.full((180, 320), 130, np.uint8), np.zeros((180, 320), np.uint8)
    blank = [plain, black, noisy(black + np.uint8(8), 1), (pattern(0) // 20).astype(np.uint8)]
    sharp = [pattern(seed) for seed in range(4)]
    assert [look_at(image).blank for image in [*blank, *sharp]] == [True] * 4 + [False] * 4
    clear = clear_ones([look_at(image) for image in [*sharp, blurred(pattern(4), 4.0), black]])
    assert clear.tolist() == [True] * 4 + [False] * 2
    # None of a video out of focus is clear.
    assert not clear_ones([look_at(blurred(image, 12.0)) for image in sharp]).any()
    assert clear_ones([]).shape == (0,)


def test_nearly_the_same_images_are_taken_once() -> None:
    brighter = np.clip(pattern(1) * 0.8 + 50.0, 0, 255).astype(np.uint8)
    images = [pattern(0), noisy(pattern(0), 1), pattern(1), noisy(pattern(1), 2), brighter]
    chosen = different_ones([look_at(image) for image in images])
    assert {index // 2 for index in chosen if index < 4} == {0, 1}
    assert len(chosen) == 2
    assert different_ones([]) == []
    # The farthest image follows the sharpest.
    half = pattern(0)
    half[:, 160:] = pattern(1)[:, 160:]
    images = [blurred(half, 1.0), pattern(0), blurred(pattern(1), 1.0)]
    assert different_ones([look_at(image) for image in images]) == [1, 2, 0]


# --- the next image -------------------------------------------------------------------------------

BROWN = (125, 105, 50)  # between floor and crate


def _images(folder: Path, *shown: Sequence[tuple[int, int, int]], checks: str = "") -> PickSession:
    uses = {}
    for number, colours in enumerate(shown):
        pick_places.write_image(folder / "frames" / f"{number}.png", *colours, seed=number)
        uses[f"{number}.png"] = "check" if str(number) in checks else "train"
    return session_of(folder, uses)


def _pick(session: PickSession, image: str, *, right: str = "crate") -> None:
    session.paint(image, [(x, y) for x in range(5, 70, 4) for y in range(5, 90, 4)], "floor")
    session.paint(image, [(x, y) for x in range(90, 155, 4) for y in range(5, 90, 4)], right)


def test_the_least_sure_image_comes_next(tmp_path: Path) -> None:
    clear = (FLOOR, CRATE)
    session = _images(tmp_path, clear, clear, clear, (FLOOR, BROWN, CRATE), clear)
    _pick(session, "0.png")
    image, reason = ImageChooser(session.images, PLACE).choose(session.picks, "0.png")
    assert image == "3.png"
    assert "least sure of it, of 4" in reason


def test_a_new_teacher_follows_new_picks(tmp_path: Path) -> None:
    session = _images(tmp_path, (FLOOR, CRATE), (FLOOR, BROWN), (BROWN, FLOOR), (CRATE, FLOOR))
    chooser = ImageChooser(session.images, PLACE)
    for image, right, asked in (("0.png", "crate", "3.png"), ("1.png", "pad", "2.png")):
        _pick(session, image, right=right)
        ids = chooser.class_map(asked, session.picks)
        assert ids.shape == (324, 576)
        assert set(np.unique(ids[:, 50:200])) == {PLACE.id_of(right)}
        assert set(np.unique(ids[:, 380:530])) == {PLACE.id_of("floor")}


def test_without_a_teacher_images_far_from_the_others_come(tmp_path: Path) -> None:
    """A teacher does not learn from images for the check."""
    session = _images(tmp_path, *[(FLOOR,)] * 9)
    chooser = ImageChooser(session.images, PLACE)
    for shown, following in (("0.png", "8.png"), ("8.png", "4.png"), ("4.png", "2.png")):
        assert chooser.choose(session.picks, shown)[0] == following
    session = _images(tmp_path, (FLOOR, CRATE), (FLOOR, CRATE), checks="0")
    _pick(session, "0.png")
    chooser = ImageChooser(session.images, PLACE)
    assert chooser.choose(session.picks)[1] == "far from the others"
    with pytest.raises(ValueRangeError, match="needs picks of two classes"):
        chooser.class_map("1.png", session.picks)


def test_each_image_without_picks_is_offered_once_before_any_comes_again(tmp_path: Path) -> None:
    session = _images(tmp_path, *[(FLOOR, CRATE)] * 4)
    chooser = ImageChooser(session.images, PLACE)
    _pick(session, "0.png")
    found = [str(chooser.choose(session.picks)[0]) for _ in range(6)]
    assert set(found[:3]) == set(found[3:]) == {"1.png", "2.png", "3.png"}


def test_one_image_in_five_is_for_the_check() -> None:
    picked: list[str] = []
    for _ in range(20):
        picked.append(wanted_use(picked))
        checks, total = picked.count("check"), len(picked)
        assert checks == 0 if total < 5 else total / 5 <= checks <= total / 5 + 1


def test_the_use_that_is_short_comes_next(tmp_path: Path) -> None:
    session = _images(tmp_path, *[(FLOOR, CRATE)] * 7, checks="56")
    chooser = ImageChooser(session.images, PLACE)
    for name in ("0.png", "1.png", "2.png", "3.png"):
        _pick(session, name)
    assert chooser.choose(session.picks)[0] in {"5.png", "6.png"}
    for picked, wanted in (("5.png", "6.png"), ("6.png", "4.png"), ("4.png", None)):
        _pick(session, picked)
        assert chooser.choose(session.picks)[0] == wanted
